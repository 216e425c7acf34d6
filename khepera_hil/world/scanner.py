"""The eight sensors on their own schedule: one is scanned each 2.5 ms, and its values stand for 20 ms.

A value is computed when it is read, from the moment at which its sensor was scanned; it equals the one that
would have been computed at once, and nobody's reading changes anybody's noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from khepera_hil.world.history import SENSORS, History, Moment
from khepera_hil.world.lights import Lamp
from khepera_hil.world.noise import FrameNoise
from khepera_hil.world.scene import Scene
from khepera_hil.world.sensors import SENSOR_HEIGHT, Sensors
from khepera_hil.world.shapes import Pose, Shape

__all__ = ["Scanner", "Stage"]

Array = NDArray[np.float64]

_PROXIMITY_NOISE = 25.0  # counts, additive: third differences along the measured tables
_BACKGROUND = 10.0  # counts up to which a sensor that sees nothing answers: half zeros, else up to 12
_REACHED = 200.0  # mm from the robot's middle that no proximity sensor reaches: 28 + 130, and 20 ms on the way
_BESIDE = 60.0  # mm beside the line to a lamp that no sensor's own line to it has: 28, and 20 ms on the way
_LIGHT_NOISE = 4.4  # counts, from the measured table


class Stage:
    """A scene in which the movable shapes, given by their places in it, are put where a moment has them."""

    def __init__(self, scene: Scene, movables: Sequence[int]) -> None:
        self._scene = scene
        self._movables = movables
        self._placed: list[Pose | None] = []

    def at(self, places: list[Pose | None]) -> Scene:
        """The scene with everything at its place."""
        if places is not self._placed:
            for number, (place, new) in enumerate(zip(self._movables, places, strict=True)):
                if not self._placed or self._placed[number] != new:
                    self._scene.place(place, new)
            self._placed = places
        return self._scene


class Scanner:
    """One robot's sensors among ``shapes``; their noise is drawn from the two seeds. Scans are counted from 0."""

    def __init__(
        self,
        sensors: Sensors,
        shapes: Sequence[Shape],
        movables: Sequence[int],
        proximity: np.random.SeedSequence,
        light: np.random.SeedSequence,
    ) -> None:
        self._sensors = sensors
        self._stage = Stage(Scene(shapes, SENSOR_HEIGHT), movables)
        self._extents = [shapes[place].reach for place in movables]
        self._proximity_noise = FrameNoise(proximity)
        self._light_noise = FrameNoise(light)
        self._read_proximity: tuple[int, list[int]] = (-1, [])
        self._read_light: tuple[int, list[int]] = (-1, [])
        self._clean: tuple[int, list[float]] = (-1, [])
        self._broken: dict[tuple[str, int], int] = {}

    def break_sensor(self, sensor: int, of: str, reads: int | None) -> None:
        """Sensor 0..7 answers ``reads`` from now on (None: what it sees); ``of``: proximity, light or both."""
        for sense in ("proximity", "light") if of == "both" else (of,):
            self._broken.pop((sense, sensor), None)
            if reads is not None:
                self._broken[sense, sensor] = min(reads, 1023 if sense == "proximity" else 511)

    def proximity(self, scan: int, history: History) -> list[int]:
        """The eight values after scan ``scan``, 0..1023."""
        if self._read_proximity[0] != scan:
            moments = history.scanned(scan)
            normal, uniform = self._proximity_noise.scanned(scan)
            values = [0 if drawn < 0.5 else int((drawn - 0.5) * 24) + 1 for drawn in uniform]
            for sensor, seen in self._seen(scan, history, moments):
                values[sensor] = min(max(round(seen + _PROXIMITY_NOISE * normal[sensor]), 0), 1023)
            self._read_proximity = (scan, values)
        return self._with_broken("proximity", self._read_proximity[1])

    def light(self, scan: int, history: History) -> list[int]:
        """The eight values after scan ``scan``, 0..511, low is bright."""
        if self._read_light[0] != scan:
            normal, _ = self._light_noise.scanned(scan)
            values = [
                min(max(round(clean + _LIGHT_NOISE * drawn), 0), 511)
                for clean, drawn in zip(self._light(scan, history), normal, strict=True)
            ]
            self._read_light = (scan, values)
        return self._with_broken("light", self._read_light[1])

    def _seen(self, scan: int, history: History, moments: list[Moment]) -> Iterator[tuple[int, float]]:
        """Sensors that see more than nothing, and what: counts, without noise."""
        clean = np.zeros(SENSORS)
        anything = False
        now = moments[scan % SENSORS]
        for rows, places, poses in _together(moments, partial(self._is_far, now.pose)):
            seen = self._sensors.proximity(self._stage.at(places), poses)
            if seen is not None:
                anything = True
                clean[rows] = seen[rows]
        if not anything:
            return
        shining = [(light.lamp, 2 * light.lamp.intensity) for light in now.lights]  # a flicker's most
        if self._sensors.may_be_blinded(now.pose, shining):
            clean = clean * self._sensors.blinded(self._light(scan, history))
        for sensor, value in enumerate(clean.tolist()):
            if value > _BACKGROUND:
                yield sensor, value

    def _light(self, scan: int, history: History) -> list[float]:
        """Ambient light without noise."""
        if self._clean[0] != scan:
            moments = history.scanned(scan)
            lights = _shining(moments)
            clean = [0.0] * SENSORS
            aside = partial(self._is_aside, moments[scan % SENSORS].pose, [lamp for lamp, _ in lights])
            for rows, places, poses in _together(moments, aside):
                found = self._sensors.light(self._stage.at(places), poses, lights)
                for sensor in rows:
                    clean[sensor] = found[sensor]
            self._clean = (scan, clean)
        return self._clean[1]

    def _is_far(self, robot: Pose, number: int, place: Pose | None) -> bool:
        """Whether no proximity sensor reaches a movable shape that stands at ``place``."""
        if place is None:
            return True
        return math.hypot(place[0] - robot[0], place[1] - robot[1]) > self._extents[number] + _REACHED

    def _is_aside(self, robot: Pose, lamps: Sequence[Lamp], number: int, place: Pose | None) -> bool:
        """Whether a movable shape that stands at ``place`` is in the light of no lamp for any sensor."""
        if place is None:
            return True
        wide = self._extents[number] + _BESIDE
        x, y, _ = robot
        away_x, away_y = place[0] - x, place[1] - y
        for lamp in lamps:
            way_x, way_y = lamp.x - x, lamp.y - y
            along = (away_x * way_x + away_y * way_y) / max(way_x * way_x + way_y * way_y, 1e-9)
            along = min(max(along, 0.0), 1.0)
            if math.hypot(away_x - along * way_x, away_y - along * way_y) <= wide + lamp.radius:
                return False
        return True

    def _with_broken(self, sense: str, values: list[int]) -> list[int]:
        if not self._broken:
            return values
        return [self._broken.get((sense, sensor), value) for sensor, value in enumerate(values)]


