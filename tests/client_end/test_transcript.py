"""What the log keeps of a tick's exchanges is what the program was given."""

from __future__ import annotations

import pytest

from khepera_hil.perception import Need
from khepera_hil.transcript import name_of, readings

N = "n,1,2,3,4,5,6,7,{}"
IMAGE = Need("T", (2, "O"), every=3)


def kept(*requests: bytes) -> list[str]:
    raw: dict[str, str] = {}
    for request in requests:
        raw[name_of(request, raw)] = "n"
    return list(raw)


def test_each_exchange_has_a_name_of_its_own() -> None:
    assert kept(b"N\n", b"O\n", b"D,1,1\n", b"N\n", b"N\n", b"I,3\n", b"I,4\n", b"T,2,N\n", b"\nD,0,0\n") == [
        "N", "O", "D", "N 2", "N 3", "I,3", "I,4", "T,2,N", "D 2",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("last", "value"), [(("8",), 8), (("8", "9"), 9), (("8", "900", "10"), 10), (("500", "8", "9"), 9)]
)
def test_what_was_read_more_than_once_counts_as_it_was_settled(last: tuple[str, ...], value: int) -> None:
    raw = {("N", "N 2", "N 3")[place]: N.format(text) for place, text in enumerate(last)}
    found = readings(raw, ("N",))
    assert found is not None
    assert found.proximity == (1, 2, 3, 4, 5, 6, 7, value)


def test_slow_readings_are_there_when_they_were_due() -> None:
    raw = {"N": N.format(8)}
    without = readings(raw, ("N", IMAGE))
    with_it = readings(raw | {"T,2,O": "t,2,o,31"}, ("N", IMAGE))
    assert without is not None
    assert with_it is not None
    assert without.answers == {}
    assert with_it.answers == {("T", 2, "O"): ("o", 31)}


@pytest.mark.parametrize("text", ["", "n,1,2", "z,Protocol error", "n,1,2,3,4,5,6,7,8\n", "\xff"])
def test_a_tick_that_lacks_a_reading_has_none(text: str) -> None:
    assert readings({"N": text}, ("N",)) is None
    assert readings({}, ("N",)) is None
