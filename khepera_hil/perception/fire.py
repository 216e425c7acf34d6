"""Fire: whether there is a flame ahead, and not a lamp or the sun; and whether the robot has come up to it.

A flame is told by its flicker (`khepera_hil.perception.flicker`): under way when it is ahead, all round while the
robot stands still. Then it is aimed at by its flicker, come up to, and blown at; what three blows do not put out
was none.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import degrees

from khepera_hil.perception.flicker import DARK, Flicker
from khepera_hil.perception.readings import LIGHT_MAX

__all__ = ["AT_THE_FLAME", "Fire"]

AT_THE_FLAME = 15
"""ProxL of a robot that has come up to the flame. By its light alone ProxL is at most 14: within 110 mm a sensor is
saturated and cannot say how near the flame is, and the turbine reaches 60; so the rest of the way is measured."""

BLOWS = 3
"""Blows without effect after which it was no fire."""

_POINTINGS = (90, 45, 10, -10, -45, -90)
_LAMP = 370  # counts of the brightest sensor above which a robot that stands is before the lamp of its base
_CONFIRM = 3
_SATURATED = 12  # ProxL
_REST = 82.0  # mm from there (some 125 from the sensor) into the turbine's reach
_CLOSER = 25.0  # mm nearer after a blow without effect: beside a lamp the light says too little
_FRONT = 45  # degrees to where it flickers: what is bright elsewhere is a lamp
_BESIDE = 5  # of DirL: so far it turns on the spot
_FACING = 15  # ticks in which it turns to the flame, at the most
_ASIDE = 25.0  # degrees from where the light seems to be to the second blow: the turbine reaches 20
_OBSTACLE, _BEFORE = 10, 2  # Prox and Dir of what stands before the flame; beside the way there to it is room
_STANDING, _SAME = 8, 5  # Prox, and how far Dir may be from DirL, of something that shines itself
_TOUCHING, _AWAY = 14, 9  # Prox of what is touched almost, and DirL beside it
_OFTEN, _LATELY = 20, 60  # ticks, of the last, in which it does
_STANDS = 5  # ticks in which that is there
_GONE = 5  # ticks of darkness
_DIM = 90  # counts of the brightest sensor, of darkness
_QUIET = 20.0  # of a second difference's square over the noise's, of darkness
_LOST = 15  # ticks in which nothing flickers
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
        self.flicker = Flicker()
        self.events: list[str] = []
        """What became of the fire in the last tick."""
        self._seen = self._gone = self._blows = self._ignore = 0
        self._aim = self._stood = self._past = 0
        self._bumps: deque[bool] = deque(maxlen=_LATELY)
        self._by_light = self._aside = 0.0
        self._at_it = False
        self._blowing = False
        self._blown_at = 0.0
        self._driven: float | None = None
        self._rest = _REST
        self._before = 0

    def step(
        self,
        light: Sequence[int],
        *,
        aim: int,
        near: int,
        direction: int,
        prox: int,
        base: float,
        way: float,
        turn: float,
        move: str,
    ) -> bool:
        """Whether there is a fire at this tick.

        ``light``: the eight readings; ``aim`` and ``near``: DirL and ProxL by E4.1 and E4.2 on them;
        ``direction`` and ``prox``: Dir and Prox; ``base``: P(Base = true); ``way`` (mm) and ``turn`` (radians)
        since the last tick; ``move``: the Move since then.
        """
        self.events.clear()
        brightness = [max(0, DARK - min(value, LIGHT_MAX)) for value in light[:6]]
        total = float(sum(brightness))
        self.flicker.step(light, way, turn)
        self._aim = aim
        self._by_light = _balance(brightness)
        self._ignore = max(0, self._ignore - 1)
        if not self.burning:
            self._look(DARK - min(light), base)
            self._bump_into(aim, near, direction, prox, base)
            return self.burning
        self._approach(near, direction, prox, way)
        self._blow(total, move)
        if self._blows:
            gone = (max(brightness) < _DIM or total < _HALF * self._blown_at) and self.flicker.square < _QUIET
        else:
            gone = near < _SATURATED and not self.flicker.present
        self._gone = self._gone + 1 if gone else 0
        if self._gone >= (_GONE if self._blows else _LOST):
            self._end("the fire is out" if self._blows else "the fire is lost from sight")
        elif self._blows and self.flicker.steady:
            self._end("the fire is lost from sight", ignore=_PATIENCE // 4)
        elif self._blows >= BLOWS and move != "blow" and not self._gone:
            self._end("no fire: three blows changed nothing", ignore=_PATIENCE)
        return self.burning

    def aim(self) -> int:
        """DirL as pi-speed knows it: with a fire towards what flickers, without one towards the light.

        Other lamps shine as well, and are brighter than a flame that is far; only where it saturates what is in
        front, its light tells more than its flicker.
        """
        if not self.burning:
            return self._aim
        bearing = self._by_light + self._aside if self._at_it else degrees(self.flicker.bearing)
        return self._past if self._past and not self._at_it else max(-10, min(10, round(-bearing / 9)))

    def near(self, near: int) -> int:
        """ProxL as pi-speed knows it: at most 14 by the light; 15, which stands, at the flame, or near and not free
        to go to it: not facing it, or with something in the way."""
        beside = self.burning and self._at_it and abs(self.aim()) >= _BESIDE
        stands = self._there or beside or (self.burning and self._past)
        return AT_THE_FLAME if stands else min(near, AT_THE_FLAME - 1)

    @property
    def arrived(self) -> bool:
        """Whether the robot has come up to the flame, or to what stands before it, and faces it."""
        return self._there and (self._stood > _FACING or abs(self.aim()) <= 1)

    @property
    def _there(self) -> bool:
        return self.burning and (
            self._before >= _STANDS or (self._driven is not None and self._driven >= self._rest)
        )

    def _look(self, brightest: int, base: float) -> None:
        standing = self.flicker.around and brightest <= _LAMP
        outside = (self.flicker.under_way or standing) and base < 0.5
        # Between two candles it is as bright as in the base, and a base does not flicker.
        seen = (outside or self.flicker.beyond_doubt) and not self._ignore
        self._seen = self._seen + 1 if seen else 0
        if self._seen >= _CONFIRM:
            self._begin()
            if self.flicker.around:
                self.flicker.aim()

    def _bump_into(self, aim: int, near: int, direction: int, prox: int, base: float) -> None:
        """What shines where something stands is no lamp of a base, which hangs above a free floor."""
        there = near > _SATURATED and prox >= _STANDING and abs(aim - direction) <= _SAME and base < 0.5
        self._bumps.append(there)
        if self.burning:
            self._bumps.clear()
        elif sum(self._bumps) >= _OFTEN and not self._ignore:
            self._bumps.clear()
            self._begin()
            self._driven = self._rest  # it is here

    def _begin(self) -> None:
        self.burning = True
        self._gone = self._blows = 0
        self._driven, self._rest, self._aside = None, _REST, 0.0
        self.events.append("fire")

    def _approach(self, near: int, direction: int, prox: int, way: float) -> None:
        bright = near >= _SATURATED and (self._driven is not None or self._before_it())
        self._before = self._before + 1 if bright and prox >= _OBSTACLE and abs(direction) <= _BEFORE else 0
        if bright:
            self._driven = (self._driven or 0.0) + abs(way)
        elif near < _SATURATED - 3:
            self._driven = None
        self._at_it = near >= _SATURATED + 1 and (self._driven is not None or self._is_it())
        self._stood = self._stood + 1 if self._there else 0
        # Up against something near a light it turns away on the spot; pi-speed would go on to the light.
        against = near >= _SATURATED and prox >= _TOUCHING and abs(direction) <= _SAME
        self._past = (self._past or (-_AWAY if direction > 0 else _AWAY)) if against else 0

    def _before_it(self) -> bool:
        """Whether what is bright in front is what flickers."""
        return self._is_it() and abs(degrees(self.flicker.bearing)) <= _FRONT

    def _is_it(self) -> bool:
        """Whether the brightest light is where it flickers, and no lamp."""
        return self.flicker.firm and abs(degrees(self.flicker.bearing) - self._by_light) <= _FRONT

    def _blow(self, total: float, move: str) -> None:
        if move == "blow" and not self._blowing:
            self._blows += 1
            self._blown_at = total
            self._rest = _REST + _CLOSER
            # A lamp beside it draws the aim aside: the second blow goes more to where it flickers.
            side = 1 if self.flicker.bearing > 0 else -1
            self._aside = _ASIDE * side if self._blows == 1 else 0.0
        self._blowing = move == "blow"

    def _end(self, why: str, ignore: int = 0) -> None:
        self.burning = False
        self._seen = 0
        self._ignore = ignore
        self._driven = None
        self.flicker.forget()
        self.events.append(why)


def _balance(brightness: Sequence[int]) -> float:
    """The bearing of a flame that saturates sensors in front, degrees, counter-clockwise.

    Twice the mean of the six sensors' bearings by their brightness: as it is measured from 40 to 130 mm, where
    those that are saturated say too little.
    """
    total = sum(brightness) or 1
    return 2 * sum(bearing * bright for bearing, bright in zip(_POINTINGS, brightness, strict=True)) / total
