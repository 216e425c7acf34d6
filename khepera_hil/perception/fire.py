"""Fire: whether there is a flame ahead, and not a lamp or the sun; and whether the robot has come up to it.

A flame flickers, ten times a second and more, and a lamp does not. What also changes the light from one tick to the
next is the robot's own motion, so the brightness is summed over the six sensors in front, which together see much the
same wherever ahead the light is; only what its second differences show is taken for flicker, since a way towards a
light changes it steadily; and ticks in which the robot turns are left out.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
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
_WINDOW = 10  # second differences that are looked at
_ENOUGH = 8  # of them that must be there, between turns
_MEDIAN = 0.6745 * sqrt(6)  # of the magnitude of a second difference, to the deviation of what flickers
_FLICKER = 18.0  # counts of summed brightness: three times what eight sensors' noise makes of it
_SHARE = 0.06  # of the brightness: what motion makes of a steady light's
_TURN = 0.12  # radians a tick: faster than this the lobes of the sensors show
_BRIGHT = 60  # counts of the brightest sensor below which nothing is seen of a flame
_LAMP = 370  # and above which it is taken for the lamp of the base
_AHEAD = 7  # of DirL
_CONFIRM = 3
_SATURATED = 12  # ProxL
_REST = 75.0  # mm from there (some 125 from the sensor) into the turbine's reach
_GONE = 5  # ticks of darkness
_HALF = 0.5  # of the brightness at the last blow: what is left of it then is another light
_PATIENCE = 200  # ticks in which what was no fire is not looked at again


class Fire:
    """Debounced, since pi-behavior takes Fire for certain (table 6): one wrong tick would be an intervention.

    It becomes true when the light ahead has flickered in three ticks in a row, outside of the base. It becomes false
    when the flame is gone for half a second, or when it still burns after three blows; then flicker is not looked at
    for 20 s, in which the robot goes elsewhere.
    """

    def __init__(self) -> None:
        self.burning = False
        self.flicker: float | None = None
        """Deviation of the summed brightness that is neither the robot's way nor its turns, in counts; by the median,
        so that a step into the light of the base, or into a shadow, is no flicker."""
        self.events: list[str] = []
        """What became of the fire in the last tick."""
        self._sums: deque[float | None] = deque(maxlen=_WINDOW + 2)
        self._seen = self._gone = self._blows = self._ignore = 0
        self._blowing = False
        self._blown_at = 0.0
        self._driven: float | None = None

    def step(self, light: Sequence[int], *, aim: int, near: int, base: float, way: float, turn: float, move: str) -> bool:
        """Whether there is a fire at this tick.

        ``light``: the eight readings; ``aim`` and ``near``: DirL and ProxL by E4.1 and E4.2 on them; ``base``:
        P(Base = true); ``way`` (mm) and ``turn`` (radians) since the last tick; ``move``: the Move since then.
        """
        self.events.clear()
        brightness = [max(0, _DARK - min(value, LIGHT_MAX)) for value in light[:6]]
        total = float(sum(brightness))
        self._sums.append(total if abs(turn) < _TURN else None)
        self.flicker = self._measured()
        self._ignore = max(0, self._ignore - 1)
        if not self.burning:
            self._look(max(brightness), total, aim, base)
            return self.burning
        self._approach(near, way)
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
        """Whether the robot has come up to the flame."""
        return self.burning and self._driven is not None and self._driven >= _REST

    def _look(self, brightest: int, total: float, aim: int, base: float) -> None:
        flickers = self.flicker is not None and self.flicker > max(_FLICKER, _SHARE * total)
        # A flame is found from where no sensor is saturated: what is brighter is the base's lamp.
        seen = flickers and _BRIGHT <= brightest <= _LAMP and abs(aim) <= _AHEAD and base < 0.5 and not self._ignore
        self._seen = self._seen + 1 if seen else 0
        if self._seen >= _CONFIRM:
            self.burning = True
            self._gone = self._blows = 0
            self._driven = None
            self.events.append("fire")

    def _approach(self, near: int, way: float) -> None:
        if near >= _SATURATED:
            self._driven = (self._driven or 0.0) + abs(way)
        elif near < _SATURATED - 3:
            self._driven = None

    def _blow(self, total: float, move: str) -> None:
        if move == "blow":
            self._blows += not self._blowing
            if not self._blowing:
                self._blown_at = total
        self._blowing = move == "blow"

    def _end(self, why: str, ignore: int = 0) -> None:
        self.burning = False
        self._seen = 0
        self._ignore = ignore
        self._driven = None
        self.events.append(why)

    def _measured(self) -> float | None:
        sums = list(self._sums)
        seconds = [
            a - 2 * b + c
            for a, b, c in zip(sums, sums[1:], sums[2:], strict=False)
            if a is not None and b is not None and c is not None
        ]
        if len(seconds) < _ENOUGH:
            return None
        return median(map(abs, seconds)) / _MEDIAN
