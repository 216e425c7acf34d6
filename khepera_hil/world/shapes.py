"""What stands on the floor: convex polygons and discs with a height. Millimetres, grams, radians."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["BODY_RADIUS", "Kind", "Pose", "Shape", "box", "disc", "gap", "overlap", "turned"]

BODY_RADIUS = 28.5
"""The robot's. Paper, section 4.1: 57 mm across."""

Kind = Literal["wall", "fixed", "block", "disc", "mover", "flame", "lamp", "base", "robot"]
"""wall: the arena's and the base's; fixed: stands for ever; block and disc: can be pushed if light enough;
mover: goes its own way; flame: a candle's, or a bulb that is shaken above the floor; lamp: hangs above it; base:
the base's square on it. Bulbs, lamps and the base stand in nobody's way."""

Pose = tuple[float, float, float]
"""x (right), y (up) and theta (counter-clockwise)."""

FLOOR_FRICTION = 0.35
"""Wood on wood (proposed; plastic 0.25, a rubber foot 0.45)."""

Point = tuple[float, float]
Points = NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """A polygon (``corners`` in its own frame, counter-clockwise) or a disc (``radius``).

    A polygon that is not convex has ``parts``, convex polygons that make it up. ``reflectance`` is for infrared
    light, 1 for white paper, ``albedo`` what the camera sees of its light and dark, 0 to 1; ``stripes`` (mm) are
    the least and greatest width of black and white stripes instead. ``mass`` is infinite for what cannot move;
    ``floor_friction`` the coefficient between it and the floor. What is ``pointed`` narrows to a point at its
    height: a pyramid or a cone.
    """

    name: str
    kind: Kind
    pose: Pose
    height: float
    corners: tuple[tuple[float, float], ...] = ()
    radius: float = 0.0
    reflectance: float = 1.0
    mass: float = math.inf
    floor_friction: float = FLOOR_FRICTION
    parts: tuple[tuple[tuple[float, float], ...], ...] = ()
    pointed: bool = False
    albedo: float = 0.6
    stripes: tuple[float, float] | None = None

    @property
    def convex(self) -> tuple[tuple[tuple[float, float], ...], ...]:
        """Convex polygons that make it up; none for a disc."""
        return self.parts or ((self.corners,) if self.corners else ())

    @property
    def movable(self) -> bool:
        """Whether it is a body of its own."""
        return math.isfinite(self.mass)

    @property
    def area(self) -> float:
        """Of the floor that it covers, mm2."""
        if not self.corners:
            return math.pi * self.radius**2
        x, y = np.array(self.corners).T
        return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2

    @property
    def outline(self) -> float:
        """Its length round, mm."""
        if not self.corners:
            return 2 * math.pi * self.radius
        ends = self.corners[1:] + self.corners[:1]
        return sum(math.hypot(to_x - x, to_y - y) for (x, y), (to_x, to_y) in zip(self.corners, ends, strict=True))

    @property
    def reach(self) -> float:
        """From its own middle to the farthest point of its outline, mm."""
        return max((math.hypot(*corner) for corner in self.corners), default=self.radius)

    @property
    def longest_line(self) -> float:
        """The longest straight side of its outline, mm; 0 for a disc."""
        ends = self.corners[1:] + self.corners[:1]
        sides = (math.hypot(to_x - x, to_y - y) for (x, y), (to_x, to_y) in zip(self.corners, ends, strict=True))
        return max(sides, default=0.0)

    def at(self, pose: Pose) -> Shape:
        """The same thing elsewhere."""
        return replace(self, pose=pose)

    def points(self) -> Points:
        """The corners on the floor, shape (n, 2); a disc's centre, shape (1, 2)."""
        return turned(np.array(self.corners or ((0.0, 0.0),)), self.pose)

    def described(self) -> dict[str, Any]:
        """For a recording: metres, JSON-able."""
        x, y, theta = self.pose
        outline: dict[str, Any] = {"radius": self.radius / 1000}
        if self.corners:
            outline = {"polygon": [[x / 1000, y / 1000] for x, y in self.corners]}
        return {
            "name": self.name,
            "kind": self.kind,
            **outline,
            "pose": [x / 1000, y / 1000, theta],
            "height": self.height / 1000,
            "movable": self.movable or self.kind == "robot",
        }


