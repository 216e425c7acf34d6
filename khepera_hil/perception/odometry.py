"""Where the robot is by its own wheels' counters; slip and the wheels' unequal size are not seen by them."""

from __future__ import annotations

from math import cos, sin

from khepera_hil.perception.readings import Readings

__all__ = ["Odometry"]

_MM_A_PULSE = 1 / 12
_WHEEL_BASE = 53.0  # mm
_WRAP = 2**32


class Odometry:
    """Way (mm), heading (radians, counter-clockwise, not wrapped) and place (mm) since the first reading."""

    needs = "H"

    def __init__(self) -> None:
        self.way = self.heading = self.x = self.y = 0.0
        self._last: tuple[int, int] | None = None

    def step(self, readings: Readings) -> None:
        """Take in the counters, which wrap at 32 bits. Raises KeyError when they were not read."""
        left, right = (int(value) for value in readings.answers[("H",)])
        if self._last is not None:
            a, b = (
                _apart(now, before) * _MM_A_PULSE for now, before in zip((left, right), self._last, strict=True)
            )
            turn = (b - a) / _WHEEL_BASE
            ahead = (a + b) / 2
            self.x += ahead * cos(self.heading + turn / 2)
            self.y += ahead * sin(self.heading + turn / 2)
            self.heading += turn
            self.way += abs(ahead)
        self._last = left, right


def _apart(now: int, before: int) -> int:
    return (now - before + _WRAP // 2) % _WRAP - _WRAP // 2
