"""A scenario's troubles of the line, on the emulated robot's bytes."""

import numpy as np
import pytest

from khepera_hil.disturbed import Disturbed
from khepera_hil.faults import Faults
from khepera_hil.faultspec import Specification
from khepera_hil.world import LinkFault, Scenario, World


def answers(fault: str, share: float) -> tuple[bytes, bytes]:
    """What came for a hundred B while the trouble lasted, and for a hundred after it."""
    scenario = Scenario("made", "", (LinkFault(1.0, fault, share, 10.0),))
    faults = Faults(Specification(()), np.random.SeedSequence(1))
    robot = Disturbed(World("empty", 0, scenario), 38400, faults=faults)
    robot.transmitted(1.0)
    came = []
    for begin in (1.0, 12.0):
        heard = b""
        for number in range(100):
            robot.receive(b"B\n", begin + number * 0.05)
            heard += robot.transmitted(begin + number * 0.05 + 0.049)
        came.append(heard)
    return came[0], came[1]


_WHOLE = 100 * b"b,5.01,5.00\r\n"


@pytest.mark.parametrize("fault", ["lost", "garbled", "silent"])
def test_a_trouble_does_what_it_says_for_as_long_as_it_says(fault: str) -> None:
    during, after = answers(fault, 1.0 if fault == "silent" else 0.02)
    assert after == _WHOLE
    if fault == "silent":
        assert during == b""
    else:
        assert during != _WHOLE
        assert during.count(b"b,5.01,5.00\r\n") > 30
    if fault == "lost":
        assert set(during) <= set(_WHOLE + b"Command not found\r\n")
    if fault == "garbled":
        assert not set(during) <= set(_WHOLE + b"Command not found\r\n")
