"""What shines above the floor: lamps, flames, and bulbs that somebody shakes. Millimetres, seconds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

__all__ = ["Fires", "Flame", "Flicker", "Lamp", "Light"]


@dataclass(frozen=True)
class Lamp:
    """A light above the floor; ``intensity`` 1.13 is the bulb of the measured table, 7 a lamp for 1 m."""

    name: str
    x: float
    y: float
    height: float
    intensity: float
    radius: float = 5.0


_SPREAD = 0.15
"""Standard deviation of a flame's strength, as a share of its mean (proposed)."""
_BANDWIDTH = 10.0  # Hz (proposed)
_DRAWN_AT_ONCE = 200
_KEPT = 50  # steps of the past that may still be asked for: more than the sensors' 20 ms


class Flicker:
    """A flame's strength as a share of its mean: an autoregression of first order on the steps of the physics."""

    def __init__(self, chance: np.random.Generator, step: float, first: int) -> None:
        self._chance = chance
        self._keep = math.exp(-2 * math.pi * _BANDWIDTH * step)
        self._first = first
        self._values: list[float] = []
        self._last = float(chance.normal(0, _SPREAD))

    def at(self, step: int) -> float:
        """The strength at a step, counted from power-up; steps long past are forgotten."""
        while step >= self._first + len(self._values):
            forgotten = max(len(self._values) - _KEPT, 0)
            del self._values[:forgotten]
            self._first += forgotten
            spread = _SPREAD * math.sqrt(1 - self._keep**2)
            for drawn in self._chance.normal(0, spread, _DRAWN_AT_ONCE).tolist():
                self._last = self._keep * self._last + drawn
                self._values.append(max(1 + self._last, 0.0))
        return self._values[step - self._first] if step >= self._first else 0.0


class Light(NamedTuple):
    """A lamp that shines steadily, or with a flicker."""

    lamp: Lamp
    flicker: Flicker | None = None

    def strength(self, step: int) -> float:
        """Its intensity at a step, counted from power-up."""
        return self.lamp.intensity if self.flicker is None else self.lamp.intensity * self.flicker.at(step)


@dataclass
class Flame:
    """A fire; ``real`` ones go out when they are blown at. ``ends`` (s since power-up) at the latest."""

    light: Light
    real: bool
    lit: float
    ends: float
    blown: float = 0.0
    """Seconds that the turbine has blown at it."""


_BLOW_REACH = 60.0  # mm from the body's edge (proposed)
_BLOW_ANGLE = math.radians(20)
_BLOW_SECONDS = 1.5


class Fires:
    """The flames that burn now."""

    def __init__(self) -> None:
        self.burning: list[Flame] = []

    def blow(self, step: float, pose: tuple[float, float, float], body: float) -> list[Flame]:
        """The turbine blows for ``step`` seconds from a robot of radius ``body``; the flames that it puts out.

        A flame goes out after 1.5 s of wind, all counted together, from within 60 mm and 20 degrees.
        """
        x, y, theta = pose
        out = []
        for flame in self.burning:
            to_x, to_y = flame.light.lamp.x - x, flame.light.lamp.y - y
            off = math.remainder(math.atan2(to_y, to_x) - theta, 2 * math.pi)
            if flame.real and math.hypot(to_x, to_y) - body <= _BLOW_REACH and abs(off) <= _BLOW_ANGLE:
                flame.blown += step
                if flame.blown >= _BLOW_SECONDS - 1e-9:
                    out.append(flame)
        for flame in out:
            self.burning.remove(flame)
        return out
