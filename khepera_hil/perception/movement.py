"""Whether something moves before the camera, while the robot stands still."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import sqrt
from statistics import fmean, median

__all__ = ["CALIBRATE", "SETTLE", "Movement"]

SETTLE = 3
"""Ticks that the wheels must have stood still before a frame counts."""

CALIBRATE = 4
"""Frames by which the still picture is known."""

_NOISE = 3.0  # grey levels: the least that a cell's readings are taken to deviate by
_DEVIATIONS = 4.5
_IN_A_ROW = 2


class Movement:
    """What is new before the still picture: it moves, or it has come (proposed).

    The still picture is the mean of the first frames of a stop. A frame is first brought to its exposure, by the
    median of what each cell has become, so that neither a lamp that flickers nor the camera's own adaptation is a
    movement. Then two neighbouring cells that have both changed by more than the noise allows, in two frames in a
    row, are one. The mean difference of two frames, the obvious measure, hardly shows a mouse: it covers a
    twentieth of the picture, and every other frame it stands before something as bright as itself.

    One alarm is given in a stop.
    """

    def __init__(self) -> None:
        self.changed: float | None = None
        """By how many deviations the most changed pair of cells has changed; None while it does not look."""
        self._still = 0
        self._frames: list[list[float]] = []
        self._picture: list[float] = []
        self._noise = 0.0
        self._high = 0
        self._told = False

    def step(self, frame: Sequence[int] | None, *, standing: bool) -> bool:
        """Whether something begins to move at this tick. ``frame``: grey levels, or None when it was not asked;
        ``standing``: whether the wheels have not turned since the last tick."""
        if not standing:
            if self._still:
                self.__init__()  # type: ignore[misc]  # the next stop begins anew
            return False
        self._still += 1
        if frame is None or self._still <= SETTLE or not any(frame):
            return False
        if len(frame) != len(self._frames[0] if self._frames else frame):
            return False
        if not self._picture:
            self._frames.append([float(value) for value in frame])
            if len(self._frames) == CALIBRATE:
                self._look_at(self._frames)
            return False
        gain = median(now / max(then, 1.0) for now, then in zip(frame, self._picture, strict=True)) or 1.0
        off = [now / gain - then for now, then in zip(frame, self._picture, strict=True)]
        self.changed = max(abs(a + b) for a, b in pairwise(off)) / 2 / (self._noise / sqrt(2))
        self._high = self._high + 1 if self.changed > _DEVIATIONS else 0
        if self._told or self._high < _IN_A_ROW:
            return False
        self._told = True
        return True

    def _look_at(self, frames: Sequence[Sequence[float]]) -> None:
        """The still picture, and what a cell of one more frame will deviate from it by."""
        count = len(frames)
        means = [fmean(frame) or 1.0 for frame in frames]
        even = [[value * means[-1] / mean for value in frame] for frame, mean in zip(frames, means, strict=True)]
        self._picture = [fmean(cell) for cell in zip(*even, strict=True)]
        squares = [
            (value - mean) ** 2
            for cell, mean in zip(zip(*even, strict=True), self._picture, strict=True)
            for value in cell
        ]
        spread = sqrt(sum(squares) / ((count - 1) * len(self._picture)))
        self._noise = max(_NOISE, spread) * sqrt(1 + 1 / count)
