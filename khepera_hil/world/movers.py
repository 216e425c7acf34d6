"""How a mover goes along its path: at each step it wants to go straight to the next point."""

from __future__ import annotations

import math
from collections.abc import Sequence

__all__ = ["Walk"]

_THERE = 5.0
"""mm from a point of the path at which it counts as reached."""


class Walk:
    """A path that is walked ``rounds`` times at ``speed`` mm/s, from its first point."""

    def __init__(self, path: Sequence[tuple[float, float]], speed: float, rounds: int) -> None:
        self._path = path
        self._speed = speed
        self._points = 1 + (len(path) - 1) + (rounds - 1) * len(path)
        """How many points there are, the first one too; each later round begins with the way back to it."""
        self._next = 1

    def velocity(self, place: tuple[float, float], step: float) -> tuple[float, float] | None:
        """Where to, mm/s; never past the next point within ``step`` seconds. None at the end."""
        while self._next < self._points:
            x, y = self._path[self._next % len(self._path)]
            way = math.hypot(x - place[0], y - place[1])
            if way > _THERE:
                speed = min(self._speed, way / step)
                return speed * (x - place[0]) / way, speed * (y - place[1]) / way
            self._next += 1
        return None
