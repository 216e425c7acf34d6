"""One robot of the world: what is its own, and what it may ask. Millimetres, seconds and radians inside."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from khepera_hil.motion import Motion
from khepera_hil.world.arena import Arena
from khepera_hil.world.battery import Battery
from khepera_hil.world.camera import Camera
from khepera_hil.world.history import SCAN, STEP, History, Moment, Time
from khepera_hil.world.scanner import Scanner
from khepera_hil.world.scenario import Agenda, Event
from khepera_hil.world.score import Score
from khepera_hil.world.sensors import GAIN_SPREAD, Sensors
from khepera_hil.world.shapes import BODY_RADIUS, Pose, Shape
from khepera_hil.world.wheels import Wheels

__all__ = ["STEPS_A_RECKONING", "Peculiar", "Robot", "name_of", "robot_shape"]

E = TypeVar("E", bound=Event)

STEPS_A_RECKONING = 4  # of what the battery gave, every 20 ms

_HEIGHT = 29.0  # mm (paper, section 4.1)
_LOADED = 45.0  # mm, with the camera's turret on it, whose lens is at 40 (proposed)
_REFLECTANCE = 0.8  # so it is seen some 2 cm away (proposed)
_ALBEDO = 0.25  # (proposed)
_MOUNTING = math.radians(3.0)  # standard deviation (proposed)
_WHEEL_BIAS = 0.01  # standard deviation (proposed)


@dataclass(frozen=True)
class Peculiar:
    """Seeds of what makes one robot differ from another, and of its noise."""

    robot: np.random.SeedSequence
    proximity: np.random.SeedSequence
    light: np.random.SeedSequence
    slip: np.random.SeedSequence
    camera: np.random.SeedSequence


def name_of(robot: int, among: int = 1) -> str:
    """What robot ``robot`` is called by robot ``among``: itself is "robot"."""
    return "robot" if robot == among else f"robot {robot}"


def robot_shape(name: str, pose: Pose, *, seen: bool) -> Shape:
    """A robot's body; ``seen``: as other robots see it, with its turrets on."""
    return Shape(
        name,
        "robot",
        pose,
        _LOADED if seen else _HEIGHT,
        radius=BODY_RADIUS,
        reflectance=_REFLECTANCE,
        albedo=_ALBEDO,
    )


class Robot:
    """A robot: wheels, sensors, camera, battery, and what it was worth. The world moves its time.

    ``number`` counts from 1. ``shapes`` are all that it may see (``movables``: places of those that move);
    ``time`` is the world's. ``events`` are the scenario's, of which those for this robot are handed out by
    :meth:`due`. ``company``: there are other robots. ``textures`` chooses the stripes of what has some, the same
    for all robots.
    """

    def __init__(
        self,
        number: int,
        start: Pose,
        chance: Peculiar,
        textures: np.random.SeedSequence,
        *,
        arena: Arena,
        shapes: Sequence[Shape],
        movables: Sequence[int],
        lamp: tuple[float, float] | None,
        company: bool,
        events: Sequence[Event],
        compression: float,
        time: Time,
    ) -> None:
        self.number = number
        own = np.random.default_rng(chance.robot)
        self.sensors = Sensors(
            gains=np.exp(own.normal(0, GAIN_SPREAD, 8)),
            mountings=own.normal(0, _MOUNTING, 8),
            base=arena.base_square,
            diffuse=arena.base.diffuse if arena.base is not None else 0.0,
            room_light=arena.room_light,
        )
        left, right = own.normal(0, _WHEEL_BIAS, 2).tolist()
        self.wheels = Wheels((left, right), np.random.default_rng(chance.slip), STEP)
        self._rolled = self.wheels.travel
        self.battery = Battery(compression)
        self.turbine = False
        """Whether the micro-turbine at its front blows."""
        self.score = Score(start[:2], arena.base_square, lamp, company=company)
        self.scanner = Scanner(self.sensors, shapes, movables, chance.proximity, chance.light)
        self.eye = Camera(
            shapes, movables, math.hypot(*arena.size), chance.camera, np.random.default_rng(textures), STEP
        )
        self._agenda = Agenda([event for event in events if event.robot == number])
        self._time = time
        self.now: Moment
        """The last moment that is known of it."""
        self.history: History

    def begin(self, moment: Moment) -> None:
        """Power-up: the first moment, and a first frame of the camera."""
        self.now = moment
        self.history = History(moment)
        self.eye.take(moment, moment.pose)

    def roll(self) -> tuple[float, float]:
        """One step of the wheels; the speeds at which they push the floor, mm/s. An empty battery turns none, and
        the encoders see it."""
        if self.battery.charge > 0:
            return self.wheels.advance()
        self.wheels.window = self.wheels.travel, self.wheels.travel
        return 0.0, 0.0

    def reckon(self) -> None:
        """The battery's part since the last time, :data:`STEPS_A_RECKONING` steps ago."""
        (left, right), (was_left, was_right) = self.wheels.travel, self._rolled
        self._rolled = left, right
        rolled = abs(left - was_left) + abs(right - was_right)
        self.battery.step(STEPS_A_RECKONING * STEP, rolled, self.score.inside)

    # What its program reads and does.

    @property
    def motion(self) -> Motion:
        """The motion controllers, which the world runs every 10 ms and which keep their last order."""
        return self.wheels.motion

    def set_speed(self, left: float, right: float) -> None:
        """What the wheels are to do from the next step on, mm/s."""
        self.wheels.asked = (left, right)

    def wheel_travel(self) -> tuple[float, float]:
        """What each wheel has rolled, mm: before slip, so it goes on when the robot is blocked."""
        return self.wheels.travel

    def wheel_window(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """:meth:`wheel_travel` at the last two multiples of 10 ms."""
        return self.wheels.window

    def proximity(self) -> list[int]:
        """The eight values that stand now, 0..1023, in the order of command N."""
        return self.scanner.proximity(self._time.scan, self.history)

    def light(self) -> list[int]:
        """The eight values that stand now, 0..511, low is bright, in the order of command O."""
        return self.scanner.light(self._time.scan, self.history)

    def camera(self) -> list[int]:
        """The 64 grey levels (0..255) of the frame that the camera holds, the left edge first."""
        return self.eye.picture()

    def camera_light(self) -> int:
        """The light level by which the camera sets its exposure, 0..65535; more is darker."""
        return self.eye.light_level()

    def set_camera_period(self, seconds: float) -> None:
        """How long the camera holds a frame; 0: its own choice."""
        self.eye.set_period(seconds, self._time.step)

    def set_turbine(self, on: bool) -> None:
        """The micro-turbine at the robot's front, on its general I/O turret."""
        self.turbine = self.battery.turbine = on

    def heard_alarm(self) -> None:
        """The watchman sounded its alarm now; for the score."""
        self.score.alarm(self._time.step * STEP)

    def due(self, *kinds: type[E]) -> list[E]:
        """Events of the scenario that concern others, each once when its moment has come: orders, link faults,
        resets (:class:`~khepera_hil.world.scenario.Order` and so on)."""
        return self._agenda.due(self._time.scan * SCAN + 1e-9, *kinds)

    def next_due(self, *kinds: type[Event]) -> float | None:
        """When the next event of these kinds is due that nobody has taken yet, seconds since power-up."""
        return self._agenda.next(*kinds)

    def pose(self) -> Pose:
        """The true pose: metres, and radians counter-clockwise from the x axis, not wrapped."""
        x, y, theta = self.now.pose
        return x / 1000, y / 1000, theta
