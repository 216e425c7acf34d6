"""Fire: whether there is a flame ahead, and not a lamp or the sun; and whether the robot has come up to it.

A flame flickers, ten times a second and more, and a lamp does not. But a robot that moves sees any light change.
Two things tell them apart. What is steady, a way towards a light, does not show in second differences. And a flame
that flickers grows and shrinks in all sensors at once, in each by the same share of its brightness; a turn makes
one sensor brighter and its neighbour darker, a shadow passes over one alone.

So at each tick one share f is fitted to the second differences of the sensors' brightness, d_i = f b_i. There is a
flame when the f of the last second deviate by enough, and when they explain enough of all that has changed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from statistics import median

from khepera_hil.perception.readings import LIGHT_MAX

__all__ = ["AT_THE_FLAME", "Fire"]

AT_THE_FLAME = 15
"""ProxL of a robot that has come up to the flame. By its light alone ProxL is at most 14: within 110 mm a sensor is
saturated and cannot say how near the flame is, and the turbine reaches 60; so the rest of the way is measured."""

BLOWS = 3
"""Blows without effect after which it was no fire."""

_DARK = 490  # readings below are brightness
_FAINT, _FULL = 12.0, 395.0  # brightness below which a sensor only has noise, above which it is saturated
_WINDOW = 10  # second differences that are looked at
_ENOUGH = 8  # of them that must be there, between turns
_MEDIAN = 0.6745 * sqrt(6)  # of the magnitude of a second difference, to the deviation of what flickers
_FLICKER = 0.05  # of the brightness; a candle's is .15
_EXPLAINED = 0.75  # of the squares of all second differences
_TURN = 0.12  # radians a tick: faster than this the lobes of the sensors show
_BRIGHT = 60  # counts of the brightest sensor below which nothing is seen of a flame
_LAMP = 370  # and above which it is taken for the lamp of the base
_AHEAD = 4  # of DirL: a flame at the robot's side is seen by one sensor only
_CONFIRM = 3
_SATURATED = 12  # ProxL
_REST = 75.0  # mm from there (some 125 from the sensor) into the turbine's reach
_CLOSER = 25.0  # mm nearer after each blow without effect: beside a lamp the light says too little
_OBSTACLE = 10  # Prox
_GONE = 5  # ticks of darkness
_HALF = 0.5  # of the brightness at the last blow: what is left of it then is another light
_PATIENCE = 200  # ticks in which what was no fire is not looked at again


class Fire:
    """Debounced, since pi-behavior takes Fire for certain (table 6): one wrong tick would be an intervention.

    It becomes true when the light ahead has flickered in three ticks in a row, outside of the base. It becomes
    false when the flame is gone for half a second, or when it still burns after three blows; then flicker is not
    looked at for 20 s, in which the robot goes elsewhere.
    """

    def __init__(self) -> None:
        self.burning = False
        self.flicker = self.explained = 0.0
        """By how much of its brightness the light ahead flickered in the last second (by the median, so that one
        step into a shadow is no flicker), and how much of all changes that explains, 0 to 1."""
        self.events: list[str] = []
        """What became of the fire in the last tick."""
        self._last: deque[list[int] | None] = deque(maxlen=3)
        self._fits: deque[_Fit | None] = deque(maxlen=_WINDOW)
        self._seen = self._gone = self._blows = self._ignore = 0
        self._blowing = False
        self._blown_at = 0.0
        self._driven: float | None = None
        self._rest = _REST
        self._blocked = False

    def step(
        self,
        light: Sequence[int],
        *,
        aim: int,
        near: int,
        prox: int,
        base: float,
        way: float,
        turn: float,
        move: str,
    ) -> bool:
        """Whether there is a fire at this tick.

        ``light``: the eight readings; ``aim`` and ``near``: DirL and ProxL by E4.1 and E4.2 on them; ``prox``:
        Prox; ``base``: P(Base = true); ``way`` (mm) and ``turn`` (radians) since the last tick; ``move``: the Move
        since then.
        """
        self.events.clear()
        brightness = [max(0, _DARK - min(value, LIGHT_MAX)) for value in light[:6]]
        total = float(sum(brightness))
        self._measure(brightness if abs(turn) < _TURN else None)
        self._ignore = max(0, self._ignore - 1)
        if not self.burning:
            self._look(max(brightness), aim, base)
            return self.burning
        self._approach(near, prox, way)
        self._blow(total, move)
        dark = max(brightness) < _DARK - 400 or (self._blows > 0 and total < _HALF * self._blown_at)
        self._gone = self._gone + 1 if dark else 0
        if self._gone >= _GONE:
            self._end("the fire is out" if self._blows else "the fire is lost from sight")
        elif self._blows >= BLOWS and move != "blow":
            self._end("no fire: three blows changed nothing", ignore=_PATIENCE)
        return self.burning

    def near(self, near: int) -> int:
        """ProxL as pi-speed knows it: at most 14 by the light, 15 at the flame."""
        return AT_THE_FLAME if self.arrived else min(near, AT_THE_FLAME - 1)

    @property
    def arrived(self) -> bool:
        """Whether the robot has come up to the flame, or to what stands before it."""
        return self.burning and (self._blocked or (self._driven is not None and self._driven >= self._rest))

    def _look(self, brightest: int, aim: int, base: float) -> None:
        flickers = self.flicker >= _FLICKER and self.explained >= _EXPLAINED
        # A flame is found from where no sensor is saturated: what is brighter is the base's lamp.
        seen = flickers and _BRIGHT <= brightest <= _LAMP and abs(aim) <= _AHEAD and base < 0.5 and not self._ignore
        self._seen = self._seen + 1 if seen else 0
        if self._seen >= _CONFIRM:
            self.burning = True
            self._gone = self._blows = 0
            self._driven, self._rest = None, _REST
            self.events.append("fire")

    def _approach(self, near: int, prox: int, way: float) -> None:
        self._blocked = prox >= _OBSTACLE and near >= _SATURATED
        if near >= _SATURATED:
            self._driven = (self._driven or 0.0) + abs(way)
        elif near < _SATURATED - 3:
            self._driven = None

    def _blow(self, total: float, move: str) -> None:
        if move == "blow" and not self._blowing:
            self._blows += 1
            self._blown_at = total
            self._rest += _CLOSER
        self._blowing = move == "blow"

    def _end(self, why: str, ignore: int = 0) -> None:
        self.burning = False
        self._seen = 0
        self._ignore = ignore
        self._driven = None
        self._fits.clear()  # what flickered a moment ago was this one
        self.flicker = self.explained = 0.0
        self.events.append(why)

    def _measure(self, brightness: list[int] | None) -> None:
        """Take a tick in; None when the robot turned."""
        self._last.append(brightness)
        three = [one for one in self._last if one is not None]
        self._fits.append(_fitted(*three) if len(three) == 3 else None)
        fits = [fit for fit in self._fits if fit is not None]
        changed = sum(fit.changed for fit in fits)
        if len(fits) < _ENOUGH or changed == 0:
            self.flicker = self.explained = 0.0
            return
        self.flicker = median(abs(fit.share) for fit in fits) / _MEDIAN
        self.explained = sum(fit.explained for fit in fits) / changed


@dataclass(frozen=True)
class _Fit:
    """The second differences of three ticks: their common share of the brightness, and sums of squares."""

    share: float
    explained: float
    changed: float


def _fitted(first: Sequence[int], second: Sequence[int], third: Sequence[int]) -> _Fit | None:
    """None where no sensor sees a light without being saturated by it."""
    squares = products = changed = 0.0
    for a, b, c in zip(first, second, third, strict=True):
        bright = (a + b + c) / 3
        if bright <= _FAINT or max(a, b, c) >= _FULL:
            continue
        d = a - 2 * b + c
        squares += bright * bright
        products += d * bright
        changed += d * d
    if squares == 0:
        return None
    share = products / squares
    return _Fit(share, share * share * squares, changed)
