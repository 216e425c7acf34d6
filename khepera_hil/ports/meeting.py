"""Several programs, each on its own robot, in one simulated world of this process.

Each program has a thread of its own, but only one of them runs at a time: the one whose sleep ends first, and of
two the one with the lower number. So what happens depends on what the programs do and on nothing else.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

from khepera_hil.emulator import Company, Emulator
from khepera_hil.errors import UsageError
from khepera_hil.world import World

__all__ = ["Meeting", "Seat", "Turns", "meeting"]

PATIENCE = 60.0
"""Seconds of this computer's time for which a program waits for the others to come."""

Shared = Mapping[str, object]


class Turns:
    """Simulated time for the programs ``numbers``: it moves when all that run are asleep, to the first to wake."""

    def __init__(self, numbers: range) -> None:
        self.now = 0.0
        self._absent = set(numbers)
        self._wakes: dict[int, float] = {}
        self._running: int | None = None
        self._turn = threading.Condition()

    def arrive(self, number: int) -> set[int]:
        """Wait for all others, and for one's turn; those who did not come, if there are any."""
        with self._turn:
            self._absent.discard(number)
            self._wakes[number] = self.now
            self._pass_on()
            end = time.monotonic() + PATIENCE
            while self._running != number:
                self._turn.wait(None if not self._absent else max(0.0, end - time.monotonic()))
                if self._absent and time.monotonic() >= end:
                    absent = set(self._absent)
                    self._absent.add(number)
                    del self._wakes[number]
                    return absent
        return set()

    def sleep(self, number: int, moment: float) -> None:
        """Let the others go on until it is ``moment``."""
        with self._turn:
            if moment <= self.now:
                return
            self._wakes[number] = moment
            self._pass_on()
            while self._running != number:
                self._turn.wait()

    def leave(self, number: int) -> None:
        """A program that runs has ended; the others go on without it."""
        with self._turn:
            if self._running == number:
                self._pass_on()

    def _pass_on(self) -> None:
        self._running = None
        if self._wakes and not self._absent:
            self._running = min(self._wakes, key=lambda number: (self._wakes[number], number))
            self.now = max(self.now, self._wakes.pop(self._running))
            self._turn.notify_all()


class Seat:
    """A program's clock in a meeting."""

    simulated = True

    def __init__(self, turns: Turns, number: int) -> None:
        self._turns, self._number = turns, number
        self.on_advance: Callable[[float], None] | None = None
        """Called with the new time after each move; the robot's end of the line hangs here."""

    def now(self) -> float:
        """Seconds since the world's power-up."""
        return self._turns.now

    def sleep_until(self, moment: float) -> None:
        """Let the others go on until ``moment``."""
        if moment > self._turns.now:
            self._turns.sleep(self._number, moment)
            if self.on_advance is not None:
                self.on_advance(moment)


class Meeting:
    """A world for several ports, over when all have been closed. ``shared`` is what all must ask for alike."""

    def __init__(self, name: str, shared: Shared, world: World) -> None:
        self.world = world
        self.shared = shared
        self._name = name
        self._turns = Turns(range(1, len(world.robots) + 1))
        self._emulators: dict[int, Emulator] = {}
        self._open: set[int] = set()

    def claim(self, emulator: Emulator) -> Seat:
        """A robot's port is opened. Raises UsageError where the robot has, or had, one already."""
        number = emulator.body.number
        if number in self._emulators:
            raise UsageError(f"emulator:// share={self._name}: robot {number} has its program already")
        self._emulators[number] = emulator
        self._open.add(number)
        if len(self._emulators) == len(self.world.robots):
            Company(self._emulators.values())
        return Seat(self._turns, number)

    def begin(self, number: int) -> None:
        """Wait until every robot has its program. Raises UsageError when one does not come."""
        if absent := self._turns.arrive(number):
            with _LOCK:
                del self._emulators[number]
            self._forget(number)
            who = ", ".join(f"robot {robot}" for robot in sorted(absent))
            raise UsageError(f"emulator:// share={self._name}: nobody has opened the port of {who}")

    def leave(self, number: int) -> None:
        """A robot's port was closed; the robot goes on as it was told."""
        self._forget(number)
        self._turns.leave(number)

    def _forget(self, number: int) -> None:
        with _LOCK:
            self._open.discard(number)
            if not self._open and _MEETINGS.get(self._name) is self:
                del _MEETINGS[self._name]


_MEETINGS: dict[str, Meeting] = {}
_LOCK = threading.Lock()


def meeting(
    name: str, shared: Shared, make: Callable[[], World], join: Callable[[World], Emulator]
) -> tuple[Meeting, Emulator, Seat]:
    """The meeting ``name``, which begins here if there is none, joined as the robot that ``join`` makes.

    Raises UsageError where its robot is taken, or where it is of another world than ``shared`` says.
    """
    with _LOCK:
        found = _MEETINGS.get(name) or Meeting(name, shared, make())
        for key, value in shared.items():
            if found.shared[key] != value:
                raise UsageError(f"emulator:// share={name} is a world with {key} {found.shared[key]}, not {value}")
        emulator = join(found.world)
        seat = found.claim(emulator)
        _MEETINGS[name] = found
    return found, emulator, seat
