"""The wheels as the service commands them: before they move, and once they stand, the guard is told."""

from __future__ import annotations

import contextlib

from khepera_hil.errors import GuardLost
from khepera_hil.guarding import Guarding
from khepera_hil.khepera import Khepera
from khepera_hil.lifecycle import Health
from khepera_hil.opening import descriptor

__all__ = ["Wheels"]

_STILL = 5
"""Pulses (0.4 mm) within which a counter is one that has just begun."""

_FAR = 250
"""Pulses (20 mm) that a wheel must have been told to turn by for its counter to be missed."""


class Wheels:
    """One robot's wheels, on one line after the other. Raises what :class:`Khepera` raises, and GuardLost."""

    def __init__(self, khepera: Khepera, guard: Guarding, health: Health) -> None:
        self._khepera, self._guard, self._health = khepera, guard, health
        self._speeds = (0, 0)
        self._since = khepera.link.clock.now()
        self._turned = [0.0, 0.0]  # pulses, by what they were told since the robot was last reset or asked

    def watch(self, khepera: Khepera) -> None:
        """These are the robot's on a line that was just opened; they may be moving."""
        self._khepera = khepera
        self._health.rested = False
        self._guard.watch(descriptor(khepera.link.port))

    def let_go(self) -> None:
        """The line is lost. What the guard holds of it would keep a device from coming back under its name."""
        self._health.rested = False
        self._guard.watch(None)

    def were_reset(self) -> bool:
        """Whether their counters say that the robot was switched off and on since it was last asked, or is another.

        A counter begins at 0. One that still stands there although its wheel was told to go far has begun anew.
        """
        counters = self._khepera.positions()
        self._told(0, 0)
        far = max(map(abs, self._turned)) > _FAR
        self._turned = [float(counter) for counter in counters]
        return far and max(map(abs, counters)) <= _STILL

    def forget(self) -> None:
        """The robot was reset: it counts from 0."""
        self._health.rested = False
        self._told(0, 0)
        self._turned = [0.0, 0.0]

    def move(self, left: int, right: int) -> tuple[int, int]:
        """Set their speeds; what was really sent.

        A process that hung may wake anywhere, also between its look at the guard and its order. So it looks again
        when the order has gone out; what went out in spite of a guard that had acted is taken back at once.
        """
        self._guard.moving()  # raises when nobody would stop them in our place
        self._health.rested = False
        link = self._khepera.link
        link.on_sent = self._guard.check
        try:
            sent = self._khepera.set_speed(left, right)
        finally:
            link.on_sent = None
        self._told(*sent)
        return sent

    def rest(self) -> tuple[int, int]:
        """Set their speeds to zero, as a request like any other; what was sent."""
        sent = self._khepera.set_speed(0, 0)
        self._told(0, 0)
        self._at_rest()
        return sent

    def halt(self) -> bool:
        """Order them to stand still at once, blindly if need be; whether the robot confirmed it."""
        confirmed = self._khepera.halt()
        self._told(0, 0)
        if not confirmed:
            return False
        self._at_rest()
        return True

    def stop(self) -> bool:
        """The same, and try hard. Nothing that becomes of the guard is in the way. Raises LinkLost only."""
        self._health.rested = False
        if self._khepera.stop():
            with contextlib.suppress(GuardLost):
                self._at_rest()
        return self._health.rested

    def beside(self, letter: str, *values: int | str) -> None:
        """A command that is not about the wheels, on the same line."""
        self._khepera.command(letter, *values)

    def _told(self, left: int, right: int) -> None:
        """A unit of speed is a pulse in 10 ms."""
        now = self._khepera.link.clock.now()
        for wheel, speed in enumerate(self._speeds):
            self._turned[wheel] += speed * (now - self._since) / 0.010
        self._speeds, self._since = (left, right), now

    def _at_rest(self) -> None:
        self._health.rested = True
        self._guard.resting()
