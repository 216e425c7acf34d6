"""The arena as rays see it: what is near, in the robot's frame, and the first thing that a ray hits.

Most of the time little or nothing is near, and arrays of a few numbers cost as much as arrays of a hundred:
so what is far is dismissed one thing at a time, and only the rest meets the rays as arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from khepera_hil.world.shapes import Pose, Shape

__all__ = ["Rays", "Scene", "Solid", "beside", "hides"]

Array = NDArray[np.float64]

_NOWHERE = 1e9

# One edge, counter-clockwise round its shape: start, way to its end, outward normal of length 1, length.
_Edge = tuple[float, float, float, float, float, float, float]


class Solid:
    """A shape where it stands now: its box along the axes, its edges."""

    def __init__(self, shape: Shape) -> None:
        self.shape = shape
        self.place(shape.pose)

    def place(self, pose: Pose) -> None:
        """Compute its box and edges anew."""
        self.x, self.y, _ = pose
        self.edges: list[_Edge] = []
        moved = self.shape.at(pose)
        if not self.shape.corners:
            radius = self.shape.radius
            self.box = (self.x - radius, self.y - radius, self.x + radius, self.y + radius)
            return
        corners: list[tuple[float, float]] = [(x, y) for x, y in moved.points().tolist()]
        for (x, y), (to_x, to_y) in zip(corners, corners[1:] + corners[:1], strict=True):
            along_x, along_y = to_x - x, to_y - y
            length = math.hypot(along_x, along_y)
            self.edges.append((x, y, along_x, along_y, along_y / length, -along_x / length, length))
        across, up = zip(*corners, strict=True)
        self.box = (min(across), min(up), max(across), max(up))


class Rays:
    """Rays that are fixed to the robot: origins and unit directions in its frame, both of shape (n, 2)."""

    def __init__(self, origins: Array, directions: Array) -> None:
        self.origins = origins
        self.directions = directions
        self.count = len(origins)
        self.farthest = float(np.hypot(*origins.T).max())
        # An edge from a along e meets a ray from o along d where o + t d = a + u e; with cross products,
        # t = (a x e - o x e) / (d x e) and u = (a x d - o x d) / (d x e). This matrix takes (a, e) to
        # d x e, -o x e and a x d of all rays at once.
        (x, y), (from_x, from_y) = directions.T, origins.T
        nought = np.zeros(self.count)
        self.crossing = np.block(
            [[nought, nought, y], [nought, nought, -x], [-y, from_y, nought], [x, -from_x, nought]]
        )
        self.moment = from_x * y - from_y * x
        self.ahead = (origins * directions).sum(1)
        self.squared = (origins**2).sum(1)


class Scene:
    """Everything that stands on the floor, for straight lines of sight. Lengths in mm.

    ``shapes`` are at their poses; :meth:`place` moves one of them.
    """

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self._solids = [Solid(shape) for shape in shapes]

    def place(self, place: int, pose: Pose) -> None:
        """Move the shape at this place of the constructor's sequence."""
        self._solids[place].place(pose)

    def reflections(self, rays: Rays, pose: Pose, reach: float, above: float) -> tuple[Array, Array, Array] | None:
        """The first thing that each ray hits: distance, cosine of the incidence, reflectance; each of shape (n,).

        Only things higher than ``above`` and nearer than ``reach`` to the robot's centre are looked at; None
        when there are none. Where a ray hits nothing, the distance is 1e9 and the rest 0.
        """
        edges, discs = self._near(pose, reach, above, rays.farthest)
        if not edges and not discs:
            return None
        hits: list[tuple[Array, Array, Array]] = []
        if edges:
            table = np.array(edges)
            crossed = table[:, :4] @ rays.crossing
            # Counter-clockwise edges cross a ray from its right when they are seen from outside: d x e < 0.
            across = np.minimum(crossed[:, : rays.count], -1e-12)
            t = (crossed[:, rays.count : -rays.count] + table[:, 4:5]) / across
            u = (crossed[:, -rays.count :] - rays.moment) / across
            t = np.where((np.abs(u - 0.5) <= 0.5) & (t >= 0), t, _NOWHERE)
            hits.append((t, across, table[:, 5:7]))
        if discs:
            table = np.array(discs)
            centre, radius = table[:, :2], table[:, 2:3]
            middle = centre @ rays.directions.T - rays.ahead
            apart = (centre**2).sum(1)[:, None] - 2 * centre @ rays.origins.T + rays.squared
            square = middle**2 - apart + radius**2
            half = np.sqrt(np.maximum(square, 0))
            t = middle - half
            t = np.where((square > 0) & (t >= 0), t, _NOWHERE)
            hits.append((t, half, table[:, 3:5]))
        return _first(hits, rays.count)

    def _near(
        self, pose: Pose, reach: float, above: float, farthest: float
    ) -> tuple[list[tuple[float, ...]], list[tuple[float, ...]]]:
        """Near edges and discs in the robot's frame.

        An edge: start, way, cross product of the two, -1 / length, reflectance; a disc: centre, radius,
        1 / radius, reflectance.
        """
        x, y, theta = pose
        cosine, sine = math.cos(theta), math.sin(theta)
        edges: list[tuple[float, ...]] = []
        discs: list[tuple[float, ...]] = []
        for solid in self._solids:
            left, low, right, high = solid.box
            if not (left - reach < x < right + reach and low - reach < y < high + reach):
                continue
            if solid.shape.height <= above:
                continue
            if not solid.edges:
                away_x, away_y = solid.x - x, solid.y - y
                if math.hypot(away_x, away_y) < reach + solid.shape.radius:
                    discs.append(
                        (
                            away_x * cosine + away_y * sine,
                            away_y * cosine - away_x * sine,
                            solid.shape.radius,
                            1 / solid.shape.radius,
                            solid.shape.reflectance,
                        )
                    )
                continue
            for start_x, start_y, along_x, along_y, normal_x, normal_y, length in solid.edges:
                away_x, away_y = start_x - x, start_y - y
                # A face is seen from its outer side only, by the sensors if not by the robot's centre.
                if not -farthest < -away_x * normal_x - away_y * normal_y < reach:
                    continue
                if -reach < (-away_x * along_x - away_y * along_y) / length < length + reach:
                    own_x, own_y = away_x * cosine + away_y * sine, away_y * cosine - away_x * sine
                    way_x, way_y = along_x * cosine + along_y * sine, along_y * cosine - along_x * sine
                    moment = own_x * way_y - own_y * way_x
                    edges.append((own_x, own_y, way_x, way_y, moment, -1 / length, solid.shape.reflectance))
        return edges, discs

    def between(
        self, place: tuple[float, float, float], target: tuple[float, float, float], width: float
    ) -> list[Solid]:
        """What may hide any point near ``target`` from any point near ``place`` (x, y, height).

        Near is at most ``width`` mm away at the same height.
        """
        (x, y, above), (to_x, to_y, high_end) = place, target
        way = max(math.hypot(to_x - x, to_y - y), 1e-9)
        along_x, along_y = (to_x - x) / way, (to_y - y) / way
        left, right = min(x, to_x) - width, max(x, to_x) + width
        low, high = min(y, to_y) - width, max(y, to_y) + width
        near = []
        for solid in self._solids:
            box = solid.box
            if box[0] > right or box[2] < left or box[1] > high or box[3] < low:
                continue
            if solid.shape.height <= above:
                continue
            if beside(solid, x, y, along_x, along_y, width):
                continue
            # The lines rise: what is low and far along them stays below.
            if solid.edges:
                first = min((edge[0] - x) * along_x + (edge[1] - y) * along_y for edge in solid.edges)
            else:
                first = (solid.x - x) * along_x + (solid.y - y) * along_y - solid.shape.radius
            if solid.shape.height > above + (high_end - above) * (first - width) / (way + width):
                near.append(solid)
        return near


