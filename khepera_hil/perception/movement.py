"""Whether something moves before the camera, while the robot stands still."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import cache
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["SETTLE", "Movement"]

Array = NDArray[np.float64]

SETTLE = 2
"""Ticks that the wheels must have stood still before a frame counts. Till then the robot creeps, by less than a
pulse: enough for a cell to see the dark side of an edge where it saw the light one."""

_LEAST = 5  # frames in which a change can be told
_CREEPING = 3  # frames, the first ones, after which the robot may still have crept (proposed)
_MOST = 20  # frames of a stop that are remembered, the last ones (proposed)
_CELLS = (1, 2, 3)  # neighbours that are taken together
_DEVIATIONS = 5.0  # (proposed) noise alone gets there in one stop of a thousand
_NOISE = 3.0  # grey levels: the least that a cell's readings are taken to deviate by
_USUAL = (4.0,) * 5  # what it is until stops have told (proposed)
_STOPS = 15  # of which the noise is the median: it is the camera's, and in most stops nothing moves
_TELLING = 8  # frames without which a stop tells nothing of it
_DOUBTED = 6.0  # grey levels from which on a cell says less of the exposure
_FITS = 3
_DARKEST = 1e-3  # exposure: no frame that is not black comes near it


class Movement:
    """Whether the frames of a stop are one picture (proposed).

    If nothing moves, a cell is the same in all frames, but for noise and for the camera's exposure, which goes on
    settling: then all cells grow or shrink by the same share, and those at their ceiling stay. What moves makes a
    cell, or some neighbours, another in some frames in a row than in all the other ones, be it that it comes, goes,
    or passes by, and whether or not it was there when the stop began. So at each tick every span of frames is held
    against the rest of the stop's, for every one, two and three neighbouring cells. The greatest of these
    differences, in its own standard deviations, is `changed`; beyond 5 it is a movement. There are some thousand
    of them in a stop, and they are told from chance by that alone. But a cell whose greatest difference is that of
    its first frame, or first two or three, from all that came then has seen the last of the robot's own creeping:
    these frames of it count for nothing.

    The noise is known from the stops before: what moves must not pass for noise.

    One alarm is given in a stop.
    """

    def __init__(self) -> None:
        self.changed: float | None = None
        """By how many deviations the most changed cells have changed; None while it does not look."""
        self._spreads: deque[float] = deque(_USUAL, maxlen=_STOPS)
        self._frames: deque[Sequence[int]] = deque(maxlen=_MOST)
        self._still = 0
        self._residuals: Array | None = None
        self._told = False

    def step(self, frame: Sequence[int] | None, *, standing: bool, touched: bool = False) -> bool:
        """Whether something begins to move at this tick. ``frame``: grey levels, or None when it was not asked;
        ``standing``: whether the wheels have not turned since the last tick; ``touched``: whether something has
        come up to the robot, which may shove it with its wheels at rest: then it has to settle anew."""
        if not standing:
            self._settle()
            self._told = False
            return False
        if touched:
            self._settle()
            return False
        self._still += 1
        if frame is None or self._still <= SETTLE or not any(frame):
            return False
        if self._frames and len(frame) != len(self._frames[0]):
            return False
        self._frames.append(frame)
        if len(self._frames) < _LEAST:
            return False
        self._residuals = _residuals(np.array(self._frames, dtype=np.float64))
        self.changed = _most(self._residuals) / max(_NOISE, median(self._spreads))
        if self._told or self.changed <= _DEVIATIONS:
            return False
        self._told = True
        return True

    def _settle(self) -> None:
        """A picture is over: what it tells of the noise is that of the cell in the middle. The next begins anew."""
        if self._residuals is not None and len(self._residuals) >= _TELLING:
            frames, cells = self._residuals.shape
            freedom = (frames - 1) * max(cells - 1, 1) / cells  # the exposure of each frame is fitted, too
            middle = float(np.median((self._residuals**2).sum(axis=0))) / freedom
            self._spreads.append((middle / (1 - 2 / (9 * freedom)) ** 3) ** 0.5)  # the median of a chi-square
        self._frames.clear()
        self._still = 0
        self._residuals = self.changed = None


def _residuals(frames: Array) -> Array:
    """What is in the frames, shape (frames, cells), and not in one still picture.

    The exposure of each frame is fitted to the cells that follow it, those that fit badly weighing less. A cell
    either follows or is at its ceiling, whichever leaves less.
    """
    picture = np.maximum(np.median(frames, axis=0), 1.0)
    exposure = np.median(frames / picture, axis=1)
    mean = frames.mean(axis=0)
    still = frames - mean
    squares = (still**2).sum(axis=0)
    following = np.ones(len(picture), dtype=bool)
    left: Array = still
    for _ in range(_FITS):
        off = np.abs(frames - exposure[:, None] * picture)
        weight = following / np.maximum(1.0, off / _DOUBTED)
        exposure = (weight * frames * picture).sum(axis=1) / np.maximum((weight * picture**2).sum(axis=1), 1.0)
        if not exposure.any():
            break  # nothing that follows it is brighter than black
        exposure /= max(float(exposure.mean()), _DARKEST)
        share = exposure @ frames / (exposure @ exposure)
        exposed = frames - exposure[:, None] * share
        gained = squares - (exposed**2).sum(axis=0)
        left = np.where(gained >= 0, exposed, still)
        following = gained >= -(_DOUBTED**2)
        picture = np.where(gained >= 0, share, mean)
    return left


def _most(left: Array) -> float:
    """The greatest difference of a span of frames from the others, over all spans and cells that are taken
    together, in units of one reading's noise. Without what a cell saw while the robot still crept."""
    left = left.copy()
    spans = _spans(len(left))
    first = np.abs(_differences(left, spans)).argmax(axis=0)
    crept = np.where(first < spans.creeping, first + 1, 0)
    for frames in range(1, spans.creeping + 1):
        cells = crept == frames
        left[:frames, cells] = left[frames:, cells].mean(axis=0)
    along = np.cumsum(_differences(left, spans)[spans.creeping :], axis=1)
    along = np.concatenate([np.zeros((len(along), 1)), along], axis=1)
    most = 0.0
    for cells in _CELLS:
        if cells < along.shape[1]:
            most = max(most, float(np.abs(along[:, cells:] - along[:, :-cells]).max()) / cells**0.5)
    return most


