"""Whether something moves before the camera, while the robot stands still."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import accumulate
from math import sqrt
from statistics import fmean, median, quantiles

__all__ = ["CALIBRATE", "SETTLE", "Movement"]

SETTLE = 3
"""Ticks that the wheels must have stood still before a frame counts."""

CALIBRATE = 4
"""Frames by which the still picture is known."""

_NOISE = 3.0  # grey levels: the least that a cell's readings are taken to deviate by
_USUAL = (4.0,) * 5  # what it is until stops have told (proposed)
_STOPS = 15  # of which the noise is the median: it is the camera's, and in most stops nothing moves
_MEDIAN = 0.789  # of a chi-square with CALIBRATE - 1 degrees of freedom, over these
_FRAMES = (1, 2, 4)  # that are taken together, the last ones
_CELLS = (1, 2, 3)  # neighbours that are
_DEVIATIONS = 3.8
_EXPOSURE = 0.12  # share by which it may still change while the robot stands
_IN_A_ROW = 2


class Movement:
    """What is new before the still picture: it moves, or it has come (proposed).

    The still picture is the mean of the first frames of a stop. While the camera's exposure settles, cells become
    brighter or darker by the same share, but for those at their ceiling, which stay as they are; so what lies
    between the quartiles of what the cells have become, and not farther than an exposure can still go, is no
    change. Up to three neighbouring cells in up to four frames that have together changed by more than the noise
    allows, twice in a row, are a movement: what is near is wide and soon past, what is far is a cell or two, hardly
    darker than what is behind it, and stays. The noise is known from the stops before: what moves while the still
    picture is taken must not pass for noise.

    One alarm is given in a stop.
    """

    def __init__(self) -> None:
        self.changed: float | None = None
        """By how many deviations the most changed cells have changed; None while it does not look."""
        self._spreads: deque[float] = deque(_USUAL, maxlen=_STOPS)
        self._begin()

    def _begin(self) -> None:
        self.changed = None
        self._still = self._high = 0
        self._frames: list[list[float]] = []
        self._picture: list[float] = []
        self._last: deque[Sequence[int]] = deque(maxlen=max(_FRAMES))
        self._told = False

    def step(self, frame: Sequence[int] | None, *, standing: bool) -> bool:
        """Whether something begins to move at this tick. ``frame``: grey levels, or None when it was not asked;
        ``standing``: whether the wheels have not turned since the last tick."""
        if not standing:
            if self._still:
                self._begin()  # the next stop begins anew
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
        self._last.append(frame)
        self.changed = self._most() / max(_NOISE, median(self._spreads))
        self._high = self._high + 1 if self.changed > _DEVIATIONS else 0
        if self._told or self._high < _IN_A_ROW:
            return False
        self._told = True
        return True

    def _most(self) -> float:
        """The greatest change, over all cells and frames that are taken together, in units of one cell's noise."""
        latest = list(reversed(self._last))
        now = list(map(fmean, zip(*latest, strict=True)))
        lower, _, upper = quantiles(new / max(old, 1.0) for new, old in zip(now, self._picture, strict=True))
        darkest = max(min(lower, 1.0), 1 - _EXPOSURE)
        brightest = min(max(upper, 1.0), 1 + _EXPOSURE)
        most = 0.0
        for count in _FRAMES:
            if count > len(latest):
                break
            together = map(fmean, zip(*latest[:count], strict=True))
            changes = (
                new - min(max(new, darkest * old), brightest * old)
                for new, old in zip(together, self._picture, strict=True)
            )
            sums = [0.0, *accumulate(changes)]
            alone = sqrt(1 / count + 1 / CALIBRATE)
            for cells in _CELLS:
                change = max(abs(b - a) for a, b in zip(sums, sums[cells:], strict=False))
                most = max(most, change / (sqrt(cells) * alone))
        return most

    def _look_at(self, frames: Sequence[Sequence[float]]) -> None:
        """The still picture, and the noise that is in it: that of the cell in the middle."""
        cells = list(zip(*frames, strict=True))
        self._picture = [fmean(cell) for cell in cells]
        squares = (
            sum((value - mean) ** 2 for value in cell) / (len(cell) - 1)
            for cell, mean in zip(cells, self._picture, strict=True)
        )
        self._spreads.append(sqrt(median(squares) / _MEDIAN))