def beside(solid: Solid, x: float, y: float, along_x: float, along_y: float, width: float) -> bool:
    """Whether the solid is wholly more than ``width`` beside the line through (x, y) along a unit vector."""
    if not solid.edges:
        return abs((solid.x - x) * along_y - (solid.y - y) * along_x) >= width + solid.shape.radius
    sides = [(edge[0] - x) * along_y - (edge[1] - y) * along_x for edge in solid.edges]
    return min(sides) >= width or max(sides) <= -width


def hides(solid: Solid, start: tuple[float, float, float], end: tuple[float, float, float], slack: float) -> bool:
    """Whether the solid stands higher than the straight line from ``start`` to ``end`` (x, y, height).

    The line begins ``slack`` mm behind its start, so that what touches a sensor hides the light.
    """
    (x, y, low), (to_x, to_y, high) = start, end
    way_x, way_y = to_x - x, to_y - y
    length = max(math.hypot(way_x, way_y), 1e-9)
    if not solid.edges:
        away_x, away_y = solid.x - x, solid.y - y
        middle = (away_x * way_x + away_y * way_y) / length
        square = middle * middle - away_x * away_x - away_y * away_y + solid.shape.radius**2
        if square <= 0:
            return False
        t = (middle - math.sqrt(square)) / length
        return -slack / length <= t <= 1 and solid.shape.height > low + (high - low) * max(t, 0.0)
    for edge_x, edge_y, along_x, along_y, _, _, _ in solid.edges:
        # A line is lowest where it enters a shape, so the faces that look away do not matter.
        across = way_x * along_y - way_y * along_x
        if across >= 0:
            continue
        away_x, away_y = edge_x - x, edge_y - y
        if not 0 <= (away_x * way_y - away_y * way_x) / across <= 1:
            continue
        t = (away_x * along_y - away_y * along_x) / across
        return -slack / length <= t <= 1 and solid.shape.height > low + (high - low) * max(t, 0.0)
    return False


def _first(hits: list[tuple[Array, Array, Array]], count: int) -> tuple[Array, Array, Array]:
    """Of all things, the one that each ray meets first; ``hits`` are distances, cosines less a factor of each
    thing's own, and that factor and the reflectance of each thing."""
    columns = np.arange(count)
    found = []
    for t, cosines, things in hits:
        row = t.argmin(0)
        nearest = t[row, columns]
        met = nearest < _NOWHERE
        factor, reflectance = things[row].T
        found.append((nearest, cosines[row, columns] * factor * met, reflectance * met))
    if len(found) == 1:
        return found[0]
    nearer = found[1][0] < found[0][0]
    one, other = (np.where(nearer, b, a) for a, b in zip(found[0][:2], found[1][:2], strict=True))
    return one, other, np.where(nearer, found[1][2], found[0][2])
