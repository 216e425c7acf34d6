"""The linear camera on the robot: 64 grey levels over 36 degrees, held for a scan period.

A frame is computed when it is read, from the moment at which it was taken. Models: K-Team's K213 manual (cells,
angle, periods), KiKS (vignette, blur), the rest proposed. Lengths in mm, angles in radians, 0 ahead.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from khepera_hil.world.history import Moment
from khepera_hil.world.noise import FrameNoise
from khepera_hil.world.scanner import Stage
from khepera_hil.world.scene import Rays, Scene
from khepera_hil.world.shapes import Pose, Shape

__all__ = ["CAMERA_HEIGHT", "FIELD", "PIXELS", "Camera"]

Array = NDArray[np.float64]

PIXELS = 64
FIELD = math.radians(36.0)
CAMERA_HEIGHT = 40.0
"""mm; what is lower is not in the picture."""
CAMERA_AHEAD = 13.0

_OWN_PERIOD = 0.2
"""Seconds, when the host has set none."""

_FOCUS = 500.0  # mm from which on the picture is blurred
_BLACK, _SPAN = 50.0, 195.0  # grey levels of albedo 0, and up to albedo 1
_BRIGHTEST = 245.0  # what the exposure aims at
_ADAPTS = 0.2  # share of the way to it in one frame
_REMEMBERS = 16  # frames: what is older is worth less than 3 %
_NOISE = 4.0  # grey levels
_LEAST, _MOST = 0.5, 3.0  # of the exposure's gain

_DEGREES = np.linspace(18.0, -18.0, PIXELS)
_OFF = np.abs(_DEGREES)
# KiKS: beyond 5 degrees from the middle, the more the farther out, no cell gets brighter than this.
_CEILING = np.where(_OFF > 5, 240 - 6 * _OFF * (_OFF / 18) ** 1.5, 255.0)

_DEFOCUSED = np.ones(7) / 7
_TURNING = np.array([4.0, 3, 2, 1, 2, 3, 4]) / 19
_DRIVING = np.array([1.0, 1, 1, 4, 1, 1, 1]) / 10
_STANDING = np.array([0.0, 0, 1, 2, 1, 0, 0]) / 4
_ROUNDING = 1e-6  # radians
_TURNS, _DRIVES = 0.1, 3.0  # rad/s and mm/s from which on it counts as that


class _Frame:
    """A frame that was taken; what it shows before exposure, and its brightest cell, come when asked for."""

    def __init__(self, number: int, moment: Moment, blur: Array) -> None:
        self.number = number
        self.moment = moment
        self.blur = blur
        self.seen: Array | None = None
        self.brightest = 0.0


class Camera:
    """Looks at ``shapes``; ``seed`` is its noise's, ``textures`` chooses the stripes of what has some."""

    def __init__(
        self,
        shapes: Sequence[Shape],
        movables: Sequence[int],
        reach: float,
        seed: np.random.SeedSequence,
        textures: np.random.Generator,
        step: float,
    ) -> None:
        self._stage = Stage(Scene(shapes, CAMERA_HEIGHT, math.inf), movables)
        self._numbers = {place: number for number, place in enumerate(movables)}
        self._extents = {place: (shapes[place].height, shapes[place].reach) for place in movables}
        self._skin = _Skin(shapes, textures)
        self._reach = reach
        self._noise = FrameNoise(seed, PIXELS)
        angles = np.radians(_DEGREES)
        self._rays = Rays(
            np.tile([CAMERA_AHEAD, 0.0], (PIXELS, 1)), np.column_stack([np.cos(angles), np.sin(angles)])
        )
        self._step = step
        self._steps_a_frame = round(_OWN_PERIOD / step)
        self.next = 0
        """The step at which the next frame is taken."""
        self._frames: deque[_Frame] = deque(maxlen=_REMEMBERS)
        self._taken = 0
        self._read: tuple[int, list[int]] = (-1, [])

    def set_period(self, seconds: float, step: int) -> None:
        """Hold a frame so long (0: its own choice); a new period begins with a frame at the next step."""
        steps = max(1, round((seconds or _OWN_PERIOD) / self._step))
        if steps != self._steps_a_frame:
            self._steps_a_frame = steps
            self.next = step + 1

    def take(self, moment: Moment, before: Pose) -> None:
        """A frame, one step after the robot was at ``before``."""
        (x, y, theta), (from_x, from_y, from_theta) = moment.pose, before
        if abs(theta - from_theta) > _TURNS * self._step:
            blur = _TURNING
        elif math.hypot(x - from_x, y - from_y) > _DRIVES * self._step:
            blur = _DRIVING
        else:
            blur = _STANDING
        self._frames.append(_Frame(self._taken, moment, blur))
        self._taken += 1
        self.next = moment.step + self._steps_a_frame

    def picture(self) -> list[int]:
        """The frame that is held: 64 grey levels, 0..255, the left edge first."""
        frame = self._frames[-1]
        if self._read[0] != frame.number:
            normal, _ = self._noise.frame(frame.number)
            exposed = np.minimum(self._gain() * self._seen(frame), _CEILING)
            values = np.clip(np.rint(exposed + _NOISE * normal), 0, 255)
            self._read = (frame.number, values.astype(int).tolist())
        return self._read[1]

    def light_level(self) -> int:
        """Of the second sensor, which sets the pace of the first: 0..65535, more is darker."""
        frame = self._frames[-1]
        _, uniform = self._noise.frame(frame.number)
        self._seen(frame)
        return round(175 + 7 * (255 - frame.brightest) + 50 * float(uniform[0]))

    def sees(self, moment: Moment, among: Collection[int]) -> set[int]:
        """Which of the shapes at these places are in at least one of the 64 cells."""
        if not any(self._may_see(place, moment) for place in among):
            return set()
        hits = self._stage.at(moment.places).reflections(self._rays, [moment.pose], self._reach)
        if hits is None:
            return set()
        whose, _ = Scene.surface(hits)
        return set(whose[hits.distance <= self._reach].tolist()).intersection(among)

    def _may_see(self, place: int, moment: Moment) -> bool:
        """Whether a movable shape is so high, and lies in such a direction, that it may be in a cell.

        A mover is mostly elsewhere, and then no ray is cast.
        """
        high, wide = self._extents[place]
        pose = moment.places[self._numbers[place]]
        if pose is None or high <= CAMERA_HEIGHT:
            return False
        x, y, theta = moment.pose
        to_x = pose[0] - x - CAMERA_AHEAD * math.cos(theta)
        to_y = pose[1] - y - CAMERA_AHEAD * math.sin(theta)
        way = math.hypot(to_x, to_y)
        if way <= wide:
            return True
        off = math.remainder(math.atan2(to_y, to_x) - theta, 2 * math.pi)
        return abs(off) <= FIELD / 2 + math.asin(wide / way) + _ROUNDING

    def _gain(self) -> float:
        """The exposure: goes a fifth of the way at each frame to what would make the brightest cell 245."""
        gain = weight = 0.0
        keep = 1.0
        for frame in reversed(self._frames):
            if frame.seen is None:
                self._seen(frame)
            gain += keep * _BRIGHTEST / frame.brightest
            weight += keep
            keep *= 1 - _ADAPTS
        return min(max(gain / weight, _LEAST), _MOST)

    def _seen(self, frame: _Frame) -> Array:
        """Grey levels before exposure and noise, shape (64,)."""
        if frame.seen is None:
            hits = self._stage.at(frame.moment.places).reflections(self._rays, [frame.moment.pose], self._reach)
            grey = np.full(PIXELS, _BLACK)
            if hits is not None:
                met = hits.distance <= self._reach
                grey += _SPAN * np.where(met, self._skin.albedo(*Scene.surface(hits)), 0.0)
                far = met & (hits.distance > _FOCUS)
                grey = np.where(far, _blurred(grey, _DEFOCUSED), grey)
            frame.seen = _blurred(grey, frame.blur)
            frame.brightest = float(frame.seen.max())
        return frame.seen