class _Spans(NamedTuple):
    """Spans of frames: where they begin and end, and the deviation of a span's sum from its share of all.

    A span and all the other frames are the same difference, so none begins with the first frame but in the guise of
    one that ends with the last. The first `creeping` of them are all but the first frame, all but two, and so on.
    """

    begins: NDArray[np.intp]
    ends: NDArray[np.intp]
    deviations: Array
    creeping: int


@cache
def _spans(frames: int) -> _Spans:
    creeping = min(_CREEPING, frames - 2)
    pairs = [(a, b) for a in range(1, frames) for b in range(a + 1, frames + 1)]
    pairs.sort(key=lambda pair: pair[1] < frames or pair[0] > creeping)
    begins, ends = (np.array(places, dtype=np.intp) for places in zip(*pairs, strict=True))
    spans = ends - begins
    return _Spans(begins, ends, np.sqrt(spans * (frames - spans) / frames), creeping)


def _differences(left: Array, spans: _Spans) -> Array:
    """Of each span and cell, in units of one reading's noise: shape (spans, cells)."""
    sums = np.concatenate([np.zeros((1, left.shape[1])), np.cumsum(left, axis=0)])
    shares = (spans.ends - spans.begins) / len(left)
    differences: Array = sums[spans.ends] - sums[spans.begins] - shares[:, None] * sums[-1]
    return differences / spans.deviations[:, None]