_ALL = list(range(SENSORS))


def _together(
    moments: list[Moment], aside: Callable[[int, Pose | None], bool]
) -> Iterator[tuple[list[int], list[Pose | None], list[Pose]]]:
    """Sensors that were scanned while the movable shapes stood alike: which, the places, and the robot's poses.

    What is ``aside`` both times (told its number and its place) may stand anywhere: nobody sees the difference. So
    a mover at the other end of the floor does not have the eight sensors computed up to five times.
    """

    def alike(places: list[Pose | None]) -> bool:
        return all(
            a == b or (aside(number, a) and aside(number, b))
            for number, (a, b) in enumerate(zip(places, first, strict=True))
        )

    poses = [moment.pose for moment in moments]
    first = moments[0].places
    if all(moment.places is first for moment in moments) or all(alike(moment.places) for moment in moments):
        still = poses.count(poses[0]) == SENSORS
        yield _ALL, first, poses[:1] if still else poses
        return
    left = _ALL
    while left:
        first = moments[left[0]].places
        rows = [sensor for sensor in left if alike(moments[sensor].places)]
        left = [sensor for sensor in left if sensor not in rows]
        yield rows, first, poses


def _shining(moments: list[Moment]) -> list[tuple[Lamp, list[float]]]:
    """Every lamp with how strongly it shone when each sensor was scanned."""
    lights = moments[0].lights
    if all(moment.lights is lights for moment in moments) and all(light.flicker is None for light in lights):
        return [(light.lamp, [light.lamp.intensity] * SENSORS) for light in lights]
    found = {light.lamp.name: light.lamp for moment in moments for light in moment.lights}
    strengths = [{light.lamp.name: light.strength(moment.step) for light in moment.lights} for moment in moments]
    return [(lamp, [there.get(name, 0.0) for there in strengths]) for name, lamp in found.items()]
