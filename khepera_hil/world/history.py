"""The last moments of the world, for sensors that are computed when they are read."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from khepera_hil.world.lights import Light
from khepera_hil.world.shapes import Pose

__all__ = ["SCAN", "SCANS_A_STEP", "STEP", "History", "Moment", "Time"]

STEP = 0.005
"""Seconds of one step of physics."""

SCANS_A_STEP = 2
"""One sensor is scanned each 2.5 ms, two in a step of the physics."""

SCAN = STEP / SCANS_A_STEP
"""Seconds from one sensor's scan to the next one's: 20 ms for all eight (Khepera User Manual 5.02, 3.1.6)."""

SENSORS = 8

_AGES = [
    [scan // SCANS_A_STEP - (scan - (scan - sensor) % SENSORS) // SCANS_A_STEP for sensor in range(SENSORS)]
    for scan in range(SENSORS)
]
"""For each scan of a turn, how many steps ago each sensor was scanned for the last time."""


class Time:
    """How far the world is, counted from power-up: scans and whole steps of the physics."""

    __slots__ = ("scan", "step")

    def __init__(self) -> None:
        self.scan = self.step = 0


class Moment(NamedTuple):
    """Where everything is at the end of one step, for one robot: lengths in mm.

    ``places`` are the movable shapes' (None: not on the floor). A moment never changes, and neither do its parts.
    """

    step: int
    pose: Pose
    places: list[Pose | None]
    lights: tuple[Light, ...]


class History:
    """As many moments as the eight sensors may still show, the latest last."""

    reach = 1 + max(map(max, _AGES))
    """How many that are."""

    def __init__(self, start: Moment) -> None:
        self.moments = deque([start] * self.reach, maxlen=self.reach)

    def scanned(self, scan: int) -> list[Moment]:
        """The moment at which each sensor was scanned for the last time, when scan ``scan`` is done (0: the first).

        Sensors are scanned in turn; before the first scan they saw what there was at power-up.
        """
        moments = self.moments
        return [moments[-1 - age] for age in _AGES[scan % SENSORS]]
