"""The world behind the emulator: physics at a fixed step, sensors on their own schedule, a scenario, a score.

Inside mm, grams, seconds and radians; what leaves through :meth:`World.pose`, :meth:`World.shapes`,
:meth:`World.poses` and :meth:`World.score` is in metres. Time is simulated: seconds since power-up, moved
only by :meth:`World.advance`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from khepera_hil.chance import streams
from khepera_hil.errors import WorldError
from khepera_hil.motion import Motion
from khepera_hil.world.arena import Arena, Start, in_the_way, load_arena
from khepera_hil.world.battery import Battery
from khepera_hil.world.camera import Camera
from khepera_hil.world.cast import Cast, Director
from khepera_hil.world.furnish import Layout, furnish
from khepera_hil.world.history import SCANS_A_STEP, History, Moment
from khepera_hil.world.physics import Physics
from khepera_hil.world.scanner import Scanner
from khepera_hil.world.scenario import Agenda, Event, PutDown, Scenario, load_scenario
from khepera_hil.world.score import Score
from khepera_hil.world.sensors import GAIN_SPREAD, Sensors
from khepera_hil.world.shapes import BODY_RADIUS, Pose, Shape, box, disc
from khepera_hil.world.wheels import WHEEL_BASE, Wheels

__all__ = ["STEP", "World"]

E = TypeVar("E", bound=Event)

STEP = 0.005
"""Seconds of one step of physics."""

_SCAN = STEP / SCANS_A_STEP
"""Seconds from one sensor's scan to the next one's: 20 ms for all eight (Khepera User Manual 5.02, 3.1.6)."""

_STEPS_A_RECKONING = 4  # of what the battery gave, every 20 ms
_STEPS_A_LOOK = 10  # whether a mover is in view, every 50 ms

_ROBOT_HEIGHT = 29.0  # mm (paper, section 4.1)
_MOUNTING = math.radians(3.0)  # standard deviation (proposed)
_WHEEL_BIAS = 0.01  # standard deviation (proposed)
_FLAME = 5.0  # mm, drawn with this radius


class World:
    """A robot in an arena, and what a scenario brings there.

    ``seed`` chooses the robot's peculiarities, its start, the furniture and all noise. ``arena`` and ``scenario``
    are such things, or what :func:`~khepera_hil.world.arena.load_arena` and
    :func:`~khepera_hil.world.scenario.load_scenario` take. ``compression`` makes the battery so many times faster
    (None: as the scenario says, 1 without one). ``present`` names a thing from the arena's shelf that stands on its
    stage from the start. Raises :class:`~khepera_hil.errors.WorldError`.
    """

    def __init__(
        self,
        arena: Arena | str = "furnished",
        seed: int = 0,
        scenario: Scenario | str | None = None,
        *,
        compression: float | None = None,
        present: str | None = None,
    ) -> None:
        self.arena = load_arena(arena) if isinstance(arena, str) else arena
        self.scenario = load_scenario(scenario) if isinstance(scenario, str) else scenario
        if self.scenario is not None and self.scenario.start is not None:
            self.arena = _started(self.arena, self.scenario.name, self.scenario.start)
        owners = streams(seed)
        furniture, proximity, light, slip, camera, textures = owners["world"].spawn(6)
        robot = np.random.default_rng(owners["robot"])
        self.layout: Layout = furnish(
            self.arena, np.random.default_rng(furniture), np.random.default_rng(owners["start"])
        )
        events: list[Event] = [] if self.scenario is None else [*self.scenario.events]
        if present is not None:
            events.insert(0, PutDown(0.0, present, where="the object's "))
        self._cast = cast = Cast(self.layout, events)
        self.sensors = Sensors(
            gains=np.exp(robot.normal(0, GAIN_SPREAD, 8)),
            mountings=robot.normal(0, _MOUNTING, 8),
            base=self.arena.base_square,
            diffuse=self.arena.base.diffuse if self.arena.base is not None else 0.0,
            room_light=self.arena.room_light,
        )
        left, right = robot.normal(0, _WHEEL_BIAS, 2).tolist()
        self._wheels = Wheels((left, right), np.random.default_rng(slip), STEP)
        self._rolled = self._wheels.travel
        if compression is None:
            compression = 1.0 if self.scenario is None else self.scenario.compression
        self.battery = Battery(compression)
        self._turbine = False
        start = self.layout.start
        self._physics = Physics(cast.shapes, cast.movables, self.layout.base_walls, start, cast.absent)
        lamps = self.layout.lamps
        self._score = Score(start[:2], self.arena.base_square, (lamps[0].x, lamps[0].y) if lamps else None)
        for place in cast.movables:
            if place not in cast.absent:
                self._score.put(cast.shapes[place].name, cast.shapes[place].pose[:2])
        self._scanner = Scanner(self.sensors, cast.shapes, cast.movables, proximity, light)
        self._camera = Camera(
            cast.shapes,
            cast.movables,
            math.hypot(*self.arena.size),
            camera,
            np.random.default_rng(textures),
            STEP,
        )
        self._agenda = Agenda(cast.events)
        self._director = Director(
            cast,
            self._agenda,
            lamps,
            owners["scenario"],
            STEP,
            physics=self._physics,
            scanner=self._scanner,
            battery=self.battery,
            score=self._score,
        )
        self._steps = self._scan = 0
        self._director.step(0.0, 0, start, turbine=False)
        self._now = Moment(0, start, self._physics.movables(), self._director.lights)
        self._history = History(self._now)
        self._camera.take(self._now, start)

    def advance(self, now: float) -> None:
        """Step until ``now``: the last step ends at or before it."""
        self._scan = scan = max(self._scan, math.floor(now / _SCAN + 1e-6))
        target = scan // SCANS_A_STEP
        if self._steps < target:
            self._step_until(target)

    def _step_until(self, target: int) -> None:
        wheels, physics, director, camera = self._wheels.advance, self._physics, self._director, self._camera
        score, remember, battery = self._score.step, self._history.moments.append, self.battery
        moment = self._now
        came_from = moment.pose
        remembered = target - History.reach  # what is older nobody can ask for any more
        for step in range(self._steps + 1, target + 1):
            now = step * STEP
            left, right = wheels() if battery.charge > 0 else self._unpowered()
            pose = physics.advance(STEP, (left + right) / 2, (right - left) / WHEEL_BASE)
            if director.acts or now + 1e-9 >= director.next:
                director.step(now, step, pose, self._turbine)
            score(now, STEP, pose[:2], physics.touching > physics.meeting)
            looks = director.walking and step % _STEPS_A_LOOK == 0
            if step > remembered or looks or step >= camera.next:
                moment = Moment(step, pose, physics.movables(), director.lights)
                remember(moment)
                if step >= camera.next:
                    camera.take(moment, came_from)
                if looks:
                    self._look(moment, now)
            if step % _STEPS_A_RECKONING == 0:
                self._reckon()
            came_from = pose
        self._now = moment
        self._steps = target

    def _unpowered(self) -> tuple[float, float]:
        """An empty battery turns no wheel, and the encoders see it."""
        self._wheels.window = self._wheels.travel, self._wheels.travel
        return 0.0, 0.0

    def _reckon(self) -> None:
        """The battery's part since the last time."""
        (left, right), (was_left, was_right) = self._wheels.travel, self._rolled
        self._rolled = left, right
        rolled = abs(left - was_left) + abs(right - was_right)
        self.battery.step(_STEPS_A_RECKONING * STEP, rolled, self._score.inside)

    def _look(self, moment: Moment, now: float) -> None:
        for name in self._in_view(moment):
            self._score.saw(name, now, _STEPS_A_LOOK * STEP)

    def _in_view(self, moment: Moment) -> list[str]:
        """The movers that the camera sees, in the order in which they came."""
        places = {self._cast.movables[number]: name for name, number in self._director.walking.items()}
        seen = self._camera.sees(moment, places)
        return [name for place, name in places.items() if place in seen]

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
        """The eight values that stand now, 0..1023, in the order of command N."""
        return self._scanner.proximity(self._scan, self._history)

    def light(self) -> list[int]:
        """The eight values that stand now, 0..511, low is bright, in the order of command O."""
        return self._scanner.light(self._scan, self._history)

    def camera(self) -> list[int]:
        """The 64 grey levels (0..255) of the frame that the camera holds, the left edge first."""
        return self._camera.picture()

    def camera_light(self) -> int:
        """The light level by which the camera sets its exposure, 0..65535; more is darker."""
        return self._camera.light_level()

    def set_camera_period(self, seconds: float) -> None:
        """How long the camera holds a frame; 0: its own choice."""
        self._camera.set_period(seconds, self._steps)

    def set_turbine(self, on: bool) -> None:
        """The micro-turbine at the robot's front, on its general I/O turret."""
        self._turbine = self.battery.turbine = on

    def heard_alarm(self) -> None:
        """The watchman sounded its alarm now; for the score."""
        self._score.alarm(self._steps * STEP)

    def in_view(self) -> set[str]:
        """The movers that are in the camera's view now and walking (see :meth:`Score.figures`, movers_seen)."""
        return set(self._in_view(self._now))

    def due(self, *kinds: type[E]) -> list[E]:
        """Events of the scenario that concern others, each once when its moment has come: orders, link faults,
        resets (:class:`~khepera_hil.world.scenario.Order` and so on)."""
        return self._agenda.due(self._scan * _SCAN + 1e-9, *kinds)

    def next_due(self, *kinds: type[Event]) -> float | None:
        """When the next event of these kinds is due that nobody has taken yet, seconds since power-up."""
        return self._agenda.next(*kinds)

    def pose(self) -> Pose:
        """The robot's true pose: metres, and radians counter-clockwise from the x axis, not wrapped."""
        return _metres(self._now.pose)

    def shapes(self) -> list[dict[str, Any]]:
        """Everything there ever is at its starting pose, robot, lamps, flames and base too; JSON-able, metres.

        Each has name, kind, polygon (in its own frame) or radius, pose, height and movable. What is not on the
        floor lies beside the arena, to the west.
        """
        shapes: list[Shape] = []
        for place, shape in enumerate(self._cast.shapes):
            shapes.append(shape.at(self._cast.shelf[shape.name]) if place in self._cast.absent else shape)
        if (square := self.arena.base_square) is not None:
            left, low, right, high = square
            middle = ((left + right) / 2, (low + high) / 2, 0.0)
            shapes.append(box("base", "base", right - left, high - low, middle, 0.0))
        for lamp in self.layout.lamps:
            shapes.append(disc(lamp.name, "lamp", lamp.radius, (lamp.x, lamp.y, 0.0), lamp.height))
        for name, fire in self._cast.flames.items():
            shapes.append(disc(name, "flame", _FLAME, self._cast.shelf[name], fire.height))
        shapes.append(disc("robot", "robot", BODY_RADIUS, self.layout.start, _ROBOT_HEIGHT))
        return [shape.described() for shape in shapes]

    def poses(self) -> dict[str, Pose]:
        """Where the movable things are now, flames and the robot too: metres and radians, by name."""
        shelf = self._cast.shelf
        poses = {}
        for name, number in self._cast.numbers.items():
            place = self._now.places[number]
            poses[name] = _metres(shelf[name] if place is None else place)
        poses |= {name: _metres(place) for name, place in self._director.flames().items()}
        poses["robot"] = self.pose()
        return poses

    def score(self) -> dict[str, Any]:
        """The figures of :meth:`khepera_hil.world.score.Score.figures`."""
        things = [
            (name, place[:2])
            for name, number in self._cast.numbers.items()
            if (place := self._now.places[number]) is not None
        ]
        return self._score.figures(things, self.battery.used_mah)


def _started(arena: Arena, scenario: str, pose: tuple[float, float, float]) -> Arena:
    """The arena with another start."""
    width, depth = arena.size
    if not (pose[0] <= width and pose[1] <= depth):
        raise WorldError(f"scenario {scenario}: start.at_mm is not on the floor of {width:g} x {depth:g} mm")
    if (other := in_the_way(arena, pose)) is not None:
        raise WorldError(f"scenario {scenario}: start.at_mm has no room for the robot, since {other!r} is there")
    return replace(arena, start=Start(pose=pose))


def _metres(pose: Pose) -> Pose:
    x, y, theta = pose
    return x / 1000, y / 1000, theta
