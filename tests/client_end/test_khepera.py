"""The manual's dialogues, to the last byte, and how the robot is found and stopped."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.clock import SimulatedClock
from khepera_hil.errors import BadAnswer, LinkLost, NoAnswer, ProtocolError
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from tests.client_end.lines import BAUD, BOOT_TEXT, SYNCHRONISED, FaultyRobot, ScriptedPort, SimulatedPort, Turn


def robot_behind(port: SimulatedPort, baud: int = BAUD) -> Khepera:
    return Khepera(Link(port, port.clock, baud=baud))


def scripted(*script: Turn) -> tuple[Khepera, ScriptedPort]:
    port = ScriptedPort(SimulatedClock(), *script)
    return robot_behind(port), port


@pytest.mark.parametrize(
    ("call", "sent", "answer", "result"),
    [
        (lambda k: k.version(), b"B\n", b"b,5.02,5.01\r\n", ("5.02", "5.01")),
        (lambda k: k.set_speed(-20, 20), b"D,-20,20\n", b"d\r\n", (-20, 20)),
        (lambda k: k.set_speed(1e9, -128), b"D,127,-127\n", b"d\r\n", (127, -127)),
        (lambda k: k.set_speed(1.6, -0.2), b"D,2,0\n", b"d\r\n", (2, 0)),
        (lambda k: k.set_speed(np.float64(3.4), np.int64(-7)), b"D,3,-7\n", b"d\r\n", (3, -7)),
        (lambda k: k.speeds(), b"E\n", b"e,-19,20\r\n", (-19, 20)),
        (lambda k: k.set_positions(-2147483648, 2147483647), b"G,-2147483648,2147483647\n", b"g\r\n", None),
        (lambda k: k.positions(), b"H\n", b"h,-2147483648,2147483647\r\n", (-2147483648, 2147483647)),
        (lambda k: k.status(), b"K\n", b"k,0,0,-3,1,2,4\r\n", (0, 0, -3, 1, 2, 4)),
        (lambda k: k.led(1, 2), b"L,1,2\n", b"l\r\n", None),
        (lambda k: k.proximity(), b"N\n", b"n,0,5,12,1023,1020,0,3,1\r\n", (0, 5, 12, 1023, 1020, 0, 3, 1)),
        (
            lambda k: k.light(),
            b"O\n",
            b"o,450,501,498,50,500,499,511,470\r\n",
            (450, 501, 498, 50, 500, 499, 511, 470),
        ),
        (lambda k: k.stop(), b"D,0,0\n", b"d\r\n", True),
        # Commands without a capability of their own are asked by their letters.
        (lambda k: k.link.ask("A", 3800, 800, 100), b"A,3800,800,100\n", b"a\r\n", ()),
        (lambda k: k.link.ask("C", -8388606, 8388606), b"C,-8388606,8388606\n", b"c\r\n", ()),
        (lambda k: k.link.ask("F", 3000, 20, 4000), b"F,3000,20,4000\n", b"f\r\n", ()),
        (lambda k: k.link.ask("I", 5), b"I,5\n", b"i,1023\r\n", (1023,)),
        (lambda k: k.link.ask("J", 20, 64, 20, 64), b"J,20,64,20,64\n", b"j\r\n", ()),
        (lambda k: k.link.ask("P", -255, 255), b"P,-255,255\n", b"p\r\n", ()),
        (lambda k: k.link.ask("R", 32), b"R,32\n", b"r,255\r\n", (255,)),
        (lambda k: k.link.ask("W", 1, 32), b"W,1,32\n", b"w\r\n", ()),
        (lambda k: k.link.ask("T", 2, "U,7"), b"T,2,U,7\n", b"t,2,u\r\n", (2, "u")),
    ],
)
def test_each_command_is_the_manuals_dialogue(
    call: Callable[[Khepera], object], sent: bytes, answer: bytes, result: object
) -> None:
    khepera, port = scripted(*SYNCHRONISED, Turn(sent, answer))
    khepera.link.resynchronise()
    assert call(khepera) == result
    assert port.finished
    assert khepera.link.last_answer.encode() + b"\r\n" == answer


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(allow_nan=False, allow_infinity=False))
def test_what_was_sent_is_returned_and_lies_within_the_robots_speeds(left: float, right: float) -> None:
    port = SimulatedPort(SimulatedClock())
    khepera = robot_behind(port)
    port.come(b"b,5.01,5.00\r\n", after=0.021)  # the answer to the first probe
    port.come(b"d\r\n", after=0.036)
    sent = khepera.set_speed(left, right)
    assert f"D,{sent[0]},{sent[1]}\n".encode() == port.written.splitlines(keepends=True)[-1]
    for wanted, got in zip((left, right), sent, strict=True):
        assert -127 <= got <= 127
        assert abs(got - min(max(wanted, -127), 127)) <= 0.5


@pytest.mark.parametrize("speed", [math.nan, math.inf, -math.inf])
def test_a_speed_that_is_not_finite_is_never_sent(speed: float) -> None:
    khepera, port = scripted()
    for pair in ((speed, 0), (0, speed)):
        with pytest.raises(ProtocolError, match="finite"):
            khepera.set_speed(*pair)
    assert not port.written


# Finding the robot


def test_the_handshake_asks_for_the_version() -> None:
    khepera, port = scripted(*SYNCHRONISED, Turn(b"B\n", b"b,5.01,5.00\r\n"))
    assert khepera.handshake() == ("5.01", "5.00")
    assert port.finished


def test_the_handshake_waits_for_the_end_of_the_boot_text() -> None:
    khepera, port = scripted(*SYNCHRONISED, Turn(b"B\n", b"b,6.01 beta,6.00\r\n"))
    port.come(b"\r\n" * 5 + b"." * 1000 + BOOT_TEXT, each=11 / 9600)
    # More than one attempt may pass before it ends: each begins with an empty line, and asks nothing.
    port.respond(b"")
    script = port._script
    for _ in range(4):
        script.appendleft(Turn(b"\n"))
    assert khepera.handshake() == ("6.01 beta", "6.00")
    assert port.finished


def test_the_handshake_comes_through_a_line_full_of_faults() -> None:
    for seed in range(20):
        port = FaultyRobot(SimulatedClock(), np.random.default_rng(seed), rate=0.2)
        port.come(b"\x00\xff,n,3\r\n" + BOOT_TEXT)
        assert robot_behind(port).handshake() == ("5.01", "5.00")


@pytest.mark.parametrize(("baud", "mode"), [(9600, "in mode 1"), (38400, "in mode 3"), (300, "serial protocol")])
def test_a_silent_robot_is_told_in_a_sentence_within_about_a_second(baud: int, mode: str) -> None:
    port = SimulatedPort(SimulatedClock())
    with pytest.raises(NoAnswer) as failure:
        robot_behind(port, baud).handshake()
    assert f"no Khepera answers on /dev/scripted at {baud} baud" in str(failure.value)
    assert mode in str(failure.value)
    assert "(--baud)?" in str(failure.value)
    assert 1.0 <= port.clock.now() < 2.5
    assert not any(line in port.written for line in (b"D", b"C", b"P")), "nothing that moves the wheels"


def test_a_line_that_talks_nonsense_is_told_with_another_rate() -> None:
    class WrongRate(SimulatedPort):
        def respond(self, data: bytes) -> None:
            self.come(b"\xe6\x00\xf8\x80", after=0.002)

    port = WrongRate(SimulatedClock())
    with pytest.raises(BadAnswer, match=r"does not speak the Khepera's protocol: try another rate \(--baud\)"):
        robot_behind(port).handshake()
    assert port.clock.now() < 4


def test_a_line_that_babbles_without_end_is_given_up() -> None:
    port = SimulatedPort(SimulatedClock())
    port.come(b"U" * 40_000)
    with pytest.raises(BadAnswer):
        robot_behind(port).handshake()
    assert port.clock.now() < 4


# Stopping


def test_a_stop_that_is_not_answered_is_sent_blindly_and_repeated() -> None:
    khepera, port = scripted(
        *SYNCHRONISED,
        Turn(b"D,0,0\n"),
        Turn(b"\nD,0,0\n", b"d\r\n"),
        Turn(b"\n"),
        Turn(b"K\n", b"k,0,0,0,0,0,0\r\n"),
        Turn(b"D,0,0\n", b"d\r\n"),
    )
    khepera.link.resynchronise()
    assert khepera.stop()
    assert port.finished


def test_on_a_line_that_is_not_trusted_the_stop_goes_out_before_anything_else() -> None:
    khepera, port = scripted(Turn(b"\nD,0,0\n", b"d\r\n"), *SYNCHRONISED, Turn(b"D,0,0\n", b"d\r\n"))
    assert khepera.stop()
    assert port.finished


def test_a_silent_robot_is_told_to_stop_many_times_within_a_second() -> None:
    port = SimulatedPort(SimulatedClock())
    assert not robot_behind(port).stop()
    assert port.written.count(b"\nD,0,0\n") >= 5
    assert port.written.endswith(b"\nD,0,0\n")
    assert port.clock.now() < 1.0


@pytest.mark.parametrize("seed", range(20))
def test_a_stop_on_a_faulty_line_is_confirmed_or_said_not_to_be(seed: int) -> None:
    port = FaultyRobot(SimulatedClock(), np.random.default_rng(seed), rate=0.5)
    khepera = robot_behind(port)
    for _ in range(10):
        assert khepera.stop() in (True, False)
        assert b"D,0,0\n" in port.written
        port.written.clear()


def test_a_stop_on_a_lost_line_says_that_it_is_lost() -> None:
    khepera, _ = scripted()
    khepera.link.close()
    with pytest.raises(LinkLost):
        khepera.stop()
