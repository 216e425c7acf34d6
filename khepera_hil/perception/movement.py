"""Whether something moves before the camera, while the robot stands still."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

__all__ = ["Movement"]

SETTLE = 3
"""Ticks that the wheels must have stood still before a frame counts."""

CALIBRATE = 5
"""Frames by which a still picture is known."""

_FLOOR = 0.5  # of the deviation of a still picture, in grey levels
_DEVIATIONS = 4.0
_IN_A_ROW = 2


class Movement:
    """Two frames of a still robot differ by the camera's noise, unless something moves (proposed).

    Each frame is scaled to a mean of 128, so that a lamp that flickers is no movement, and D is the mean absolute
    difference of two frames. The first five D of a stop say what is usual; two in a row of more than four
    deviations above that are a movement. Only one alarm is given in a stop. What moves during these first five
    frames already passes for usual.
    """

    def __init__(self) -> None:
        self.difference: float | None = None
        """D of the last two frames of this stop, in grey levels."""
        self._still = 0
        self._before: list[float] = []
        self._usual: list[float] = []
        self._high = 0
        self._told = False

    def step(self, frame: Sequence[int] | None, *, standing: bool) -> bool:
        """Whether something begins to move at this tick. ``frame``: grey levels, or None when it was not asked;
        ``standing``: whether the wheels have not turned since the last tick."""
        if not standing:
            self.__init__()  # type: ignore[misc]  # the next stop begins anew
            return False
        self._still += 1
        if frame is None or self._still <= SETTLE or not sum(frame):
            return False
        scale = 128 * len(frame) / sum(frame)
        now = [scale * value for value in frame]
        before, self._before = self._before, now
        if not before:
            return False
        d = self.difference = sum(abs(a - b) for a, b in zip(now, before, strict=True)) / len(now)
        if len(self._usual) < CALIBRATE:
            self._usual.append(d)
            return False
        mean = sum(self._usual) / CALIBRATE
        deviation = sqrt(sum((usual - mean) ** 2 for usual in self._usual) / (CALIBRATE - 1))
        self._high = self._high + 1 if d > mean + _DEVIATIONS * max(deviation, _FLOOR) else 0
        if self._told or self._high < _IN_A_ROW:
            return False
        self._told = True
        return True
