"""What two readings of the same sensors may differ by: without a checksum, numbers are held to physics.

A digit that is lost on the line leaves an answer that is whole and right in its form, and wrong. Such a number is
found out by reading twice, and by how far the robot can have moved since it was last believed: not by a constant,
since a sensor near a wall changes by hundreds of counts in a tick in which the robot drives, and by none when it
stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from khepera_hil.protocol import SPEED_UNIT_MM_S

__all__ = ["AGREE", "READINGS", "TRUST", "Motion", "Slope", "alone", "doubtful", "settled", "sudden"]

AGREE = 60
"""Counts by which two readings of one sensor may differ and still count as the same: noise, and the 20 ms after
which a Khepera measures anew."""

READINGS = 3
"""How often the sensors are read at the most when they must be settled."""

_WHEEL_BASE = 53.0  # mm between the wheels
_LEVER = 88.0  # mm from the robot's centre to the farthest thing that a proximity sensor sees (28 + 60)


@dataclass(frozen=True)
class Slope:
    """The steepest that a sensor can be: counts for a mm of way and for a radian of turn."""

    way: float
    turn: float

    def most(self, way: float, turn: float) -> float:
        """Counts by which two believed readings may differ after so much way (mm) and turn (radians)."""
        return 2 * AGREE + self.way * way + self.turn * turn


TRUST = {
    # Grey plastic, 1020 to 260 counts from 10 to 15 mm (Khepera User Manual 5.02, figure 11).
    "N": Slope(152.0, 152.0 * _LEVER),
    # 162 to 270 counts from 70 to 90 mm in front of a bulb (the same, figure 9); 216 to 398 counts from 45 to 60
    # degrees beside one (recorded on a robot of the same kind). Shadows have no slope: see ``sudden``.
    "O": Slope(5.4, 700.0),
}
"""The commands whose answers move the robot, eight sensors each, and what to expect of them."""


class Motion:
    """How far the robot can have gone and turned by what its wheels were told; never less than it did by itself.

    Wheels follow an order with a lag, and one that was not confirmed may have come all the same: so of the last
    two orders the faster counts.
    """

    def __init__(self) -> None:
        self.orders = ((0, 0), (0, 0))
        """The last two orders, left and right, the newer behind."""
        self._fastest = (0.0, 0.0)  # of them, mm/s ahead and radians/s around
        self._at = 0.0
        self._way = self._turn = 0.0

    def told(self, left: int, right: int, now: float) -> None:
        """The wheels are told these speeds (command D's unit) at ``now`` seconds."""
        self.until(now)
        self.orders = self.orders[1], (left, right)
        self._fastest = (
            max(abs(one + other) for one, other in self.orders) / 2 * SPEED_UNIT_MM_S,
            max(abs(one - other) for one, other in self.orders) * SPEED_UNIT_MM_S / _WHEEL_BASE,
        )

    def until(self, now: float) -> tuple[float, float]:
        """mm and radians since the beginning, all added up whatever their direction."""
        passed, self._at = max(0.0, now - self._at), max(now, self._at)
        self._way += passed * self._fastest[0]
        self._turn += passed * self._fastest[1]
        return self._way, self._turn


def doubtful(first: Sequence[int], second: Sequence[int]) -> list[int]:
    """The sensors (0..7) whose two readings do not agree."""
    return [place for place, (a, b) in enumerate(zip(first, second, strict=True)) if abs(a - b) > AGREE]


def settled(readings: Sequence[Sequence[int]]) -> tuple[int, ...]:
    """Of three readings the median, sensor by sensor; of two, which agree, the newer."""
    if len(readings) < READINGS:
        return tuple(readings[-1])
    return tuple(int(median(values)) for values in zip(*readings, strict=True))


def alone(readings: Sequence[Sequence[int]]) -> list[int]:
    """The sensors whose three readings are three values of which no two agree."""
    found = []
    for place, values in enumerate(zip(*readings, strict=True)):
        low, middle, high = sorted(values)
        if min(middle - low, high - middle) > AGREE:
            found.append(place)
    return found


def sudden(before: Sequence[int], readings: Sequence[Sequence[int]], most: float) -> list[int]:
    """The sensors of which not all ``readings`` lie within ``most`` counts of what was believed before, but whose
    change three readings do not bear out either.

    Where all three say that it changed by more, and to the same side, so it did: a shadow's edge, a lamp that is
    switched on, a hand in the way. A change that only some of them saw is a number that was broken on its way.
    """
    found = []
    for place, (old, *new) in enumerate(zip(before, *readings, strict=True)):
        value = median(new) if len(new) >= READINGS else new[-1]
        if abs(value - old) <= most:
            continue
        above = sum(reading - old > most for reading in new)
        below = sum(old - reading > most for reading in new)
        if max(above, below) < READINGS:
            found.append(place)
    return found
