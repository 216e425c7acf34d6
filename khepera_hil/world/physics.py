"""Bodies that push each other on a floor, on pymunk in mm, g and s.

The robot's drive and the floor's friction are joints with a limited force, never speeds that are set: so a
light block moves, a heavy one does not, and nothing is pressed into anything.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
import pymunk

from khepera_hil.world.shapes import BODY_RADIUS, Pose, Shape, turned

__all__ = ["Physics"]

_GRAVITY = 9810.0  # mm/s2
_ROBOT_MASS = 80.0  # g (paper, section 4.1)
_GRIP = 0.8 * 0.7 * _ROBOT_MASS * _GRAVITY
"""g mm/s2: the tyres' friction coefficient on the share of the weight that stands on them (proposed); 0.44 N."""
_GRIP_ARM = 26.5  # mm, half the wheel base
_MOVER_GRIP = 0.5  # of a mover's weight (proposed): it does not push harder
# Chipmunk multiplies the two shapes' values: contacts have friction 0.4 and elasticity 0.05 (proposed).
_CONTACT_FRICTION = math.sqrt(0.4)
_CONTACT_ELASTICITY = math.sqrt(0.05)

_FAR = 400.0  # mm, as far as the robot looks for things
_MARGIN = 12.0  # mm between the robot and things within which the engine does the work: two steps at 1 m/s
_STEPS_TO_LOOK = 8
LONGEST_WAY = 0.25
"""mm that the robot goes between two looks of the engine at what touches what: a fast robot's steps are divided,
since what it enters within one of them it has already sunk into."""

ROBOT, _COUNTED, _BASE, _MOVER = 1, 2, 3, 4


