"""Bodies that push each other on a floor, on pymunk in mm, g and s.

The robot's drive and the floor's friction are joints with a limited force, never speeds that are set: so a
light block moves, a heavy one does not, and nothing is pressed into anything.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pymunk

from khepera_hil.world.sensors import BODY_RADIUS
from khepera_hil.world.shapes import Pose, Shape, turned

__all__ = ["Physics"]

_GRAVITY = 9810.0  # mm/s2
_ROBOT_MASS = 80.0  # g (paper, section 4.1)
_GRIP = 0.8 * 0.7 * _ROBOT_MASS * _GRAVITY
"""g mm/s2: the tyres' friction coefficient on the share of the weight that stands on them (proposed); 0.44 N."""
_GRIP_ARM = 26.5  # mm, half the wheel base
# Chipmunk multiplies the two shapes' values: contacts have friction 0.4 and elasticity 0.05 (proposed).
_CONTACT_FRICTION = math.sqrt(0.4)
_CONTACT_ELASTICITY = math.sqrt(0.05)

_FAR = 400.0  # mm, as far as the robot looks for things
_MARGIN = 12.0  # mm between the robot and things within which the engine does the work: two steps at 1 m/s
_STEPS_TO_LOOK = 8
_LONGEST_WAY = 0.25
"""mm that the robot goes between two looks of the engine at what touches what: a fast robot's steps are divided,
since what it enters within one of them it has already sunk into."""

_ROBOT, _COUNTED, _BASE = 1, 2, 3


class Physics:
    """The robot among ``shapes``, those of kind lamp and base left out; ``base_walls`` are named apart.

    :attr:`touching` says with how many things the robot is in contact, the base's walls left out.
    """

    def __init__(self, shapes: Sequence[Shape], base_walls: frozenset[str], start: Pose) -> None:
        self._space = space = pymunk.Space()
        self.touching = 0
        # What lies still for long costs nothing; the robot never sleeps, its joint to a kinematic body keeps it up.
        space.sleep_time_threshold, space.idle_speed_threshold = 0.2, 0.01
        space.on_collision(_ROBOT, _COUNTED, begin=self._touch, separate=self._part)
        self._bodies: list[pymunk.Body] = []
        for shape in shapes:
            body = self._add_body(shape) if shape.movable else space.static_body
            for solid in self._outlines(shape, body):
                solid.collision_type = _BASE if shape.name in base_walls else _COUNTED
                space.add(solid)
        self._robot = pymunk.Body(_ROBOT_MASS, 0.5 * _ROBOT_MASS * BODY_RADIUS**2)
        self._robot.position, self._robot.angle = start[:2], start[2]
        circle = pymunk.Circle(self._robot, BODY_RADIUS)
        circle.friction, circle.elasticity = _CONTACT_FRICTION, _CONTACT_ELASTICITY
        circle.collision_type = _ROBOT
        circle.filter = pymunk.ShapeFilter(group=1)
        self._others = pymunk.ShapeFilter(group=1)
        space.add(self._robot, circle)
        # What the wheels want is the motion of a body without mass or shape; the joints to it slip when
        # they would need more force than the tyres have.
        self._wanted = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        self._hold(self._wanted, self._robot, _GRIP, _GRIP * _GRIP_ARM)
        self.coasts = True
        """Whether the engine is spared while the robot has nothing near; the result is the same."""
        self._pose = start
        self._velocity: tuple[float, float] = (0.0, 0.0)
        self._turn = 0.0
        self._room = 0.0
        self._free = False
        self._places: list[Pose] = []
        self._steps_to_look = _STEPS_TO_LOOK

    def _add_body(self, shape: Shape) -> pymunk.Body:
        if shape.corners:
            area = sum(abs(pymunk.area_for_poly(part)) for part in shape.convex)
            moment = sum(
                pymunk.moment_for_poly(shape.mass * abs(pymunk.area_for_poly(part)) / area, list(part))
                for part in shape.convex
            )
        else:
            moment = pymunk.moment_for_circle(shape.mass, 0, shape.radius)
        body = pymunk.Body(shape.mass, moment)
        body.position, body.angle = shape.pose[:2], shape.pose[2]
        self._space.add(body)
        self._bodies.append(body)
        friction = shape.floor_friction * shape.mass * _GRAVITY
        self._hold(self._space.static_body, body, friction, friction * 2 / 3 * math.sqrt(shape.area / math.pi))
        return body

    def _hold(self, one: pymunk.Body, other: pymunk.Body, force: float, torque: float) -> None:
        """Tie two bodies' velocities (not their places) with limited force: top-down friction."""
        pivot = pymunk.PivotJoint(one, other, (0, 0), (0, 0))
        gear = pymunk.GearJoint(one, other, 0, 1)
        pivot.max_bias = gear.max_bias = 0
        pivot.max_force, gear.max_force = force, torque
        self._space.add(pivot, gear)

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
        parts = 1 + int(abs(ahead) * step / _LONGEST_WAY)
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
        was_free, self._room = self._free, 0.0
        self._free = False
        if self.coasts and not self.touching and all(body.is_sleeping for body in self._bodies):
            near = self._space.point_query_nearest(self._pose[:2], _FAR, self._others)
            room = (_FAR if near is None else near.distance) - BODY_RADIUS - _MARGIN
            if room > 0:
                self.movables()  # as they are now they stay
                self._room, self._free = room, True
                return
        if was_free:
            self._robot.position, self._robot.angle = self._pose[:2], self._pose[2]
            self._robot.velocity, self._robot.angular_velocity = self._velocity, self._turn

    def movables(self) -> list[Pose]:
        """Where the movable shapes are, in the order in which they came."""
        if not self._free:
            self._places = [(*body.position, body.angle) for body in self._bodies]
        return self._places

    def _touch(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        self.touching += 1

    def _part(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        self.touching -= 1
