"""Several robots among what stands on one floor: each with a drive of its own, and all in each other's way."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import pymunk

from khepera_hil.world.physics import LONGEST_WAY, ROBOT, Physics
from khepera_hil.world.shapes import Pose, Shape

__all__ = ["Contact", "Crowd"]


class Contact:
    """How many things, movers among them, and how many other robots a robot touches."""

    __slots__ = ("meeting", "robots", "touching")

    def __init__(self) -> None:
        self.touching = self.meeting = self.robots = 0


class Crowd(Physics):
    """The robots at ``starts`` among ``shapes``; the rest as in :class:`~khepera_hil.world.physics.Physics`.

    The engine is never spared: when one robot has nothing near, another has.
    """

    def __init__(
        self,
        shapes: Sequence[Shape],
        movables: Sequence[int],
        base_walls: frozenset[str],
        starts: Sequence[Pose],
        absent: Collection[int] = (),
    ) -> None:
        self.contacts = [Contact() for _ in starts]
        super().__init__(shapes, movables, base_walls, starts[0], absent)
        self.coasts = False
        others = [self._drive(start, 2 + place) for place, start in enumerate(starts[1:])]
        self._drives = [(self._robot, self._wanted), *others]
        self._numbers = {body: number for number, (body, _) in enumerate(self._drives)}
        self._space.on_collision(ROBOT, ROBOT, begin=self._bump, separate=self._bumped)

    def advance_all(self, step: float, wants: Sequence[tuple[float, float]]) -> list[Pose]:
        """One step of ``step`` seconds while each robot's wheels want so many mm/s ahead and rad/s of turn."""
        fastest = sorted(abs(ahead) for ahead, _ in wants)
        # Two may go towards each other.
        parts = 1 + int(sum(fastest[-2:]) * step / LONGEST_WAY)
        for (robot, wanted), (ahead, turn) in zip(self._drives, wants, strict=True):
            middle = robot.angle + turn * step / 2
            wanted.velocity = pymunk.Vec2d(ahead, 0).rotated(middle)
            wanted.angular_velocity = turn
        for _ in range(parts):
            self._space.step(step / parts)
        return self.robots()

    def robots(self) -> list[Pose]:
        """Where the robots are."""
        return [(*robot.position, robot.angle) for robot, _ in self._drives]

    def _of(self, arbiter: pymunk.Arbiter) -> list[Contact]:
        found = (self._numbers.get(shape.body) for shape in arbiter.shapes if shape.body is not None)
        return [self.contacts[number] for number in found if number is not None]

    def _touch(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        for contact in self._of(arbiter):
            contact.touching += 1

    def _part(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        for contact in self._of(arbiter):
            contact.touching -= 1

    def _meet(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        for contact in self._of(arbiter):
            contact.meeting += 1
            contact.touching += 1

    def _leave(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        for contact in self._of(arbiter):
            contact.meeting -= 1
            contact.touching -= 1

    def _bump(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        for contact in self._of(arbiter):
            contact.robots += 1

    def _bumped(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        for contact in self._of(arbiter):
            contact.robots -= 1