def _blurred(grey: Array, kernel: Array) -> Array:
    padded = np.concatenate([grey[:1].repeat(3), grey, grey[-1:].repeat(3)])
    blurred: Array = np.convolve(padded, kernel, "valid")
    return blurred


class _Skin:
    """How light or dark every place on every outline is: all outlines one after the other on one line."""

    def __init__(self, shapes: Sequence[Shape], chance: np.random.Generator) -> None:
        ends: list[float] = []
        albedos: list[float] = []
        begins: list[float] = []
        begin = 0.0
        for shape in shapes:
            begins.append(begin)
            outline = shape.outline
            if shape.stripes is not None:
                widths = chance.uniform(*shape.stripes, int(outline / shape.stripes[0]) + 1)
                borders = np.cumsum(widths)
                borders = borders[borders < outline]
                ends += (begin + borders).tolist()
                albedos += [_STRIPES[place % 2] for place in range(len(borders))]
                albedos.append(_STRIPES[len(borders) % 2])
            else:
                albedos.append(shape.albedo)
            begin += outline
            ends.append(begin)
        self._begins = np.array(begins)
        self._ends = np.array(ends)
        self._albedos = np.array(albedos)

    def albedo(self, places: NDArray[np.intp], along: Array) -> Array:
        """Of points ``along`` mm round the outlines of the shapes at ``places``."""
        found = np.searchsorted(self._ends, self._begins[places] + along)
        seen: Array = self._albedos[np.minimum(found, len(self._albedos) - 1)]
        return seen


_STRIPES = (0.1, 0.9)
