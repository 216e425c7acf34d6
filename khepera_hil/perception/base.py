"""Px1..Px8 and L1..L8: what pi-base and the light's questions know, as the robot sent it (section 4.1)."""

from __future__ import annotations

from khepera_hil.perception.readings import LIGHT_MAX, Percept, Readings

__all__ = ["Surroundings"]

_PX = tuple(f"Px{i}" for i in range(1, 9))
_L = tuple(f"L{i}" for i in range(1, 9))


class Surroundings:
    """All sixteen sensors, each a variable of its own; light readings above 511 are taken as 511 and counted."""

    needs = ("N", "O")

    def step(self, readings: Readings) -> Percept:
        """Px1..Px8 and L1..L8 at this tick."""
        values = dict(zip(_PX, readings.proximity, strict=True))
        values |= {name: min(value, LIGHT_MAX) for name, value in zip(_L, readings.light, strict=True)}
        clipped = {name: 1 for name, value in zip(_L, readings.light, strict=True) if value > LIGHT_MAX}
        return Percept(values, clipped)
