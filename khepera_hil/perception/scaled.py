"""N1..N8: the light readings of one frame, stretched over their whole range."""

from __future__ import annotations

from khepera_hil.perception.readings import LIGHT_MAX, Percept, Readings

__all__ = ["ScaledLight"]


class ScaledLight:
    """N1..N8 in 0..511: the brightest sensor is 0, the darkest 511.

    The sensor model of section 6.2 knows no distance; stretched so, a far lamp looks as a near one does. When all
    eight differ by less than ``dark`` counts there is no light, only noise, and there are no values.
    """

    needs = "O"

    def __init__(self, dark: int = 25) -> None:
        self.dark = dark

    def step(self, readings: Readings) -> Percept:
        """N1..N8 at this tick, or nothing in the dark."""
        light = [min(value, LIGHT_MAX) for value in readings.light]
        clipped = {f"L{i}": 1 for i, value in enumerate(readings.light, 1) if value > LIGHT_MAX}
        low, high = min(light), max(light)
        if high - low < self.dark:
            return Percept({}, clipped)
        return Percept(
            {f"N{i}": round(LIGHT_MAX * (value - low) / (high - low)) for i, value in enumerate(light, 1)}, clipped
        )
