"""An emulated robot at the end of a bad line: the emulator's own methods, with faults on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from khepera_hil import chance
from khepera_hil.emulator import Emulator
from khepera_hil.faults import Fault, Faults
from khepera_hil.faultspec import Specification
from khepera_hil.world import LinkFault, World

__all__ = ["Disturbed", "line_faults"]


_KINDS = {"lost": "drop", "garbled": "flip", "silent": "drop"}  # a scenario's words for what happens to bytes


def line_faults(
    faults: Specification, seed: int, robot: int = 1, *, on_fault: Callable[[Fault], None] | None = None
) -> Faults:
    """The faults of one robot's line, by a chance of its own: of ``seed``, or of the seed that they bring."""
    if robot > 1 and faults.seed is not None:
        seed, faults = faults.seed, replace(faults, seed=None)
    return Faults(faults, chance.streams(seed, robot)["line"], on_fault=on_fault)


class Disturbed(Emulator):
    """An emulator whose bytes pass ``faults`` both ways; otherwise as :class:`~khepera_hil.emulator.Emulator`.

    The world's scenario may have troubles of the line too; they are put to ``faults`` when their time comes.
    That a line is unplugged is not to be seen from bytes alone: who carries them asks :meth:`unplugged`.
    """

    def __init__(self, world: World, baud: int, *, faults: Faults, **settings: Any) -> None:
        super().__init__(world, baud, **settings)
        self.faults = faults
        self._unpluggings = 0

    def unplugged(self, now: float) -> bool:
        """Whether whoever had the line open has lost it, also when it is plugged in again since."""
        return not self.faults.connected(now) or self.faults.unpluggings != self._unpluggings

    def plug_in(self, now: float) -> bool:
        """Open the line again: whether it is there. What the robot said meanwhile was said to nobody."""
        if not self.faults.connected(now):
            return False
        super().transmitted(now)
        self._unpluggings = self.faults.unpluggings
        return True

    def advance(self, now: float) -> None:
        """Let everything happen that happens until ``now``, and the world's own troubles of the line begin."""
        super().advance(now)
        self.world.advance(now)  # whose troubles begin on time
        for event in self.body.due(LinkFault):
            self.faults.trouble(_KINDS[event.fault], event.share, event.at, event.at + event.lasts)

    def receive(self, data: bytes, now: float) -> None:
        """The host puts ``data`` on the wire, behind what it has not sent yet."""
        if passed := self.faults.to_robot(data, now):
            super().receive(passed, now)

    def transmitted(self, now: float) -> bytes:
        """Take out what has come to the host's driver by ``now``."""
        if held_back := self.faults.to_robot(b"", now):
            super().receive(held_back, now)
        return self.faults.to_host(super().transmitted(now), now)

    def next_event(self) -> float | None:
        """A moment before which the host sees no further byte, unless it sends something (None: never)."""
        moments = (super().next_event(), self.faults.next_event())
        return min((moment for moment in moments if moment is not None), default=None)
