"""A shape where it stands now, cut at one height, and how it lies to a place or a line. Lengths in mm."""

from __future__ import annotations

import math
from collections.abc import Sequence

from khepera_hil.world.shapes import Pose, Shape

__all__ = ["Solid", "beside", "is_near", "nearest"]

_NOBODY = (math.inf, math.inf, -math.inf, -math.inf)

# One edge, counter-clockwise round its shape: start, way to its end, length.
_Edge = tuple[float, float, float, float, float]


class Solid:
    """A shape where it stands now, cut at one height: its box along the axes, its edges or its radius.

    ``pose`` None: it stands elsewhere. :attr:`lean` is the cosine of the slope of its sides.
    """

    def __init__(self, shape: Shape, place: int, level: float) -> None:
        self.shape = shape
        self.place_of_shape = place
        self._scale = 1 - level / shape.height if shape.pointed else 1.0
        self.radius = shape.radius * self._scale
        self.lean = 1.0
        if shape.pointed:
            inner = shape.radius or min(
                math.hypot(x + to_x, y + to_y) / 2 for (x, y), (to_x, to_y) in _sides(shape)
            )
            self.lean = shape.height / math.hypot(shape.height, inner)
        self.place(shape.pose)

    def place(self, pose: Pose | None) -> None:
        """Compute its box and edges anew."""
        self.edges: list[_Edge] = []
        self.turn = 0.0
        self.x = self.y = math.inf
        if pose is None:
            self.box = _NOBODY
            return
        self.x, self.y, self.turn = x, y, turn = pose
        if not self.shape.corners:
            self.box = (x - self.radius, y - self.radius, x + self.radius, y + self.radius)
            return
        cosine, sine = self._scale * math.cos(turn), self._scale * math.sin(turn)
        corners = [(x + cosine * a - sine * b, y + sine * a + cosine * b) for a, b in self.shape.corners]
        for (start_x, start_y), (end_x, end_y) in zip(corners, corners[1:] + corners[:1], strict=True):
            way_x, way_y = end_x - start_x, end_y - start_y
            self.edges.append((start_x, start_y, way_x, way_y, math.hypot(way_x, way_y)))
        across, up = zip(*corners, strict=True)
        self.box = (min(across), min(up), max(across), max(up))


def _sides(shape: Shape) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    return list(zip(shape.corners, shape.corners[1:] + shape.corners[:1], strict=True))


def is_near(solid: Solid, x: float, y: float, reach: float) -> bool:
    """Whether the solid's box, made wider by ``reach``, holds a place."""
    left, low, right, high = solid.box
    return left - reach < x < right + reach and low - reach < y < high + reach


def nearest(solids: list[Solid], poses: Sequence[Pose]) -> tuple[float, float]:
    """How far the nearest box of anything with edges, and of a disc, is from the last of the poses."""
    x, y, _ = poses[-1]
    straight = round_ = math.inf
    for solid in solids:
        left, low, right, high = solid.box
        across = left - x if x < left else x - right if x > right else 0.0
        up = low - y if y < low else y - high if y > high else 0.0
        squared = across * across + up * up
        if not solid.edges:
            round_ = min(round_, squared)
        elif squared < straight:
            straight = squared
    return math.sqrt(straight), math.sqrt(round_)


def beside(solid: Solid, x: float, y: float, along_x: float, along_y: float, width: float) -> bool:
    """Whether the solid is wholly more than ``width`` beside the line through (x, y) along a unit vector."""
    if not solid.edges:
        return abs((solid.x - x) * along_y - (solid.y - y) * along_x) >= width + solid.radius
    sides = [(edge[0] - x) * along_y - (edge[1] - y) * along_x for edge in solid.edges]
    return min(sides) >= width or max(sides) <= -width
