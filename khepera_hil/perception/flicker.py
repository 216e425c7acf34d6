"""What flickers: second differences of the eight light sensors, by which a flame is told from a lamp, and aimed at.

A flame flickers, ten times a second and more, and a lamp does not. But a robot that moves sees any light change.
What is steady, a way towards a light or a turn on the spot, does not show in second differences, and ticks in which
the robot begins or ends a turn are left out. What is left is held against how a flame at each bearing would show in
the eight sensors: as a square over the noise's, for each bearing and tick. So lamps do not matter, however bright.

* Standing still, nothing but noise and flicker changes. The logarithm of how much better a flame explains a tick
  than noise does is summed up.
* Under way a light may come out of a shadow, or a sensor look over an edge: large changes, and few. So there it
  flickers where in six ticks of ten the square is large.

The same squares keep the bearing of a flame that was found while the robot drives to it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import ceil, degrees, log, pi, remainder, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from khepera_hil.perception.readings import BEARINGS, DARK, LIGHT_MAX

__all__ = ["Flicker"]

_FULL = 395.0  # brightness above which a sensor is saturated
_WINDOW, _ENOUGH = 20, 17  # ticks that are looked at under way, and how many of them must count
_QUANTILE, _LARGE = 0.4, 4.0  # of their squares; in two ticks of a thousand it is so large without a flame
_SHARED = 9.0  # so many times as large as what is left in a sensor: what one sensor sees alone is no flame
_STEADY, _FAST = 0.06, 0.35  # radians a tick: of change of turn, and of turn

_STILL_WAY, _STILL_TURN = 0.2, 0.005  # mm and radians a tick
_NOISE = 4.4 * sqrt(6)  # counts: the deviation of a second difference when nothing changes
_LARGER = 2.0  # by how many times the noise's square a flame's is expected to be larger at least
_MOST = 7.0  # of a tick's square over the noise's: a sensor that breaks is no flame
_SURE = 9.0  # of the logarithm: there are some eight bearings to choose from, and 300 stops an hour
_KEEP = 0.9  # of what the ticks before said of the bearing
_FLICKERS = 1.0  # of the logarithm that is kept: without a flame it stays about 0, with one 400 mm away above 5
_FIRM = 6.0  # of the same: its greatest bearing is that of the flame, and not of a lamp that a turn makes flicker
_WHILE = 15  # ticks after which a flame would have been sure

_PLACES = np.radians([68.0, 43.0, 13.0, -13.0, -43.0, -68.0, -158.0, 158.0])
_POINTINGS = np.radians([*(-bearing for bearing in BEARINGS[:6]), -180.0, 180.0])
_STEP = 5  # degrees
_BEARINGS = np.radians(np.arange(-180, 180, _STEP))  # counter-clockwise, 0 ahead


def _lobes() -> NDArray[np.float64]:
    """What a flame 300 mm away adds to each sensor, by its bearing; shape (bearings, 8), rows of length 1.

    The sensors' places and lobes are those measured (`khepera_hil.world.sensors` has the same tables, which the
    controllers may not know).
    """
    flame = 300.0 * np.column_stack([np.cos(_BEARINGS), np.sin(_BEARINGS)])
    ways = flame[:, None, :] - 28.0 * np.column_stack([np.cos(_PLACES), np.sin(_PLACES)])
    far = np.hypot(ways[..., 0], ways[..., 1])
    ahead = (ways * np.column_stack([np.cos(_POINTINGS), np.sin(_POINTINGS)])).sum(2) / far
    shares = (np.maximum(ahead, 0) ** 1.42 + 0.05) / far**2
    rows: NDArray[np.float64] = shares / np.linalg.norm(shares, axis=1)[:, None]
    return rows


_LOBES = _lobes()


class Flicker:
    """Takes in the eight light readings of each tick, and how the robot has moved since the last."""

    def __init__(self) -> None:
        self.heading = 0.0
        """Of the robot, radians, counter-clockwise, since the first tick."""
        self._last: deque[NDArray[np.float64]] = deque(maxlen=3)
        self._turn = 0.0
        self._recent: deque[_Squares | None] = deque(maxlen=_WINDOW)
        self._still = 0
        self.square = 0.0
        """Of this tick: the greatest second difference, as a square over the noise's; 0 in a turn."""
        self._standing = np.zeros(len(_BEARINGS))
        self._headings = np.zeros(len(_BEARINGS))

    def step(self, light: Sequence[int], way: float, turn: float) -> None:
        """``light``: the eight readings; ``way`` (mm) and ``turn`` (radians) since the last tick."""
        self.heading += turn
        bright = DARK - np.minimum(np.array(light, float), LIGHT_MAX)
        still = abs(way) < _STILL_WAY and abs(turn) < _STILL_TURN
        self._still = self._still + 1 if still else 0
        self._last.append(bright)
        counts = len(self._last) == 3 and abs(turn - self._turn) < _STEADY and abs(turn) < _FAST
        self._turn = turn
        if not still:
            self._standing[:] = 0
        self.square = 0.0
        found = _by_bearing(*self._last) if counts else None
        self._recent.append(found)
        if found is None:
            return
        squares = found.explained
        self.square = found.most
        said = np.minimum(squares, _MOST) * _LARGER / (1 + _LARGER) / 2 - log(1 + _LARGER) / 2
        if self._still >= 3:
            self._standing += said
        # Bearings are kept as headings, so that a turn does not make them stale.
        self._headings = _KEEP * self._headings + np.roll(said, self._turned)

    @property
    def under_way(self) -> bool:
        """Whether something flickers somewhere, by the last two seconds."""
        counted = [found for found in self._recent if found is not None]
        many = len(counted) - ceil(_QUANTILE * (len(counted) - 1))
        if len(counted) < _ENOUGH or sum(found.most >= _LARGE for found in counted) < many:
            return False  # the quantile, which takes its time, could not be large
        explained = np.array([found.explained for found in counted])
        large = np.quantile(explained, _QUANTILE, axis=0)
        best = int(large.argmax())
        left = sum(found.all - found.explained[best] for found in counted) / sum(found.others for found in counted)
        return bool(large[best] >= _LARGE and explained[:, best].mean() >= _SHARED * left)

    @property
    def around(self) -> bool:
        """Whether something flickers somewhere, by all that was seen since the robot stands still."""
        return bool(self._standing.max() >= _SURE)

    @property
    def beyond_doubt(self) -> bool:
        """The same so firmly that it is believed in the light of the base, too."""
        return bool(self._standing.max() >= 2 * _SURE)

    @property
    def steady(self) -> bool:
        """Whether all that shines on a robot that has stood still for a while is steady."""
        return self._still >= _WHILE and bool(self._standing.max() < _SURE / 2)

    @property
    def present(self) -> bool:
        """Whether something flickers somewhere, by the last second or two in which the robot did not turn."""
        return bool(self._headings.max() >= _FLICKERS)

    @property
    def firm(self) -> bool:
        """Whether it flickers so much that its bearing is firm."""
        return bool(self._headings.max() >= _FIRM)

    @property
    def bearing(self) -> float:
        """Where it flickers most, radians, counter-clockwise, 0 ahead."""
        return remainder(float(_BEARINGS[self._headings.argmax()]) - self.heading, 2 * pi)

    def aim(self) -> None:
        """Take for the bearing what was summed up since the robot stands still."""
        self._headings = np.roll(self._standing, self._turned)

    def forget(self) -> None:
        """What flickered a moment ago was this one."""
        self._recent.clear()
        self._standing[:] = 0
        self._headings[:] = 0

    @property
    def _turned(self) -> int:
        """The heading, in steps between bearings."""
        return round(degrees(self.heading) / _STEP)


class _Squares(NamedTuple):
    """Of a tick's second differences, over the noise's: what a flame at each bearing explains, and all of them."""

    explained: NDArray[np.float64]
    most: float
    all: float
    others: int
    """How many more there are than the one that a flame explains."""


def _by_bearing(first: NDArray[np.float64], second: NDArray[np.float64], third: NDArray[np.float64]) -> _Squares:
    seen = np.maximum(np.maximum(first, second), third) < _FULL
    changes = (first - 2 * second + third) * seen / _NOISE
    lobes = _LOBES * seen
    lengths = np.linalg.norm(lobes, axis=1)
    along = lobes @ changes / np.maximum(lengths, 1e-9)
    # A bearing most of whose light goes into saturated sensors is none.
    explained: NDArray[np.float64] = np.where(lengths > 0.5, along**2, 0.0)
    return _Squares(explained, float(explained.max()), float(changes @ changes), max(int(seen.sum()) - 1, 1))
