"""Time as an object (a leaf that anyone may import).

The loop asks its clock what time it is and sleeps on it; what kind of clock it is decides whether that takes
a tenth of a second or a few microseconds. With :class:`SimulatedClock` computing takes no time, bytes on the
wire and sleeping do, and everything runs in one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

__all__ = ["Clock", "SimulatedClock", "WallClock"]


class Clock(Protocol):
    """What the loop, the link and the emulated port know of time. Seconds, from an origin of the clock's own."""

    simulated: bool

    def now(self) -> float:
        """Seconds since the clock's origin; never goes back."""

    def sleep_until(self, moment: float) -> None:
        """Return when :meth:`now` is at least ``moment`` (at once if it already is)."""


class WallClock:
    """The host's monotonic clock, its origin at the construction."""

    simulated = False

    def __init__(self) -> None:
        self._origin = time.monotonic()

    def now(self) -> float:
        """Seconds since the construction."""
        return time.monotonic() - self._origin

    def sleep_until(self, moment: float) -> None:
        """Sleep on the host until ``moment``; the host may wake us later, never earlier."""
        while (left := moment - self.now()) > 0:
            time.sleep(left)


class SimulatedClock:
    """A clock that only moves when somebody sleeps on it."""

    simulated = True

    def __init__(self) -> None:
        self._now = 0.0
        self.on_advance: Callable[[float], None] | None = None
        """Called with the new time after each move; the emulated world hangs here."""

    def now(self) -> float:
        """Seconds slept so far."""
        return self._now

    def sleep_until(self, moment: float) -> None:
        """Move to ``moment`` and let the emulated world follow."""
        if moment > self._now:
            self._now = moment
            if self.on_advance is not None:
                self.on_advance(moment)
