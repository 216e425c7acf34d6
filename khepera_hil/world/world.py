"""The world behind the emulator: physics at a fixed step, sensors on their own schedule, a witness, a score.

Inside mm, grams, seconds and radians; what leaves through :meth:`World.pose`, :meth:`World.shapes`,
:meth:`World.poses` and :meth:`World.score` is in metres. Time is simulated: seconds since power-up, moved
only by :meth:`World.advance`.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from khepera_hil.chance import streams
from khepera_hil.motion import Motion
from khepera_hil.world.arena import Arena, load_arena
from khepera_hil.world.battery import Battery
from khepera_hil.world.furnish import Layout, furnish
from khepera_hil.world.noise import FrameNoise
from khepera_hil.world.physics import Physics
from khepera_hil.world.scenario import Agenda, Event, Scenario, load_scenario
from khepera_hil.world.scene import Scene
from khepera_hil.world.score import Score
from khepera_hil.world.sensors import BODY_RADIUS, GAIN_SPREAD, Sensors
from khepera_hil.world.shapes import Pose, Shape, box, disc
from khepera_hil.world.wheels import WHEEL_BASE, Wheels

__all__ = ["STEP", "World"]

Array = NDArray[np.float64]
E = TypeVar("E", bound=Event)

STEP = 0.005
"""Seconds of one step of physics."""

_STEPS_A_FRAME = 4
"""Every 20 ms all eight sensors are measured anew (Khepera User Manual 5.02, section 3.1.6); the values stand
until the next time."""

_CAMERA_PERIOD = 0.2  # s, when nobody has set one
_ROBOT_HEIGHT = 29.0  # mm (paper, section 4.1)
_MOUNTING = math.radians(3.0)  # standard deviation (proposed)
_WHEEL_BIAS = 0.01  # standard deviation (proposed)
_PROXIMITY_NOISE = 25.0  # counts, additive: third differences along the measured tables
_BACKGROUND = 10.0  # counts up to which a sensor that sees nothing answers: half zeros, else up to 12
_LIGHT_NOISE = 4.4  # counts, from the measured table


class World:
    """A robot in an arena; ``seed`` chooses the robot's peculiarities, its start, the furniture and the noise.

    ``arena`` is an arena, or what :func:`~khepera_hil.world.arena.load_arena` takes. Raises
    :class:`~khepera_hil.errors.WorldError`.
    """

    def __init__(
        self,
        arena: Arena | str = "furnished",
        seed: int = 0,
        scenario: Scenario | str | None = None,
        *,
        compression: float = 1.0,
    ) -> None:
        self.arena = load_arena(arena) if isinstance(arena, str) else arena
        self.scenario = load_scenario(scenario) if isinstance(scenario, str) else scenario
        self._agenda = Agenda(() if self.scenario is None else self.scenario.events)
        self.battery = Battery(compression)
        self._camera_period = _CAMERA_PERIOD
        self._alarms = 0
        owners = streams(seed)
        furniture, proximity, light, slip = owners["world"].spawn(4)
        robot = np.random.default_rng(owners["robot"])
        self.layout: Layout = furnish(
            self.arena, np.random.default_rng(furniture), np.random.default_rng(owners["start"])
        )
        self.sensors = Sensors(
            gains=np.exp(robot.normal(0, GAIN_SPREAD, 8)),
            mountings=robot.normal(0, _MOUNTING, 8),
            lamps=self.layout.lamps,
            base=self.arena.base_square,
            diffuse=self.arena.base.diffuse if self.arena.base is not None else 0.0,
        )
        left, right = robot.normal(0, _WHEEL_BIAS, 2).tolist()
        self._wheels = Wheels((left, right), np.random.default_rng(slip), STEP)
        self._proximity_noise = FrameNoise(proximity)
        self._light_noise = FrameNoise(light)
        self._physics = Physics(self.layout.shapes, self.layout.base_walls, self.layout.start)
        self._score = Score(self.layout.start[:2], self.arena.base_square)
        self._movables = [place for place, shape in enumerate(self.layout.shapes) if shape.movable]
        self._scene = Scene(self.layout.shapes)
        self._scene_poses = self._scan_poses = self._physics.movables()
        self._pose = self._scan_pose = self.layout.start
        self._steps = 0
        self._read_proximity: tuple[int, list[int]] = (-1, [])
        self._read_light: tuple[int, list[int]] = (-1, [])

    def advance(self, now: float) -> None:
        """Step until ``now``: the last step ends at or before it."""
        target = math.floor(now / STEP + 1e-6)
        scan = target - target % _STEPS_A_FRAME
        while self._steps < target:
            left, right = self._wheels.advance()
            pose = self._physics.advance(STEP, (left + right) / 2, (right - left) / WHEEL_BASE)
            self._pose = pose
            self._steps += 1
            self._score.step(self._steps * STEP, STEP, pose[:2], self._physics.touching > 0)
            if self._steps == scan:
                # Only the last scan can still be read, so only it is remembered, and computed when it is.
                self._scan_pose = pose
                self._scan_poses = self._physics.movables()

    @property
    def motion(self) -> Motion:
        """The robot's motion controllers, which the world runs every 10 ms and which keep their last order."""
        return self._wheels.motion

    def set_speed(self, left: float, right: float) -> None:
        """What the wheels are to do from the next step on, mm/s."""
        self._wheels.asked = (left, right)

    def wheel_travel(self) -> tuple[float, float]:
        """What each wheel has rolled, mm: before slip, so it goes on when the robot is blocked."""
        return self._wheels.travel

    def wheel_window(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """:meth:`wheel_travel` at the last two multiples of 10 ms."""
        return self._wheels.window

    def proximity(self) -> list[int]:
        """The eight values of the last scan, 0..1023, in the order of command N."""
        frame = self._steps // _STEPS_A_FRAME
        if self._read_proximity[0] != frame:
            scene = self._scene_of_scan()
            clean = self.sensors.proximity(scene, self._scan_pose)
            clean = clean * self.sensors.blinded(scene, self._scan_pose)
            normal, uniform = self._proximity_noise.frame(frame)
            noisy = np.rint(clean + _PROXIMITY_NOISE * normal)
            nothing = np.where(uniform < 0.5, 0, np.floor((uniform - 0.5) * 24) + 1)
            values = np.clip(np.where(clean > _BACKGROUND, noisy, nothing), 0, 1023)
            self._read_proximity = (frame, values.astype(int).tolist())
        return self._read_proximity[1]

    def light(self) -> list[int]:
        """The eight values of the last scan, 0..511, low is bright, in the order of command O."""
        frame = self._steps // _STEPS_A_FRAME
        if self._read_light[0] != frame:
            clean = self.sensors.light(self._scene_of_scan(), self._scan_pose)
            normal, _ = self._light_noise.frame(frame)
            values = np.clip(np.rint(clean + _LIGHT_NOISE * normal), 0, 511)
            self._read_light = (frame, values.astype(int).tolist())
        return self._read_light[1]

    def camera(self) -> list[int]:
        """The 64 grey levels (0..255) of the frame that the camera holds, the left edge first."""
        return [0] * 64

    def camera_light(self) -> int:
        """The light level by which the camera sets its exposure, 0..65535; more is darker."""
        return 0

    def set_camera_period(self, seconds: float) -> None:
        """How long the camera holds a frame; 0: its own choice. The first new frame is taken now."""
        self._camera_period = seconds or _CAMERA_PERIOD

    def set_turbine(self, on: bool) -> None:
        """The micro-turbine on the general I/O turret."""
        self.battery.turbine = on

    def heard_alarm(self) -> None:
        """The watchman sounded its alarm now; for the score."""
        self._alarms += 1

    def due(self, *kinds: type[E]) -> list[E]:
        """Events of the scenario that concern others, each once when its moment has come: orders, link faults,
        resets (:class:`Order`, :class:`LinkFault`, :class:`Reset`)."""
        return self._agenda.due(self._steps * STEP, *kinds)

    def next_due(self, *kinds: type[Event]) -> float | None:
        """When the next event of these kinds is due, seconds since power-up."""
        return self._agenda.next(*kinds)

    def pose(self) -> Pose:
        """The robot's true pose: metres, and radians counter-clockwise from the x axis, not wrapped."""
        x, y, theta = self._pose
        return x / 1000, y / 1000, theta

    def shapes(self) -> list[dict[str, Any]]:
        """Everything there is at its starting pose, the robot, lamps and the base too; JSON-able, metres.

        Each has name, kind, polygon (in its own frame) or radius, pose, height and movable.
        """
        shapes: list[Shape] = [*self.layout.shapes]
        if (square := self.arena.base_square) is not None:
            left, low, right, high = square
            middle = ((left + right) / 2, (low + high) / 2, 0.0)
            shapes.append(box("base", "base", right - left, high - low, middle, 0.0))
        for lamp in self.layout.lamps:
            shapes.append(disc(lamp.name, "lamp", lamp.radius, (lamp.x, lamp.y, 0.0), lamp.height))
        shapes.append(disc("robot", "robot", BODY_RADIUS, self.layout.start, _ROBOT_HEIGHT))
        return [shape.described() for shape in shapes]

    def poses(self) -> dict[str, Pose]:
        """Where the movable things are now, the robot too: metres and radians, by name."""
        poses = {
            self.layout.shapes[place].name: (x / 1000, y / 1000, theta)
            for place, (x, y, theta) in zip(self._movables, self._physics.movables(), strict=True)
        }
        poses["robot"] = self.pose()
        return poses

    def score(self) -> dict[str, Any]:
        """The figures of :meth:`khepera_hil.world.score.Score.figures`."""
        return self._score.figures()

    def _scene_of_scan(self) -> Scene:
        if self._scan_poses != self._scene_poses:
            for place, old, new in zip(self._movables, self._scene_poses, self._scan_poses, strict=True):
                if old != new:
                    self._scene.place(place, new)
            self._scene_poses = self._scan_poses
        return self._scene
