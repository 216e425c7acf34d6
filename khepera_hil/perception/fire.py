"""Fire: whether there is a flame, and not a lamp or the sun; and whether the robot has come up to it.

A flame is told by its flicker (`khepera_hil.perception.flicker`), under way and while the robot stands still, or by
its shining where something stands. Then it is come up to (`khepera_hil.perception.approach`) and blown at; what
three blows do not put out was none.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from khepera_hil.perception.approach import AT_THE_FLAME, SATURATED, STANDS_BY, Approach
from khepera_hil.perception.flicker import Flicker
from khepera_hil.perception.readings import DARK, LIGHT_MAX

__all__ = ["AT_THE_FLAME", "Fire"]

BLOWS = 3
"""Blows without effect after which it was no fire."""

_LAMP = 370  # counts of the brightest sensor above which a robot that stands is before the lamp of its base
_CONFIRM = 3
_STANDING = 8  # Prox of something that shines itself
_OFTEN, _LATELY = 20, 60  # ticks, of the last, in which it does
_GONE = 5  # ticks of darkness
_DIM = 90  # counts of the brightest sensor, of darkness
_QUIET = 20.0  # of a second difference's square over the noise's, of darkness
_LOST = 15  # ticks in which nothing flickers
_HALF = 0.5  # of the brightness at the last blow: what is left of it then is another light
_PATIENCE = 200  # ticks in which what was no fire is not looked at again


class Fire:
    """Debounced, since pi-behavior takes Fire for certain (table 6): one wrong tick would be an intervention.

    It becomes true when something has flickered in three ticks in a row, outside of the base or beyond doubt. It
    becomes false when the flame is gone for half a second, when nothing flickers any more, or when it still burns
    after three blows; then flicker is not looked at for a while, in which the robot goes elsewhere.
    """

    def __init__(self) -> None:
        self.burning = False
        self.flicker = Flicker()
        self.approach = Approach(self.flicker)
        self.events: list[str] = []
        """What became of the fire in the last tick."""
        self._bumps: deque[bool] = deque(maxlen=_LATELY)
        self._seen = self._gone = self._blows = self._ignore = 0
        self._blowing = False
        self._blown_at = 0.0

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
        self.flicker.step(light, way, turn)
        self.approach.look(brightness)
        self._ignore = max(0, self._ignore - 1)
        if self.burning:
            self.approach.step(near, direction, prox, way)
            self._blow(float(sum(brightness)), move)
            self._judge(brightness, near, move)
        else:
            self._look(DARK - min(light), base)
            self._bump_into(aim, near, direction, prox, base)
        return self.burning

    def aim(self, aim: int) -> int:
        """DirL as pi-speed knows it: to the fire, and without one to the light."""
        return self.approach.aim if self.burning else aim

    def near(self, near: int) -> int:
        """ProxL as pi-speed knows it: at most 14 by the light, and 15 where the robot is to stand before a fire."""
        return AT_THE_FLAME if self.burning and self.approach.stands else min(near, AT_THE_FLAME - 1)

    @property
    def arrived(self) -> bool:
        """Whether the robot has come up to the flame, or to what stands before it, and faces it."""
        return self.burning and self.approach.there and self.approach.faces

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
        there = near > SATURATED and prox >= _STANDING and abs(aim - direction) <= STANDS_BY and base < 0.5
        self._bumps.append(there)
        if self.burning:
            self._bumps.clear()
        elif sum(self._bumps) >= _OFTEN and not self._ignore:
            self._bumps.clear()
            self._begin(here=True)

    def _begin(self, *, here: bool = False) -> None:
        self.burning = True
        self._gone = self._blows = 0
        self.approach.begin(here=here)
        self.events.append("fire")

    def _blow(self, total: float, move: str) -> None:
        if move == "blow" and not self._blowing:
            self._blows += 1
            self._blown_at = total
            self.approach.blow(self._blows)
        self._blowing = move == "blow"

    def _judge(self, brightness: Sequence[int], near: int, move: str) -> None:
        """Whether it is out, or lost, or was none."""
        if self._blows:
            dark = max(brightness) < _DIM or sum(brightness) < _HALF * self._blown_at
            gone = dark and self.flicker.square < _QUIET
        else:
            gone = near < SATURATED and not self.flicker.present
        self._gone = self._gone + 1 if gone else 0
        if self._gone >= (_GONE if self._blows else _LOST):
            self._end("the fire is out" if self._blows else "the fire is lost from sight")
        elif self._blows and self.flicker.steady:
            self._end("the fire is lost from sight", ignore=_PATIENCE // 4)
        elif self._blows >= BLOWS and move != "blow" and not self._gone:
            self._end("no fire: three blows changed nothing", ignore=_PATIENCE)

    def _end(self, why: str, ignore: int = 0) -> None:
        self.burning = False
        self._seen = 0
        self._ignore = ignore
        self.approach.end()
        self.flicker.forget()
        self.events.append(why)
