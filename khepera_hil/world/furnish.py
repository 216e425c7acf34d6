"""From an arena and a seed to where everything stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from khepera_hil.errors import WorldError
from khepera_hil.world.arena import Arena, Scatter, arena_walls, base_walls
from khepera_hil.world.lights import Lamp
from khepera_hil.world.shapes import BODY_RADIUS, Pose, Shape, box, disc, gap

__all__ = ["Layout", "furnish"]

_CHOICES, _LAYOUTS, _TRIES, _STARTS = 2000, 60, 250, 20_000
_MORE_STARTS = 2000  # tries for each further robot


@dataclass(frozen=True)
class Layout:
    """Everything at its starting place: what stands on the floor, lamps, the base, the robot.

    The shapes that are named in ``shelved`` are not on the floor yet.
    """

    arena: Arena
    shapes: tuple[Shape, ...]
    shelved: frozenset[str]
    base_walls: frozenset[str]
    lamps: tuple[Lamp, ...]
    starts: tuple[Pose, ...]
    """Of each robot."""

    @property
    def start(self) -> Pose:
        """Of the first robot."""
        return self.starts[0]


def furnish(arena: Arena, things: np.random.Generator, starts: Sequence[np.random.Generator]) -> Layout:
    """Draw what the arena leaves open: furniture and lamps from ``things``, each robot's pose from its own of
    ``starts``.

    Raises :class:`~khepera_hil.errors.WorldError` when there is no room.
    """
    walls = arena_walls(arena)
    recess = base_walls(arena)
    lamps = tuple(
        Lamp(plan.name, *plan.at, float(things.uniform(*plan.height)), plan.intensity, plan.radius)
        for plan in arena.lamps
    )
    given = [*recess, *(thing for thing in arena.things if thing.name not in arena.shelved)]
    scattered = _scattered(arena, arena.scatter, given, things) if arena.scatter is not None else []
    shelved = [thing for thing in arena.things if thing.name in arena.shelved]
    standing = (*walls, *given, *scattered)
    return Layout(
        arena,
        (*standing, *shelved),
        arena.shelved,
        frozenset(wall.name for wall in recess),
        lamps,
        _starts(arena, list(standing), starts),
    )


def _base_area(arena: Arena) -> Shape | None:
    if (square := arena.base_square) is None:
        return None
    left, low, right, high = square
    return box("base", "base", right - left, high - low, ((left + right) / 2, (low + high) / 2, 0.0), 0.0)


def _scattered(arena: Arena, plan: Scatter, given: list[Shape], chance: np.random.Generator) -> list[Shape]:
    floor = arena.size[0] * arena.size[1]
    base = _base_area(arena)
    for _ in range(_LAYOUTS):
        for _ in range(_CHOICES):
            things = _choose(plan, chance)
            if plan.share[0] <= sum(thing.area for thing in things) / floor <= plan.share[1]:
                break
        else:
            raise WorldError(f"the arena {arena.name}: things of these sizes never cover the floor_share asked for")
        placed: list[Shape] = []
        for thing in sorted(things, key=lambda thing: -_reach(thing)):
            for _ in range(_TRIES):
                x, y = chance.uniform(0, arena.size[0]), chance.uniform(0, arena.size[1])
                there = thing.at((float(x), float(y), float(chance.uniform(-math.pi, math.pi))))
                if _fits(there, [*given, *placed], plan.gap, arena.size) and (
                    base is None or gap(there, base) >= plan.base_gap
                ):
                    placed.append(there)
                    break
            else:
                break
        if len(placed) == len(things):
            return sorted(placed, key=lambda thing: thing.name)
    raise WorldError(f"the arena {arena.name} is too full: its scattered things find no room; ask for less")


def _choose(plan: Scatter, chance: np.random.Generator) -> list[Shape]:
    """Things without a place. Heights and masses alternate, so that there are always some of each."""
    nowhere = (0.0, 0.0, 0.0)
    things = [
        box(
            f"wall {number + 1}",
            "fixed",
            plan.wall_length,
            plan.wall_thickness,
            nowhere,
            _nth(plan.heights, number),
        )
        for number in range(plan.walls)
    ]
    blocks = int(chance.integers(plan.blocks[0], plan.blocks[1] + 1))
    discs = int(chance.integers(plan.discs[0], plan.discs[1] + 1))
    for number in range(blocks + discs):
        height = _nth(plan.heights, number)
        # The masses take turns at half the pace, so that low ones come light and heavy, and high ones too.
        mass = _nth(plan.masses, number // len(plan.heights))
        if number < blocks:
            width, depth = chance.uniform(*plan.block_side, 2)
            name = f"block {number + 1}"
            things.append(box(name, "block", float(width), float(depth), nowhere, height, mass=mass))
        else:
            name, radius = f"disc {number - blocks + 1}", float(chance.uniform(*plan.disc_radius))
            things.append(disc(name, "disc", radius, nowhere, height, mass=mass))
    return [replace(thing, stripes=plan.stripes) for thing in things]


def _starts(arena: Arena, shapes: list[Shape], chances: Sequence[np.random.Generator]) -> tuple[Pose, ...]:
    """Those that are given first, so that what is drawn keeps away from them; then in the order of numbers."""
    given = {number: pose for number, pose in arena.starts if number <= len(chances)}
    if arena.start.pose is not None:
        given[1] = arena.start.pose
    robots = {number: disc("robot", "robot", BODY_RADIUS, pose, 29.0) for number, pose in given.items()}
    for number, chance in enumerate(chances, 1):
        if number not in robots:
            robots[number] = _drawn(arena, [*shapes, *robots.values()], chance, number)
    return tuple(robots[number].pose for number in range(1, len(chances) + 1))


def _drawn(arena: Arena, shapes: list[Shape], chance: np.random.Generator, number: int) -> Shape:
    base = _base_area(arena)
    inside = shapes[len(arena_walls(arena)) :]
    for _ in range(_STARTS if number == 1 else _MORE_STARTS):
        x, y = float(chance.uniform(0, arena.size[0])), float(chance.uniform(0, arena.size[1]))
        robot = disc("robot", "robot", BODY_RADIUS, (x, y, float(chance.uniform(-math.pi, math.pi))), 29.0)
        centre = disc("centre", "robot", 0.0, robot.pose, 0.0)
        if _fits(robot, inside, arena.start.clearance, arena.size) and (
            base is None or gap(centre, base) >= arena.start.from_base
        ):
            return robot
    if number > 1:
        raise WorldError(f"the arena {arena.name} has no room for robot {number}; ask for fewer, or less clearance")
    raise WorldError(f"the arena {arena.name} has no place where the robot could start; ask for less clearance")


def _fits(shape: Shape, others: list[Shape], clearance: float, size: tuple[float, float]) -> bool:
    """Whether it is this far from everything and from the edges of the floor."""
    reach, (x, y, _) = _reach(shape), shape.pose
    across, up = shape.points().T
    least = clearance + shape.radius
    if across.min() < least or up.min() < least or across.max() > size[0] - least or up.max() > size[1] - least:
        return False
    for other in others:
        far = math.hypot(other.pose[0] - x, other.pose[1] - y)
        if far < reach + _reach(other) + clearance and gap(shape, other) < clearance:
            return False
    return True


def _reach(shape: Shape) -> float:
    return max((math.hypot(*corner) for corner in shape.corners), default=shape.radius)


def _nth(values: tuple[float, ...], number: int) -> float:
    return values[number % len(values)]
