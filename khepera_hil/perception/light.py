"""Theta1: bearing of the greatest source of illumination (section 4.1)."""

from __future__ import annotations

from math import atan2, cos, degrees, radians, sin

from khepera_hil.perception.readings import BEARINGS, LIGHT_MAX, Percept, Readings

__all__ = ["LightBearing"]

_SIN = tuple(sin(radians(bearing)) for bearing in BEARINGS)
_COS = tuple(cos(radians(bearing)) for bearing in BEARINGS)


class LightBearing:
    """Theta1 in -170..180 by steps of 10 degrees.

    The paper gives no formula. Each sensor pulls in its own direction by how much brighter it is than the
    darkest one (readings fall as light rises). When all eight differ by less than ``dark`` counts there is
    no source, only noise, and Theta1 is 0, straight on: holding the last bearing instead makes the robot
    circle on the spot in a shadow.
    """

    needs = "O"

    def __init__(self, dark: int = 25) -> None:
        self.dark = dark

    def step(self, readings: Readings) -> Percept:
        """Theta1 at this tick; readings above 511 are taken as 511 and counted."""
        light = [min(value, LIGHT_MAX) for value in readings.light]
        clipped = {f"L{i}": 1 for i, value in enumerate(readings.light, 1) if value > LIGHT_MAX}
        darkest = max(light)
        if darkest - min(light) < self.dark:
            return Percept({"Theta1": 0}, clipped)
        x = sum((darkest - value) * c for value, c in zip(light, _COS, strict=True))
        y = sum((darkest - value) * s for value, s in zip(light, _SIN, strict=True))
        theta = 10 * round(degrees(atan2(y, x)) / 10)
        return Percept({"Theta1": 180 if theta == -180 else theta}, clipped)
