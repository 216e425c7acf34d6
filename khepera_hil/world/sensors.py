"""Eight proximity and eight ambient light sensors: closed forms fitted to tables measured on real Kheperas.

Both are functions of where everything stands at one moment; when they are evaluated, and their noise, is
the caller's business. Angles in radians, counter-clockwise, 0 ahead; lengths in mm; values in counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from khepera_hil.world.lights import Lamp
from khepera_hil.world.scene import Rays, Scene
from khepera_hil.world.shapes import BODY_RADIUS, Pose

__all__ = ["GAIN_SPREAD", "POINTINGS", "SENSOR_HEIGHT", "Sensors"]

Array = NDArray[np.float64]

SENSOR_HEIGHT = 14.5
"""Above the floor (Webots' model of the Khepera)."""

_SENSOR_RADIUS = 28.0
# Where they sit and where they point, in the order of commands N and O (KiKS; a near wall peaks at the one
# angle, a far lamp at the other, in tables recorded on real robots).
_PLACES = np.radians([68.0, 43.0, 13.0, -13.0, -43.0, -68.0, -158.0, 158.0])
POINTINGS = np.radians([90.0, 45.0, 10.0, -10.0, -45.0, -90.0, -180.0, 180.0])

# Proximity: five rays a sensor; parameters fitted together to the sampled wall and cylinder of the Evorobot
# simulator (8 sensors x 180 bearings x 20 distances, recorded on a Khepera). They trade off against each
# other: none of them means anything alone.
_RAYS = np.radians([-45.0, -22.5, 0.0, 22.5, 45.0])
_WEIGHTS = np.cos(_RAYS) ** 1.32 / (np.cos(_RAYS) ** 1.32).sum()
_FALL = 2.81
_OFFSET = 11.04
_INCIDENCE = 1.58
_THRESHOLD = 394.0
GAIN = 46_700.0
"""Geometric mean of the eight sensors."""

GAIN_SPREAD = 0.25
"""Standard deviation of the gains' logarithm among the sensors of one robot."""

_REACH = 130.0  # of a ray: at that length all of a sensor's together come to a thirteenth of the threshold
_BACK_OFF = 5.0  # rays start this far inside the body, so that a wall that touches it is hit

# Ambient light: fitted to a lamp sampled on a robot of the same kind (8 x 180 bearings x 26 distances), with six
# parameters: these four, and the lamp's own intensity and height.
_DARK = 500.0
_SPAN = 418.0
_LOBE = 1.42
_LEAK = 0.05  # what was measured behind the body
_BLINDING = 100.0  # counts of ambient light under which the proximity sensor's subtraction fails (proposed)


class Sensors:
    """One robot's sensors, with the gains and the mounting errors that are its own.

    ``gains`` multiply the mean gain, ``mountings`` (radians) turn the pointings, both of shape (8,).
    ``base`` is the square (x0, y0, x1, y1) in which diffuse light of ``diffuse`` is added; ``room_light`` (counts)
    makes all of the arena brighter. ``poses`` of the methods are one for all sensors, or one for each: where it
    was when that sensor was scanned.
    """

    def __init__(
        self,
        gains: Array,
        mountings: Array,
        base: tuple[float, float, float, float] | None = None,
        diffuse: float = 0.0,
        room_light: float = 0.0,
    ) -> None:
        self._gain = GAIN * gains
        pointings = POINTINGS + mountings
        self._base = base
        self._diffuse = diffuse
        self._dark = _DARK - room_light
        places = _SENSOR_RADIUS * np.column_stack([np.cos(_PLACES), np.sin(_PLACES)])
        self._facings = np.column_stack([places, np.cos(pointings), np.sin(pointings)]).tolist()
        directions = (pointings[:, None] + _RAYS).ravel()
        towards = np.column_stack([np.cos(directions), np.sin(directions)])
        self._brightest = self._matters = -1.0
        self._rays = Rays(np.repeat(places, len(_RAYS), axis=0) - _BACK_OFF * towards, towards)

    def proximity(self, scene: Scene, poses: Sequence[Pose]) -> Array | None:
        """What the eight sensors reflect before noise, rounding and clipping, shape (8,); negative: nothing.

        None when all of them see so little that nobody could tell it from nothing.
        """
        if scene.brightest != self._brightest:
            # Where all rays of the best sensor would meet the best reflector head-on, and see nothing yet.
            self._brightest = scene.brightest
            best = float(self._gain.max()) * scene.brightest / _THRESHOLD
            self._matters = 10 * best ** (1 / _FALL) - _OFFSET + self._rays.farthest + _BACK_OFF
        seen = scene.reflections(self._rays, poses, _REACH, self._matters)
        if seen is None:
            return None
        way = np.maximum(seen.distance - _BACK_OFF, 0)
        returned = seen.reflectance * seen.cosine**_INCIDENCE * (10 / (way + _OFFSET)) ** _FALL
        values: Array = self._gain * (returned.reshape(8, len(_RAYS)) * _WEIGHTS).sum(1) - _THRESHOLD
        return values

    def light(
        self, scene: Scene, poses: Sequence[Pose], lights: Sequence[tuple[Lamp, Sequence[float]]]
    ) -> list[float]:
        """Ambient light before noise, rounding and clipping, of the eight sensors; low is bright.

        ``lights`` are lamps and how strongly each shines for each sensor.
        """
        # Eight times a dozen numbers are quicker one by one than as arrays.
        places: list[tuple[float, float, float, float]] = []
        before: Pose | None = None
        cosine = sine = 0.0
        for sensor, (own_x, own_y, own_face_x, own_face_y) in enumerate(self._facings):
            pose = poses[sensor] if len(poses) > 1 else poses[0]
            if pose is not before:
                before, cosine, sine = pose, math.cos(pose[2]), math.sin(pose[2])
            places.append(
                (
                    pose[0] + cosine * own_x - sine * own_y,
                    pose[1] + sine * own_x + cosine * own_y,
                    cosine * own_face_x - sine * own_face_y,
                    sine * own_face_x + cosine * own_face_y,
                )
            )
        exposure = [0.0] * 8
        if self._base is not None and self._diffuse and self._near_base(poses[-1]):
            left, low, right, high = self._base
            exposure = [self._diffuse if left <= x <= right and low <= y <= high else 0.0 for x, y, _, _ in places]
        for lamp, strengths in lights:
            shares = _shares(lamp, places)
            target = lamp.x, lamp.y, lamp.height
            if shadows := scene.shadows(lamp.name, target, lamp.radius, poses[-1]):
                hidden = scene.shaded(shadows, target, np.array(_lines(lamp, places)).T)
                shown = (1 - hidden.reshape(8, 3).sum(1) / 3).tolist()
                shares = [share * less for share, less in zip(shares, shown, strict=True)]
            exposure = [
                sum_ + share * strength for sum_, share, strength in zip(exposure, shares, strengths, strict=True)
            ]
        return [self._dark - _SPAN * min(bright, 1.0) for bright in exposure]

    def blinded(self, light: Sequence[float]) -> Array:
        """The share of the proximity value that each sensor keeps with a lamp in its face, shape (8,)."""
        return np.clip(np.array(light) / _BLINDING, 0, 1)

    def may_be_blinded(self, pose: Pose, lights: Sequence[tuple[Lamp, float]]) -> bool:
        """Whether a lamp or the base is so near that it is worth computing the light."""
        if self._near_base(pose):
            return True
        enough = (self._dark - _BLINDING) / _SPAN
        for lamp, intensity in lights:
            brightest = 100 * math.sqrt((1 + _LEAK) * intensity / enough)
            if math.hypot(lamp.x - pose[0], lamp.y - pose[1]) < brightest + 2 * BODY_RADIUS:
                return True
        return False

    def _near_base(self, pose: Pose) -> bool:
        """Whether a sensor may be in the base's square, a little earlier or later too."""
        if self._base is None:
            return False
        left, low, right, high = self._base
        near = 2 * BODY_RADIUS
        return left - near <= pose[0] <= right + near and low - near <= pose[1] <= high + near


def _shares(lamp: Lamp, places: Sequence[tuple[float, float, float, float]]) -> list[float]:
    """Of a lamp of intensity 1, what sensors at these places get, each with the direction in which it points."""
    above = (lamp.height - SENSOR_HEIGHT) ** 2
    shares = []
    for x, y, face_x, face_y in places:
        to_x, to_y = lamp.x - x, lamp.y - y
        squared = to_x * to_x + to_y * to_y + above + 1e-9
        # The cosine in the plane, shortened by the lamp's elevation.
        ahead = face_x * to_x + face_y * to_y
        lobe = (ahead / math.sqrt(squared)) ** _LOBE if ahead > 0 else 0.0
        shares.append((lobe + _LEAK) * 10_000 / squared)
    return shares


def _lines(lamp: Lamp, places: Sequence[tuple[float, float, float, float]]) -> list[tuple[float, ...]]:
    """Three lines of sight from each place to a lamp, to its two rims and its middle: start, way, its length."""
    lines: list[tuple[float, ...]] = []
    for x, y, _, _ in places:
        to_x, to_y = lamp.x - x, lamp.y - y
        share = lamp.radius / max(math.hypot(to_x, to_y), 1e-9)
        for side in (-share, 0.0, share):
            way_x, way_y = to_x - side * to_y, to_y + side * to_x
            lines.append((x, y, way_x, way_y, max(math.hypot(way_x, way_y), 1e-9)))
    return lines
