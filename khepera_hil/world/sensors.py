"""Eight proximity and eight ambient light sensors: closed forms fitted to tables measured on real Kheperas.

Both are functions of where everything stands at one moment; when they are evaluated, and their noise, is
the caller's business. Angles in radians, counter-clockwise, 0 ahead; lengths in mm; values in counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from khepera_hil.world.scene import Rays, Scene, Solid, beside, hides
from khepera_hil.world.shapes import Pose

__all__ = ["BODY_RADIUS", "GAIN_SPREAD", "POINTINGS", "SENSOR_HEIGHT", "Lamp", "Sensors"]

Array = NDArray[np.float64]

BODY_RADIUS = 28.5
"""Paper, section 4.1: 57 mm across."""

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

_REACH = 130.0  # from the robot's centre: a ray of that length is worth less than a fifteenth of the threshold
_TOUCHING = 3.0  # mm behind a sensor at which a line of sight begins, for the same reason
_BACK_OFF = 5.0  # rays start this far inside the body, so that a wall that touches it is hit

# Ambient light: fitted to a lamp sampled on a robot of the same kind (8 x 180 bearings x 26 distances).
_DARK = 497.0
_SPAN = 425.0
_LOBE = 1.34
_LEAK = 0.03  # what was measured behind the body
_DISTANCE_FALL = 2.15
_BLINDING = 100.0  # counts of ambient light under which the proximity sensor's subtraction fails (proposed)


@dataclass(frozen=True)
class Lamp:
    """A light above the floor; ``intensity`` 1.22 is the bulb of the measured table, 7 a lamp for 1 m."""

    name: str
    x: float
    y: float
    height: float
    intensity: float
    radius: float = 5.0


class Sensors:
    """One robot's sensors, with the gains and the mounting errors that are its own.

    ``gains`` multiply the mean gain, ``mountings`` (radians) turn the pointings, both of shape (8,).
    ``base`` is the square (x0, y0, x1, y1) in which diffuse light of ``diffuse`` is added.
    """

    def __init__(
        self,
        gains: Array,
        mountings: Array,
        lamps: Sequence[Lamp],
        base: tuple[float, float, float, float] | None = None,
        diffuse: float = 0.0,
    ) -> None:
        self._gain = GAIN * gains
        pointings = POINTINGS + mountings
        self._lamps = list(lamps)
        self._base = base
        self._diffuse = diffuse
        self._places = _SENSOR_RADIUS * np.column_stack([np.cos(_PLACES), np.sin(_PLACES)])
        self._facing = np.column_stack([np.cos(pointings), np.sin(pointings)])
        directions = (pointings[:, None] + _RAYS).ravel()
        towards = np.column_stack([np.cos(directions), np.sin(directions)])
        self._rays = Rays(np.repeat(self._places, len(_RAYS), axis=0) - _BACK_OFF * towards, towards)

    def proximity(self, scene: Scene, pose: Pose) -> Array:
        """What the eight sensors reflect before noise, rounding and clipping, shape (8,); negative: nothing."""
        seen = scene.reflections(self._rays, pose, _REACH, SENSOR_HEIGHT)
        if seen is None:
            return np.full(8, -_THRESHOLD)
        distance, cosine, reflectance = seen
        way = np.maximum(distance - _BACK_OFF, 0)
        returned = reflectance * cosine**_INCIDENCE * (10 / (way + _OFFSET)) ** _FALL
        values: Array = self._gain * (returned.reshape(8, len(_RAYS)) @ _WEIGHTS) - _THRESHOLD
        return values

    def light(self, scene: Scene, pose: Pose) -> Array:
        """Ambient light before noise, rounding and clipping, shape (8,); low is bright."""
        x, y, theta = pose
        cosine, sine = math.cos(theta), math.sin(theta)
        turn = np.array([[cosine, sine], [-sine, cosine]])
        places = self._places @ turn + (x, y)
        exposure = np.zeros(8)
        if self._base is not None and self._diffuse and self._near_base(x, y):
            left, low, right, high = self._base
            inside = (places >= (left, low)) & (places <= (right, high))
            exposure += self._diffuse * inside.all(1)
        if self._lamps:
            facing = self._facing @ turn
            for lamp in self._lamps:
                solids = scene.between(
                    (x, y, SENSOR_HEIGHT), (lamp.x, lamp.y, lamp.height), BODY_RADIUS + lamp.radius
                )
                exposure += _from(lamp, places, facing, solids)
        return _DARK - _SPAN * np.minimum(exposure, 1)

    def blinded(self, scene: Scene, pose: Pose) -> Array:
        """The share of the proximity value that each sensor keeps with a lamp in its face, shape (8,)."""
        if self._may_blind(pose[0], pose[1]):
            return np.minimum(self.light(scene, pose) / _BLINDING, 1)
        return np.ones(8)

    def _may_blind(self, x: float, y: float) -> bool:
        """Whether a lamp or the base is so near that it is worth computing the light."""
        if self._near_base(x, y):
            return True
        enough = (_DARK - _BLINDING) / _SPAN
        for lamp in self._lamps:
            brightest = 100 * ((1 + _LEAK) * lamp.intensity / enough) ** (1 / _DISTANCE_FALL)
            if (lamp.x - x) ** 2 + (lamp.y - y) ** 2 < (brightest + BODY_RADIUS) ** 2:
                return True
        return False

    def _near_base(self, x: float, y: float) -> bool:
        if self._base is None:
            return False
        left, low, right, high = self._base
        return left - BODY_RADIUS <= x <= right + BODY_RADIUS and low - BODY_RADIUS <= y <= high + BODY_RADIUS


def _from(lamp: Lamp, places: Array, facing: Array, solids: Sequence[Solid]) -> list[float]:
    """What one lamp gives each sensor, from their places and unit pointings on the floor, both of shape (8, 2)."""
    above = lamp.height - SENSOR_HEIGHT
    exposure = []
    for (x, y), (face_x, face_y) in zip(places.tolist(), facing.tolist(), strict=True):
        to_x, to_y = lamp.x - x, lamp.y - y
        flat = to_x * to_x + to_y * to_y
        squared = flat + above * above
        # The cosine in the plane, shortened by the lamp's elevation.
        ahead = max(face_x * to_x + face_y * to_y, 0.0) / math.sqrt(squared)
        strength = lamp.intensity * (ahead**_LOBE + _LEAK) * (10_000 / squared) ** (_DISTANCE_FALL / 2)
        if solids:
            length = math.sqrt(max(flat, 1e-9))
            strength *= 1 - _hidden(lamp, (x, y, SENSOR_HEIGHT), to_x / length, to_y / length, solids)
        exposure.append(strength)
    return exposure


def _hidden(
    lamp: Lamp, place: tuple[float, float, float], along_x: float, along_y: float, solids: Sequence[Solid]
) -> float:
    """The share of a lamp that is hidden: of three lines of sight, to its middle and to both its rims."""
    x, y, _ = place
    ahead = [solid for solid in solids if not beside(solid, x, y, along_x, along_y, lamp.radius)]
    if not ahead:
        return 0.0
    hidden = 0
    for side in (-lamp.radius, 0.0, lamp.radius):
        point = (lamp.x - along_y * side, lamp.y + along_x * side, lamp.height)
        hidden += any(hides(solid, place, point, _TOUCHING) for solid in ahead)
    return hidden / 3