class Physics:
    """The robot among ``shapes``; ``base_walls`` are named apart.

    ``movables`` are places among the shapes; those of them that are in ``absent`` are not on the floor yet.

    :attr:`touching` says with how many things the robot is in contact, the base's walls left out, and
    :attr:`meeting` how many of them are movers.
    """

    def __init__(
        self,
        shapes: Sequence[Shape],
        movables: Sequence[int],
        base_walls: frozenset[str],
        start: Pose,
        absent: Collection[int] = (),
    ) -> None:
        self._space = space = pymunk.Space()
        self.touching = self.meeting = 0
        # What lies still for long costs nothing; the robot never sleeps, its joint to a kinematic body keeps it up.
        space.sleep_time_threshold, space.idle_speed_threshold = 0.2, 0.01
        space.on_collision(ROBOT, _COUNTED, begin=self._touch, separate=self._part)
        space.on_collision(ROBOT, _MOVER, begin=self._meet, separate=self._leave)
        for shape in shapes:
            if not shape.movable:
                for solid in self._outlines(shape, space.static_body):
                    solid.collision_type = _BASE if shape.name in base_walls else _COUNTED
                    space.add(solid)
        self._robot, self._wanted = self._drive(start, 1)
        self._others = pymunk.ShapeFilter(group=1)
        self.coasts = True
        """Whether the engine is spared while the robot has nothing near; the result is the same."""
        self._pose = start
        self._velocity: tuple[float, float] = (0.0, 0.0)
        self._turn = 0.0
        self._room = 0.0
        self._coasting = False
        self._still = False  # whether nothing but the robot moves, and it touches nothing
        self._steps_to_look = _STEPS_TO_LOOK
        self._bodies = {number: _Body(shapes[place]) for number, place in enumerate(movables)}
        for body in self._bodies.values():
            self._furnish(body)
        self._present: dict[int, _Body] = {}
        for number, place in enumerate(movables):
            if place not in absent:
                self.put(number, shapes[place].pose)
        self._places = self._looked()

    def _drive(self, start: Pose, group: int) -> tuple[pymunk.Body, pymunk.Body]:
        """A robot on the floor, of a group of its own, and the body that moves as its wheels want."""
        robot = pymunk.Body(_ROBOT_MASS, 0.5 * _ROBOT_MASS * BODY_RADIUS**2)
        robot.position, robot.angle = start[:2], start[2]
        circle = pymunk.Circle(robot, BODY_RADIUS)
        circle.friction, circle.elasticity = _CONTACT_FRICTION, _CONTACT_ELASTICITY
        circle.collision_type = ROBOT
        circle.filter = pymunk.ShapeFilter(group=group)
        self._space.add(robot, circle)
        # What the wheels want is the motion of a body without mass or shape; the joints to it slip when
        # they would need more force than the tyres have.
        wanted = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        self._space.add(*self._hold(wanted, robot, _GRIP, _GRIP * _GRIP_ARM))
        return robot, wanted

    def _furnish(self, thing: _Body) -> None:
        """Give a movable thing its body: outline, weight, and what it rubs on or is driven by."""
        shape = thing.shape
        if shape.corners:
            areas = [abs(pymunk.area_for_poly(part)) for part in shape.convex]
            moment = sum(
                pymunk.moment_for_poly(shape.mass * area / sum(areas), list(part))
                for part, area in zip(shape.convex, areas, strict=True)
            )
        else:
            moment = pymunk.moment_for_circle(shape.mass, 0, shape.radius)
        thing.body = body = pymunk.Body(shape.mass, moment)
        thing.solids = self._outlines(shape, body)
        for solid in thing.solids:
            solid.collision_type = _MOVER if shape.kind == "mover" else _COUNTED
        if shape.kind == "mover":
            thing.drive = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
            grip = _MOVER_GRIP * shape.mass * _GRAVITY
            thing.joints = self._hold(thing.drive, body, grip, grip * shape.radius)
        else:
            friction = shape.floor_friction * shape.mass * _GRAVITY
            arm = 2 / 3 * math.sqrt(shape.area / math.pi)
            thing.joints = self._hold(self._space.static_body, body, friction, friction * arm)

    def is_free(self, number: int, pose: Pose) -> bool:
        """Whether movable thing ``number`` would touch nothing at ``pose``."""
        self._leave_coasting()
        thing = self._bodies[number]
        thing.body.position, thing.body.angle = pose[:2], pose[2]
        return not any(self._space.shape_query(solid) for solid in thing.solids)

    def put(self, number: int, pose: Pose) -> None:
        """Put a movable thing that is not there on the floor, at rest."""
        self._leave_coasting()
        thing = self._bodies[number]
        thing.body.position, thing.body.angle = pose[:2], pose[2]
        thing.body.velocity, thing.body.angular_velocity = (0, 0), 0
        self._space.add(thing.body, *thing.solids, *thing.joints)
        self._present[number] = thing

    def take(self, number: int) -> None:
        """Take a movable thing that is there from the floor."""
        self._leave_coasting()
        thing = self._present.pop(number)
        self._space.remove(*thing.joints, *thing.solids, thing.body)

    def steer(self, number: int, velocity: tuple[float, float]) -> None:
        """What a mover wants from now on, mm/s; whether it gets there is another matter."""
        thing = self._bodies[number]
        if thing.drive is not None and thing.wants != velocity:
            thing.drive.velocity = thing.wants = velocity

    def _hold(self, one: pymunk.Body, other: pymunk.Body, force: float, torque: float) -> list[pymunk.Constraint]:
        """Ties between two bodies' velocities (not their places) with limited force: top-down friction."""
        pivot = pymunk.PivotJoint(one, other, (0, 0), (0, 0))
        gear = pymunk.GearJoint(one, other, 0, 1)
        pivot.max_bias = gear.max_bias = 0
        pivot.max_force, gear.max_force = force, torque
        return [pivot, gear]

    def _outlines(self, shape: Shape, body: pymunk.Body) -> list[pymunk.Shape]:
        solids: list[pymunk.Shape]
        if not shape.corners:
            solids = [pymunk.Circle(body, shape.radius, (0, 0) if shape.movable else shape.pose[:2])]
        elif shape.movable:
            solids = [pymunk.Poly(body, part) for part in shape.convex]
        else:
            placed = [turned(np.array(part), shape.pose) for part in shape.convex]
            solids = [pymunk.Poly(body, [tuple(point) for point in part.tolist()]) for part in placed]
        for solid in solids:
            solid.friction, solid.elasticity = _CONTACT_FRICTION, _CONTACT_ELASTICITY
        return solids

    def advance(self, step: float, ahead: float, turn: float) -> Pose:
        """One step of ``step`` seconds while the wheels want ``ahead`` mm/s and ``turn`` rad/s."""
        x, y, theta = self._pose
        middle = theta + turn * step / 2
        velocity_x, velocity_y = velocity = ahead * math.cos(middle), ahead * math.sin(middle)
        parts = 1 + int(abs(ahead) * step / LONGEST_WAY)
        if self._room > 0:
            # As the engine does it: the place by the speed of the part before, then the speed.
            old = step / parts
            new = step - old
            self._pose = (
                x + self._velocity[0] * old + velocity_x * new,
                y + self._velocity[1] * old + velocity_y * new,
                theta + self._turn * old + turn * new,
            )
            self._velocity, self._turn = velocity, turn
            self._room -= abs(ahead) * step
            if self._room <= 0:
                self._look_around()
            return self._pose
        self._wanted.velocity = velocity
        self._wanted.angular_velocity = turn
        for _ in range(parts):
            self._space.step(step / parts)
        (x, y), theta = self._robot.position, self._robot.angle
        self._pose = x, y, theta
        self._steps_to_look -= 1
        if self._steps_to_look == 0:
            self._velocity, self._turn = self._robot.velocity, self._robot.angular_velocity
            self._look_around()
        return self._pose

    def _look_around(self) -> None:
        """How far the robot can go before it may touch anything while nothing else moves.

        As long as it has room its drive has no load but its own mass, less than its grip, and the engine
        would give exactly what the wheels want; so it is not asked, which is most of an emulator's time.
        """
        self._steps_to_look = _STEPS_TO_LOOK
        was_coasting, self._room = self._coasting, 0.0
        self._coasting = False
        self._still = not self.touching and all(thing.body.is_sleeping for thing in self._present.values())
        if self._still:
            self._places = self._looked()
            near = self._space.point_query_nearest(self._pose[:2], _FAR, self._others) if self.coasts else None
            room = (_FAR if near is None else near.distance) - BODY_RADIUS - _MARGIN
            if self.coasts and room > 0:
                self._room, self._coasting = room, True
                return
        if was_coasting:
            self._take_over()

    def _leave_coasting(self) -> None:
        """Let the engine go on from where the robot is: something is about to change."""
        if self._coasting:
            self._coasting, self._room = False, 0.0
            self._take_over()
        self._still = False

    def _take_over(self) -> None:
        self._robot.position, self._robot.angle = self._pose[:2], self._pose[2]
        self._robot.velocity, self._robot.angular_velocity = self._velocity, self._turn

    def movables(self) -> list[Pose | None]:
        """Where the movable shapes are, in their order (None: not on the floor); the same list while none moves."""
        if not self._still:
            places = self._looked()
            if places != self._places:
                self._places = places
        return self._places

    def place(self, number: int) -> Pose | None:
        """Where one of them is: quicker than :meth:`movables` while something moves."""
        if self._still:
            return self._places[number]
        thing = self._present.get(number)
        return None if thing is None else (*thing.body.position, thing.body.angle)

    def _looked(self) -> list[Pose | None]:
        return [
            (*thing.body.position, thing.body.angle) if number in self._present else None
            for number, thing in self._bodies.items()
        ]

    def _touch(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        self.touching += 1
        self._still = False

    def _part(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        self.touching -= 1

    def _meet(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        self.meeting += 1
        self._touch(arbiter, space, data)

    def _leave(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        self.meeting -= 1
        self._part(arbiter, space, data)


class _Body:
    """A movable thing in the engine."""

    def __init__(self, shape: Shape) -> None:
        self.shape = shape
        self.body: pymunk.Body
        self.drive: pymunk.Body | None = None
        self.wants = (0.0, 0.0)
        """The drive's velocity."""
        self.solids: list[pymunk.Shape]
        self.joints: list[pymunk.Constraint]
