"""The way to a fire: where it is aimed at, when the robot has come up to it, and what stands before it."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees

from khepera_hil.perception.flicker import Flicker
from khepera_hil.perception.readings import BEARINGS

__all__ = ["AT_THE_FLAME", "SATURATED", "STANDS_BY", "Approach"]

AT_THE_FLAME = 15
"""ProxL of a robot that has come up to the flame. By its light alone ProxL is at most 14: within 110 mm a sensor is
saturated and cannot say how near the flame is, and the turbine reaches 60; so the rest of the way is measured."""

SATURATED = 12
"""ProxL some 125 mm from a candle."""

STANDS_BY = 5
"""Of Dir: how far what shines may seem to be from the thing that it is."""

_REST = 82.0  # mm from saturation into the turbine's reach
_CLOSER = 25.0  # mm nearer after a blow without effect: beside a lamp the light says too little
_FRONT = 45  # degrees to where it flickers: what is bright elsewhere is a lamp
_BESIDE = 5  # of DirL: so far it turns on the spot
_FACING = 15  # ticks in which it turns to the flame, at the most
_ASIDE = 25.0  # degrees from where the light seems to be to the second blow: the turbine reaches 20
_OBSTACLE, _BEFORE = 10, 2  # Prox and Dir of what stands before the flame; beside the way there is room
_STANDS = 5  # ticks in which that is there
_TOUCHING, _AWAY = 14, 9  # Prox of what is touched almost, and DirL beside it


class Approach:
    """From a robot that has seen something flicker to one that blows at it."""

    def __init__(self, flicker: Flicker) -> None:
        self._flicker = flicker
        self._by_light = self._aside = 0.0
        self._at_it = False
        self._driven: float | None = None
        self._rest = _REST
        self._before = self._stood = self._past = 0

    def begin(self, *, here: bool = False) -> None:
        """Towards a new fire, or to one that the robot stands at."""
        self._rest, self._aside = _REST, 0.0
        self._driven = self._rest if here else None

    def end(self) -> None:
        """There is no fire any more."""
        self._driven = None

    def look(self, brightness: Sequence[int]) -> None:
        """Take in the brightness of the six sensors in front, counts."""
        self._by_light = _balance(brightness)

    def step(self, near: int, direction: int, prox: int, way: float) -> None:
        """A tick: ProxL by E4.2 on the light, Dir, Prox, and the mm since the tick before."""
        bright = near >= SATURATED and (self._driven is not None or self._before_it())
        self._before = self._before + 1 if bright and prox >= _OBSTACLE and abs(direction) <= _BEFORE else 0
        if bright:
            self._driven = (self._driven or 0.0) + abs(way)
        elif near < SATURATED - 3:
            self._driven = None
        self._at_it = near > SATURATED and (self._driven is not None or self._is_it())
        self._stood = self._stood + 1 if self.there else 0
        # Up against something near a light it turns away on the spot; pi-speed would go on to the light.
        against = near >= SATURATED and prox >= _TOUCHING and abs(direction) <= STANDS_BY
        self._past = (self._past or (-_AWAY if direction > 0 else _AWAY)) if against else 0

    def blow(self, blows: int) -> None:
        """The robot begins to blow, for the ``blows``-th time; what follows is said for the next one."""
        self._rest = _REST + _CLOSER
        # A lamp beside it draws the aim aside: the second blow goes more to where it flickers.
        side = 1 if self._flicker.bearing > 0 else -1
        self._aside = _ASIDE * side if blows == 1 else 0.0

    @property
    def aim(self) -> int:
        """DirL: towards what flickers; only where it saturates what is in front, its light tells more than that.

        Other lamps shine as well, and are brighter than a flame that is far.
        """
        if self._past and not self._at_it:
            return self._past
        bearing = self._by_light + self._aside if self._at_it else degrees(self._flicker.bearing)
        return max(-10, min(10, round(-bearing / 9)))

    @property
    def stands(self) -> bool:
        """Whether it is at the flame, or near and not free to go on: not facing it, or up against something."""
        return self.there or bool(self._past) or (self._at_it and abs(self.aim) >= _BESIDE)

    @property
    def there(self) -> bool:
        """Whether it has come up to the flame, or to what stands before it."""
        return self._before >= _STANDS or (self._driven is not None and self._driven >= self._rest)

    @property
    def faces(self) -> bool:
        """Whether it faces the flame as well, or has tried long enough."""
        return self._stood > _FACING or abs(self.aim) <= 1

    def _before_it(self) -> bool:
        """Whether what is bright in front is what flickers."""
        return self._is_it() and abs(degrees(self._flicker.bearing)) <= _FRONT

    def _is_it(self) -> bool:
        """Whether the brightest light is where it flickers, and no lamp."""
        return self._flicker.firm and abs(degrees(self._flicker.bearing) - self._by_light) <= _FRONT


def _balance(brightness: Sequence[int]) -> float:
    """The bearing of a flame that saturates sensors in front, degrees, counter-clockwise.

    Twice the mean of the six sensors' bearings by their brightness: as it is measured from 40 to 130 mm, where
    those that are saturated say too little.
    """
    total = sum(brightness) or 1
    return -2 * sum(bearing * bright for bearing, bright in zip(BEARINGS[:6], brightness, strict=True)) / total