def box(
    name: str,
    kind: Kind,
    width: float,
    depth: float,
    pose: Pose,
    height: float,
    *,
    reflectance: float = 1.0,
    mass: float = math.inf,
    floor_friction: float = FLOOR_FRICTION,
) -> Shape:
    """A rectangle, ``width`` along its own x axis."""
    x, y = width / 2, depth / 2
    corners = ((-x, -y), (x, -y), (x, y), (-x, y))
    return Shape(name, kind, pose, height, corners, 0.0, reflectance, mass, floor_friction)


def disc(
    name: str,
    kind: Kind,
    radius: float,
    pose: Pose,
    height: float,
    *,
    reflectance: float = 1.0,
    mass: float = math.inf,
    floor_friction: float = FLOOR_FRICTION,
) -> Shape:
    """A cylinder."""
    return Shape(name, kind, pose, height, (), radius, reflectance, mass, floor_friction)


def turned(points: Points, pose: Pose) -> Points:
    """Points of a shape's own frame on the floor, shape (n, 2)."""
    x, y, theta = pose
    cosine, sine = math.cos(theta), math.sin(theta)
    moved: Points = points @ np.array([[cosine, sine], [-sine, cosine]]) + (x, y)
    return moved


def gap(one: Shape, other: Shape) -> float:
    """The shortest way between two shapes, mm; 0 when they touch or overlap."""
    between = min(_between(a, b) for a in _pieces(one) for b in _pieces(other))
    return max(0.0, between - one.radius - other.radius)


def overlap(one: Shape, other: Shape) -> bool:
    """Whether two shapes share more than their borders (a hundredth of their size is forgiven)."""
    return gap(_smaller(one), _smaller(other)) == 0


def _smaller(shape: Shape) -> Shape:
    def about(part: tuple[Point, ...]) -> tuple[Point, ...]:
        x = sum(point[0] for point in part) / len(part)
        y = sum(point[1] for point in part) / len(part)
        return tuple((x + 0.995 * (a - x), y + 0.995 * (b - y)) for a, b in part)

    parts = tuple(about(part) for part in shape.convex)
    return replace(shape, corners=parts[0] if parts else (), parts=parts, radius=0.995 * shape.radius)


def _pieces(shape: Shape) -> list[list[Point]]:
    """Its convex polygons on the floor; a disc's centre."""
    pieces = shape.convex or (((0.0, 0.0),),)
    return [[(x, y) for x, y in turned(np.array(piece), shape.pose).tolist()] for piece in pieces]


def _between(a: list[Point], b: list[Point]) -> float:
    if not (_apart(a, b) or _apart(b, a)):
        return 0.0
    return min(_corner_to_edge(a, b), _corner_to_edge(b, a))


def _apart(a: list[Point], b: list[Point]) -> bool:
    """Whether all of ``b`` lies beyond one edge of the convex polygon ``a`` (or is another point)."""
    if len(a) == 1:
        return len(b) == 1 and a != b
    for (x, y), (to_x, to_y) in zip(a, a[1:] + a[:1], strict=True):
        normal_x, normal_y = to_y - y, x - to_x
        if all((other_x - x) * normal_x + (other_y - y) * normal_y > 0 for other_x, other_y in b):
            return True
    return False


def _corner_to_edge(corners: list[Point], polygon: list[Point]) -> float:
    """The shortest distance from any of ``corners`` to any edge of ``polygon``."""
    least = math.inf
    for (x, y), (to_x, to_y) in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        edge_x, edge_y = to_x - x, to_y - y
        square = max(edge_x * edge_x + edge_y * edge_y, 1e-12)
        for corner_x, corner_y in corners:
            away_x, away_y = corner_x - x, corner_y - y
            along = min(max((away_x * edge_x + away_y * edge_y) / square, 0.0), 1.0)
            least = min(least, math.hypot(away_x - along * edge_x, away_y - along * edge_y))
    return least
