"""Dir and Prox: bearing and proximity of the closest obstacle (section 4.1)."""

from __future__ import annotations

from math import floor

from khepera_hil.perception.readings import Percept, Readings

__all__ = ["Obstacle"]


class Obstacle:
    """Dir in -10 (left) .. 10 (right) by E4.1 and Prox in 0 (far) .. 15 (close) by E4.2, from Px1..Px6.

    With Floor, as printed, 10 is never reached and the smallest imbalance to the left gives -1. It is kept:
    with head-on obstacles -1 and 0 then lead to the same turn, which measured better than rounding.
    """

    needs = "N"

    def step(self, readings: Readings) -> Percept:
        """Dir and Prox at this tick."""
        px1, px2, px3, px4, px5, px6 = readings.proximity[:6]
        balance = 90 * (px6 - px1) + 45 * (px5 - px2) + 5 * (px4 - px3)
        dir_ = floor(balance / (9 * (1 + px1 + px2 + px3 + px4 + px5 + px6)))
        prox = floor(max(px1, px2, px3, px4, px5, px6) / 64)
        # Readings of 0..1023, all that the link lets through, stay within both ranges.
        return Percept({"Dir": dir_, "Prox": prox})
