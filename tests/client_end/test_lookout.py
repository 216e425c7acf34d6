"""A search for who takes bytes away, in pieces."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from khepera_hil import lookout
from khepera_hil.clock import SimulatedClock
from khepera_hil.lookout import AGAIN, PIECE, Lookout

STEP = PIECE * 0.4
"""Seconds that one process takes here."""


class Machine:
    """Runs so many processes, each looked at for STEP seconds; ``rivals`` have the port open."""

    def __init__(self, clock: SimulatedClock, count: int) -> None:
        self.clock, self.count = clock, count
        self.rivals: set[int] = set()
        self.looked = 0

    def search(self, port: object) -> Iterator[str | None]:
        for number in range(self.count):
            self.clock.sleep_until(self.clock.now() + STEP)
            self.looked += 1
            yield f"pid {number}" if number in self.rivals else None


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    machine = Machine(SimulatedClock(), 10)
    monkeypatch.setattr(lookout, "search", machine.search)
    return machine


def test_nothing_is_looked_at_until_somebody_is_suspected(machine: Machine) -> None:
    watch = Lookout(None, machine.clock)  # type: ignore[arg-type] # the machine does not look at it
    watch.look()
    assert (machine.looked, watch.others) == (0, "")


def test_a_piece_ends_with_the_process_at_which_its_time_is_over(machine: Machine) -> None:
    watch = Lookout(None, machine.clock)  # type: ignore[arg-type]
    watch.suspect()
    pieces = []
    while machine.looked < machine.count:
        before = machine.looked
        watch.look()
        pieces.append(machine.looked - before)
    assert pieces == [3, 3, 3, 1]


def test_what_was_found_is_told_when_all_were_looked_at_and_for_a_while_only(machine: Machine) -> None:
    machine.rivals = {2, 7}
    watch = Lookout(None, machine.clock)  # type: ignore[arg-type]
    watch.suspect()
    for _ in range(3):
        watch.look()
        assert watch.others == ""
    watch.look()
    assert watch.others == "pid 2, pid 7"
    machine.clock.sleep_until(machine.clock.now() + 2 * AGAIN)
    assert watch.others == ""


def test_a_new_search_has_to_wait_and_what_was_found_before_is_told_until_it_ends(machine: Machine) -> None:
    machine.rivals = {2}
    watch = Lookout(None, machine.clock)  # type: ignore[arg-type]
    watch.suspect()
    for _ in range(4):
        watch.look()
    machine.rivals = {5}
    watch.suspect()
    watch.look()
    assert machine.looked == machine.count  # too soon
    machine.clock.sleep_until(machine.clock.now() + AGAIN)
    watch.suspect()
    watch.look()
    assert watch.others == "pid 2"
    for _ in range(3):
        watch.look()
    assert watch.others == "pid 5"
