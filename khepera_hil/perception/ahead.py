"""DirL and ProxL: to the brightness in front of the robot what Dir and Prox are to obstacles."""

from __future__ import annotations

from math import floor

from khepera_hil.perception.readings import DARK, LIGHT_MAX, Percept, Readings

__all__ = ["LightAhead"]

_STEP = 28
"""Counts of brightness to one step of ProxL, so that a sensor in the full light (some 425) makes 15."""


class LightAhead:
    """DirL in -10 (left) .. 10 (right) and ProxL in 0 (dark) .. 15 (bright), from L1..L6.

    The paper names both among the watchman's variables and does not define them. They are E4.1 and E4.2 on
    brightness. Only the six sensors in front count: they aim at a flame ahead, while Theta2 sees all round.
    """

    needs = "O"

    def step(self, readings: Readings) -> Percept:
        """DirL and ProxL at this tick."""
        clipped = {f"L{i}": 1 for i, value in enumerate(readings.light, 1) if value > LIGHT_MAX}
        b1, b2, b3, b4, b5, b6 = (max(0, DARK - value) for value in readings.light[:6])
        balance = 90 * (b6 - b1) + 45 * (b5 - b2) + 5 * (b4 - b3)
        dir_l = floor(balance / (9 * (1 + b1 + b2 + b3 + b4 + b5 + b6)))
        return Percept({"DirL": dir_l, "ProxL": min(15, max(b1, b2, b3, b4, b5, b6) // _STEP)}, clipped)
