"""The world behind the emulator: physics at a fixed step, sensors on their own schedule, a scenario, a score.

Inside mm, grams, seconds and radians; what leaves through :meth:`World.pose`, :meth:`World.shapes`,
:meth:`World.poses` and :meth:`World.score` is in metres. Time is simulated: seconds since power-up, moved
only by :meth:`World.advance`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from khepera_hil.chance import streams
from khepera_hil.errors import WorldError
from khepera_hil.motion import Motion
from khepera_hil.world.arena import Arena, Start, check_starts, in_the_way, load_arena
from khepera_hil.world.battery import Battery
from khepera_hil.world.cast import Cast, Director
from khepera_hil.world.crowd import Crowd
from khepera_hil.world.furnish import Layout, furnish
from khepera_hil.world.history import SCAN, SCANS_A_STEP, STEP, History, Moment, Time
from khepera_hil.world.physics import Physics
from khepera_hil.world.robot import STEPS_A_RECKONING, Peculiar, Robot, name_of, robot_shape
from khepera_hil.world.scenario import Event, PutDown, Scenario, load_scenario
from khepera_hil.world.sensors import Sensors
from khepera_hil.world.shapes import Pose, Shape, box, disc
from khepera_hil.world.things import MOST_ROBOTS
from khepera_hil.world.wheels import WHEEL_BASE

__all__ = ["STEP", "World"]

E = TypeVar("E", bound=Event)

_STEPS_A_LOOK = 10  # whether a mover is in view, every 50 ms
_GOES = 0.1  # mm from one look to the next by which another robot counts as a mover

_FLAME = 5.0  # mm: the radius with which a bulb is drawn


class World:
    """Robots in an arena, mostly one, and what a scenario brings there.

    ``seed`` chooses the robots' peculiarities, their starts, the furniture and all noise; the first of ``robots``
    is the same whether or not there are others. ``individual`` is the seed of their peculiarities alone (None:
    ``seed``): the same robots at another time. ``arena`` and ``scenario`` are such things, or what
    :func:`~khepera_hil.world.arena.load_arena` and :func:`~khepera_hil.world.scenario.load_scenario` take.
    ``compression`` makes the batteries so many times faster (None: as the scenario says, 1 without one).
    ``present`` names a thing from the arena's shelf that stands on its stage from the start. Raises
    :class:`~khepera_hil.errors.WorldError`.

    What a robot reads, does and was worth is asked of :attr:`robots`; the world's own methods of these names are
    the first robot's.
    """

    def __init__(
        self,
        arena: Arena | str = "furnished",
        seed: int = 0,
        scenario: Scenario | str | None = None,
        *,
        compression: float | None = None,
        present: str | None = None,
        robots: int = 1,
        individual: int | None = None,
    ) -> None:
        if not 1 <= robots <= MOST_ROBOTS:
            raise WorldError(f"an arena takes from 1 to {MOST_ROBOTS} robots, not {robots}")
        self.arena = load_arena(arena) if isinstance(arena, str) else arena
        self.scenario = load_scenario(scenario) if isinstance(scenario, str) else scenario
        if self.scenario is not None:
            self.arena = _started(self.arena, self.scenario)
        owners = [streams(seed, number) for number in range(1, robots + 1)]
        bodily = seed if individual is None else individual
        peculiarities = [streams(bodily, number)["robot"] for number in range(1, robots + 1)]
        chances = [owner["world"].spawn(6) for owner in owners]
        furniture, textures = chances[0][0], chances[0][5]
        self.layout: Layout = furnish(
            self.arena,
            np.random.default_rng(furniture),
            [np.random.default_rng(owner["start"]) for owner in owners],
        )
        events: list[Event] = [] if self.scenario is None else [*self.scenario.events]
        if present is not None:
            events.insert(0, PutDown(0.0, present, where="the object's "))
        self._cast = cast = Cast(self.layout, events)
        if compression is None:
            compression = 1.0 if self.scenario is None else self.scenario.compression
        starts, lamps = self.layout.starts, self.layout.lamps
        company = robots > 1
        bodies = [robot_shape(name_of(number + 1), pose, seen=company) for number, pose in enumerate(starts)]
        self._bodies = bodies
        self._time = Time()
        # Every robot's scenes hold all robots; itself is never at its place in them.
        shapes = (*cast.shapes, *bodies) if company else cast.shapes
        movables = [*cast.movables, *range(len(cast.shapes), len(shapes))]
        self.robots = tuple(
            Robot(
                number + 1,
                starts[number],
                Peculiar(peculiarities[number], *chances[number][1:5]),
                textures,
                arena=self.arena,
                shapes=shapes,
                movables=movables,
                lamp=(lamps[0].x, lamps[0].y) if lamps else None,
                company=company,
                events=cast.events,
                compression=compression,
                time=self._time,
            )
            for number in range(robots)
        )
        self._robot = self.robots[0]
        things = cast.shapes, cast.movables, self.layout.base_walls
        self._crowd = Crowd(*things, starts, cast.absent) if company else None
        self._physics = self._crowd or Physics(*things, starts[0], cast.absent)
        for place in cast.movables:
            if place not in cast.absent:
                for robot in self.robots:
                    robot.score.put(cast.shapes[place].name, cast.shapes[place].pose[:2])
        self._director = Director(
            cast, lamps, owners[0]["scenario"], STEP, physics=self._physics, robots=self.robots
        )
        self._director.step(0.0, 0, starts)
        for robot, pose in zip(self.robots, starts, strict=True):
            robot.begin(Moment(0, pose, self._places(robot, starts), self._director.lights))
        self._seen_at: Sequence[Pose] = starts
        self._went: list[bool] = [False] * robots

    def advance(self, now: float) -> None:
        """Step until ``now``: the last step ends at or before it."""
        time = self._time
        time.scan = scan = max(time.scan, math.floor(now / SCAN + 1e-6))
        target = scan // SCANS_A_STEP
        if time.step < target:
            if self._crowd is None:
                self._step_until(target)
            else:
                self._step_all(target, self._crowd)

    def _step_until(self, target: int) -> None:
        robot = self._robot
        wheels, physics, director, camera = robot.wheels.advance, self._physics, self._director, robot.eye
        score, remember, battery = robot.score.step, robot.history.moments.append, robot.battery
        moment = robot.now
        came_from = moment.pose
        remembered = target - History.reach  # what is older nobody can ask for any more
        for step in range(self._time.step + 1, target + 1):
            now = step * STEP
            left, right = wheels() if battery.charge > 0 else robot.roll()
            pose = physics.advance(STEP, (left + right) / 2, (right - left) / WHEEL_BASE)
            if director.acts or now + 1e-9 >= director.next:
                director.step(now, step, (pose,))
            score(now, STEP, pose[:2], physics.touching > physics.meeting)
            looks = director.walking and step % _STEPS_A_LOOK == 0
            if step > remembered or looks or step >= camera.next:
                moment = Moment(step, pose, physics.movables(), director.lights)
                remember(moment)
                if step >= camera.next:
                    camera.take(moment, came_from)
                if looks:
                    self._look(robot, moment, now)
            if step % STEPS_A_RECKONING == 0:
                robot.reckon()
            came_from = pose
        robot.now = moment
        self._time.step = target

    def _step_all(self, target: int, crowd: Crowd) -> None:
        """:meth:`_step_until` for several robots."""
        director, robots = self._director, self.robots
        came_from = [robot.now.pose for robot in robots]
        remembered = target - History.reach
        for step in range(self._time.step + 1, target + 1):
            now = step * STEP
            rolling = [robot.roll() for robot in robots]
            poses = crowd.advance_all(
                STEP, [((left + right) / 2, (right - left) / WHEEL_BASE) for left, right in rolling]
            )
            if director.acts or now + 1e-9 >= director.next:
                director.step(now, step, poses)
            looks = step % _STEPS_A_LOOK == 0
            if looks:
                self._went = [math.dist(a[:2], b[:2]) > _GOES for a, b in zip(poses, self._seen_at, strict=True)]
                self._seen_at = poses
            for robot, pose, before, contact in zip(robots, poses, came_from, crowd.contacts, strict=True):
                robot.score.step(now, STEP, pose[:2], contact.touching > contact.meeting)
                if contact.robots:
                    robot.score.met(now, STEP)
                if step > remembered or looks or step >= robot.eye.next:
                    robot.now = moment = Moment(step, pose, self._places(robot, poses), director.lights)
                    robot.history.moments.append(moment)
                    if step >= robot.eye.next:
                        robot.eye.take(moment, before)
                    if looks:
                        self._look(robot, moment, now)
                if step % STEPS_A_RECKONING == 0:
                    robot.reckon()
            came_from = poses
        self._time.step = target

    def _places(self, robot: Robot, poses: Sequence[Pose]) -> list[Pose | None]:
        """Where all is that moves and ``robot`` may see."""
        places = self._physics.movables()
        if self._crowd is None:
            return places
        return [*places, *(None if number == robot.number else pose for number, pose in enumerate(poses, 1))]

    def _look(self, robot: Robot, moment: Moment, now: float) -> None:
        for name in self._movers_seen(robot, moment):
            robot.score.saw(name, now, _STEPS_A_LOOK * STEP)

    def _movers_seen(self, robot: Robot, moment: Moment) -> list[str]:
        """The movers that a robot sees, in the order in which they came; then the other robots that go."""
        places = {self._cast.movables[number]: name for name, number in self._director.walking.items()}
        things = len(self._cast.shapes)
        for place, went in enumerate(self._went):
            if went and place != robot.number - 1:
                places[things + place] = name_of(place + 1, robot.number)
        seen = robot.eye.sees(moment, places)
        return [name for place, name in places.items() if place in seen]

    def in_view(self, robot: int = 1) -> set[str]:
        """The movers that are in a robot's view now and walking (see :meth:`Score.figures`, movers_seen)."""
        one = self.robots[robot - 1]
        return set(self._movers_seen(one, one.now))

    def shapes(self, robot: int = 1) -> list[dict[str, Any]]:
        """Everything there ever is at its starting pose, robots, lamps, flames and base too; JSON-able, metres.

        Each has name, kind, polygon (in its own frame) or radius, pose, height and movable. What is not on the
        floor lies beside the arena, to the west. ``robot`` is the number of the one that is called "robot"; others
        are "robot 2" and so on.
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
            if name not in self._cast.numbers:  # a bulb has no candle
                shapes.append(disc(name, "flame", _FLAME, self._cast.shelf[name], fire.height))
        shapes += [replace(body, name=name_of(number, robot)) for number, body in enumerate(self._bodies, 1)]
        return [shape.described() for shape in shapes]

    def poses(self, robot: int = 1) -> dict[str, Pose]:
        """Where the movable things are now, flames and the robots too: metres and radians, by name (see
        :meth:`shapes`)."""
        shelf, places = self._cast.shelf, self._robot.now.places
        poses = {}
        for name, number in self._cast.numbers.items():
            place = places[number]
            poses[name] = _metres(shelf[name] if place is None else place)
        poses |= {name: _metres(place) for name, place in self._director.flames().items()}
        poses |= {name_of(one.number, robot): one.pose() for one in self.robots}
        return poses

    def score(self, robot: int = 1) -> dict[str, Any]:
        """The figures of :meth:`khepera_hil.world.score.Score.figures`."""
        one = self.robots[robot - 1]
        things = [
            (name, place[:2])
            for name, number in self._cast.numbers.items()
            if (place := one.now.places[number]) is not None
        ]
        return one.score.figures(things, one.battery.used_mah)

    # The first robot's.

    @property
    def sensors(self) -> Sensors:
        """See :class:`Robot`."""
        return self._robot.sensors

    @property
    def battery(self) -> Battery:
        """See :class:`Robot`."""
        return self._robot.battery

    @property
    def motion(self) -> Motion:
        """See :attr:`Robot.motion`."""
        return self._robot.motion

    def set_speed(self, left: float, right: float) -> None:
        """See :meth:`Robot.set_speed`."""
        self._robot.set_speed(left, right)

    def wheel_travel(self) -> tuple[float, float]:
        """See :meth:`Robot.wheel_travel`."""
        return self._robot.wheel_travel()

    def wheel_window(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """See :meth:`Robot.wheel_window`."""
        return self._robot.wheel_window()

    def proximity(self) -> list[int]:
        """See :meth:`Robot.proximity`."""
        return self._robot.proximity()

    def light(self) -> list[int]:
        """See :meth:`Robot.light`."""
        return self._robot.light()

    def camera(self) -> list[int]:
        """See :meth:`Robot.camera`."""
        return self._robot.camera()

    def camera_light(self) -> int:
        """See :meth:`Robot.camera_light`."""
        return self._robot.camera_light()

    def set_camera_period(self, seconds: float) -> None:
        """See :meth:`Robot.set_camera_period`."""
        self._robot.set_camera_period(seconds)

    def set_turbine(self, on: bool) -> None:
        """See :meth:`Robot.set_turbine`."""
        self._robot.set_turbine(on)

    def heard_alarm(self) -> None:
        """See :meth:`Robot.heard_alarm`."""
        self._robot.heard_alarm()

    def due(self, *kinds: type[E]) -> list[E]:
        """See :meth:`Robot.due`."""
        return self._robot.due(*kinds)

    def next_due(self, *kinds: type[Event]) -> float | None:
        """See :meth:`Robot.next_due`."""
        return self._robot.next_due(*kinds)

    def pose(self) -> Pose:
        """See :meth:`Robot.pose`."""
        return self._robot.pose()


def _started(arena: Arena, scenario: Scenario) -> Arena:
    """The arena with the starts that the scenario has."""
    width, depth = arena.size
    if (pose := scenario.start) is not None:
        where = f"scenario {scenario.name}: start.at_mm"
        if not (pose[0] <= width and pose[1] <= depth):
            raise WorldError(f"{where} is not on the floor of {width:g} x {depth:g} mm")
        if (other := in_the_way(arena, pose)) is not None:
            raise WorldError(f"{where} has no room for the robot, since {other!r} is there")
        arena = replace(arena, start=Start(pose=pose))
    arena = replace(arena, starts=tuple(sorted({**dict(arena.starts), **dict(scenario.starts)}.items())))
    check_starts(arena, f"scenario {scenario.name}: ")
    return arena


def _metres(pose: Pose) -> Pose:
    x, y, theta = pose
    return x / 1000, y / 1000, theta
