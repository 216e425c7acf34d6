"""The arena as straight lines see it at one height: the first thing that a ray hits, and what hides a lamp.

Arrays of a few numbers cost as much as arrays of a hundred, so what is far is dismissed one thing at a time and
only the rest meets the rays as arrays; and what is near a place is remembered until the robot has left its
neighbourhood or something has moved. Every result is computed for each line and each edge apart, so it does not
depend on what else is in the arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from khepera_hil.world.shapes import Pose, Shape
from khepera_hil.world.solids import Solid, beside, is_near, nearest

__all__ = ["Hits", "Rays", "Scene"]

Array = NDArray[np.float64]

_NOWHERE = 1e9
_NEIGHBOURHOOD = 40.0  # mm that the robot may go before what is near is looked for anew
_LEAN = 1.58  # exponent of a sloping face's cosine, as of the incidence in the plane (khepera_hil.world.sensors)


class Rays:
    """Rays that are fixed to the robot: origins and unit directions in its frame, both of shape (n, 2)."""

    def __init__(self, origins: Array, directions: Array) -> None:
        self.count = len(origins)
        self.farthest = float(np.hypot(*origins.T).max())
        self._own = np.concatenate([origins.T, directions.T])  # (4, n)
        self._turned = np.stack([-origins[:, 1], origins[:, 0], -directions[:, 1], directions[:, 0]])

    def placed(self, poses: Sequence[Pose]) -> Array:
        """Origins and directions on the floor, shape (4, n): x, y, and the two of the direction.

        One pose is for all rays; more of them share the rays out evenly, in order.
        """
        if len(poses) == 1:
            x, y, theta = poses[0]
            rays: Array = math.cos(theta) * self._own + math.sin(theta) * self._turned
            rays[0] += x
            rays[1] += y
            return rays
        table = np.array([(x, y, math.cos(theta), math.sin(theta)) for x, y, theta in poses])
        across, up, cosine, sine = table.T.repeat(self.count // len(poses), axis=1)
        rays = cosine * self._own + sine * self._turned
        rays[0] += across
        rays[1] += up
        return rays


class _Near(NamedTuple):
    """What stands near a place: the solids, and their edges and discs as arrays.

    An edge: start, way, cross product of the two, -1 / length, reflectance, whose it is, its place on the outline,
    length. A disc: centre, radius, reflectance, whose it is, its own turn.
    """

    version: int
    x: float
    y: float
    reach: float
    solids: list[Solid]
    edges: Array
    discs: Array
    edge_columns: Array
    disc_columns: Array
    """The first columns of both, to be met by rays: shapes (6, n, 1) and (3, n, 1)."""
    reflectance: Array
    """Of all edges, then of all discs."""
    outline: Array
    """Of these too: whose it is, its place on the outline, its own turn, its length (a disc's: for each radian)."""


class Hits(NamedTuple):
    """What each ray meets first, each of shape (n,).

    Where it meets nothing, ``distance`` is 1e9 and ``cosine`` (of the incidence) and ``reflectance`` are 0. ``row``
    and ``along`` say where on what: see :meth:`Scene.surface`.
    """

    distance: Array
    cosine: Array
    reflectance: Array
    row: NDArray[np.intp]
    along: Array
    near: _Near


class Scene:
    """What stands on the floor higher than ``level`` mm, cut at that height.

    ``shapes`` are at their poses; :meth:`place` moves one of them or takes it away. What is near is looked for
    again after ``neighbourhood`` mm.
    """

    def __init__(self, shapes: Sequence[Shape], level: float, neighbourhood: float = _NEIGHBOURHOOD) -> None:
        self.level = level
        self._all = [
            Solid(shape, place, level) if shape.height > level else None for place, shape in enumerate(shapes)
        ]
        self._solids = [solid for solid in self._all if solid is not None]
        self._neighbours = neighbourhood
        self._version = 0
        self._near: _Near | None = None
        self._shading: dict[object, tuple[int, float, float, list[Solid]]] = {}
        self._rows: tuple[list[Solid], int, Array, Array] = [], -1, np.empty(0), np.empty(0)
        self.brightest = max((shape.reflectance for shape in shapes), default=0.0)
        """The greatest reflectance of anything in it."""

    def place(self, place: int, pose: Pose | None) -> None:
        """Move the shape at this place of the constructor's sequence; None: it is not there."""
        solid = self._all[place]
        if solid is not None:
            solid.place(pose)
            self._version += 1

    def reflections(
        self, rays: Rays, poses: Sequence[Pose], reach: float, matters: float = math.inf
    ) -> Hits | None:
        """The first thing within ``reach`` mm that each ray hits.

        ``poses`` are one for all rays or as many as share them out (see :meth:`Rays.placed`), close together. None
        when nothing stands within ``matters`` mm of them, which is much quicker to see.
        """
        near = self._neighbourhood(poses, rays.farthest, reach)
        straight, round_ = nearest(near.solids, poses)
        farthest = reach + rays.farthest + _ON_THE_WAY
        if min(straight, round_) > min(matters + _ON_THE_WAY, farthest):
            return None
        from_x, from_y, way_x, way_y = rays.placed(poses)
        found: list[tuple[Array, Array, NDArray[np.intp], Array]] = []
        columns = np.arange(rays.count)
        if straight <= farthest and len(near.edges):
            x, y, along_x, along_y, moment, shrink = near.edge_columns
            # An edge from a along e meets a ray from o along d where o + t d = a + u e; with cross products,
            # t = (a - o) x e / (d x e) and u = (a - o) x d / (d x e). Counter-clockwise edges cross a ray from
            # its right when they are seen from outside: d x e < 0.
            across = np.minimum(way_x * along_y - way_y * along_x, -1e-12)
            t = (moment - (from_x * along_y - from_y * along_x)) / across
            u = (x * way_y - y * way_x - (from_x * way_y - from_y * way_x)) / across
            t[(np.abs(u - 0.5) > 0.5) | (np.abs(t - reach / 2) > reach / 2)] = _NOWHERE
            row = t.argmin(0)
            found.append((t[row, columns], across[row, columns] * shrink[row, 0], row, u[row, columns]))
        if round_ <= farthest:
            x, y, radius = near.disc_columns
            away_x, away_y = x - from_x, y - from_y
            middle = away_x * way_x + away_y * way_y
            square = middle * middle - away_x * away_x - away_y * away_y + radius * radius
            half = np.sqrt(np.maximum(square, 0))
            t = middle - half
            t[(square <= 0) | (t < 0) | (t > reach)] = _NOWHERE
            row = t.argmin(0)
            distance = t[row, columns]
            on_x = from_x + distance * way_x - x[row, 0]
            on_y = from_y + distance * way_y - y[row, 0]
            cosine = half[row, columns] / radius[row, 0]
            found.append((distance, cosine, row + len(near.edges), np.arctan2(on_y, on_x)))
        if not found:
            return None
        distance, cosine, row, along = found[0]
        if len(found) == 2:
            nearer = found[1][0] < distance
            distance, cosine, row, along = (np.where(nearer, b, a) for a, b in zip(*found, strict=True))
        met = distance < _NOWHERE
        return Hits(distance, cosine * met, near.reflectance[row] * met, row, along, near)

    @staticmethod
    def surface(hits: Hits) -> tuple[NDArray[np.intp], Array]:
        """Which shape each ray hit (its place in the constructor's sequence), and where: mm round the outline.

        Of no meaning where nothing was hit.
        """
        whose, begin, turn, scale = hits.near.outline[:, hits.row]
        round_ = hits.row >= len(hits.near.edges)
        along = np.where(round_, (hits.along - turn) % (2 * math.pi), hits.along)
        return whose.astype(np.intp), begin + along * scale

    def _neighbourhood(self, poses: Sequence[Pose], farthest: float, reach: float) -> _Near:
        """All that rays of ``reach`` may meet which start ``farthest`` from any place near the poses."""
        near, wide = self._near, self._neighbours
        if near is not None and near.version == self._version and near.reach == reach:
            x, y, _ = poses[-1]
            if abs(x - near.x) <= wide and abs(y - near.y) <= wide:
                return near
        x, y, _ = poses[-1]
        # Twice: of several poses, which lie close together, only the last is compared.
        slack = 2 * wide + farthest
        solids = [solid for solid in self._solids if is_near(solid, x, y, reach + slack)]
        edges: list[tuple[float, ...]] = []
        discs: list[tuple[float, ...]] = []
        for solid in solids:
            if not solid.edges:
                reflects = solid.shape.reflectance * solid.lean**_LEAN
                discs.append((solid.x, solid.y, solid.radius, reflects, solid.place_of_shape, solid.turn))
                continue
            begin = 0.0
            for start_x, start_y, way_x, way_y, length in solid.edges:
                # A face is seen from its outer side only.
                if ((x - start_x) * way_y - (y - start_y) * way_x) / length > -slack:
                    edges.append(
                        (
                            start_x,
                            start_y,
                            way_x,
                            way_y,
                            start_x * way_y - start_y * way_x,
                            -1 / length,
                            solid.shape.reflectance * solid.lean**_LEAN,
                            solid.place_of_shape,
                            begin,
                            length,
                        )
                    )
                begin += length
        straight, round_ = np.array(edges).reshape(-1, 10), np.array(discs).reshape(-1, 6)
        self._near = _Near(
            self._version,
            x,
            y,
            reach,
            solids,
            straight,
            round_,
            np.ascontiguousarray(straight.T[:6, :, None]),
            np.ascontiguousarray(round_.T[:3, :, None]),
            np.concatenate([straight[:, 6], round_[:, 3]]),
            np.concatenate(
                [
                    np.column_stack([straight[:, 7], straight[:, 8], 0 * straight[:, 8], straight[:, 9]]),
                    np.column_stack([round_[:, 4], 0 * round_[:, 4], round_[:, 5], round_[:, 2]]),
                ]
            ).T,
        )
        return self._near

    def shadows(self, key: object, lamp: tuple[float, float, float], width: float, pose: Pose) -> list[Solid]:
        """What may hide a lamp (x, y, height; radius ``width`` mm) from a sensor of a robot about ``pose``.

        ``key`` names the lamp, so that what may stand between is not looked for each time; a thing of its name,
        the candle of a flame, hides it from nobody.
        """
        x, y, _ = pose
        known = self._shading.get(key)
        if (
            known is None
            or known[0] != self._version
            or abs(x - known[1]) > _NEIGHBOURHOOD
            or abs(y - known[2]) > _NEIGHBOURHOOD
        ):
            others = [solid for solid in self._solids if solid.shape.name != key]
            wide = self.between((x, y), lamp, 2 * _NEIGHBOURHOOD + _ROBOT + width, others)
            known = self._shading[key] = self._version, x, y, wide
        return self.between((x, y), lamp, _ROBOT + width, known[3]) if known[3] else known[3]

    def shaded(self, solids: list[Solid], lamp: tuple[float, float, float], lines: Array) -> NDArray[np.bool_]:
        """Whether the solids hide a lamp (x, y, height) along straight lines to it, shape (n,) of bool.

        ``lines`` are their starts at the scene's level, their ways and these ways' lengths, shape (5, n).
        """
        if self._rows[1] != self._version or solids != self._rows[0]:
            rows = [(*edge[:4], solid.shape.height) for solid in solids for edge in solid.edges]
            discs_ = [(s.x, s.y, s.radius, s.shape.height) for s in solids if not s.edges]
            columns = np.array(rows).reshape(-1, 5).T[:, :, None], np.array(discs_).reshape(-1, 4).T[:, :, None]
            self._rows = solids, self._version, *columns
        _, _, edges, discs = self._rows
        from_x, from_y, way_x, way_y, length = lines
        first, rise = -_TOUCHING / length, lamp[2] - self.level
        hidden = np.zeros(len(way_x), bool)
        if edges.size:
            x, y, along_x, along_y, height = edges
            # A line is lowest where it enters a shape, so the faces that look away do not matter.
            across = np.minimum(way_x * along_y - way_y * along_x, -1e-12)
            away_x, away_y = x - from_x, y - from_y
            u = (away_x * way_y - away_y * way_x) / across
            t = (away_x * along_y - away_y * along_x) / across
            crossed = (np.abs(u - 0.5) <= 0.5) & (t >= first) & (t <= 1)
            hidden |= (crossed & (height > self.level + rise * np.maximum(t, 0))).any(0)
        if discs.size:
            x, y, radius, height = discs
            away_x, away_y = x - from_x, y - from_y
            middle = (away_x * way_x + away_y * way_y) / length
            square = middle * middle - away_x * away_x - away_y * away_y + radius * radius
            t = (middle - np.sqrt(np.maximum(square, 0))) / length
            crossed = (square > 0) & (t >= first) & (t <= 1)
            hidden |= (crossed & (height > self.level + rise * np.maximum(t, 0))).any(0)
        return hidden

    def between(
        self,
        place: tuple[float, float],
        target: tuple[float, float, float],
        width: float,
        solids: Sequence[Solid],
    ) -> list[Solid]:
        """Which of the solids may hide any point near ``target`` (x, y, height) from any near ``place``.

        Near is at most ``width`` mm away at the same height.
        """
        (x, y), (to_x, to_y, high_end) = place, target
        way = max(math.hypot(to_x - x, to_y - y), 1e-9)
        along_x, along_y = (to_x - x) / way, (to_y - y) / way
        left, right = min(x, to_x) - width, max(x, to_x) + width
        low, high = min(y, to_y) - width, max(y, to_y) + width
        near = []
        for solid in solids:
            box = solid.box
            if box[0] > right or box[2] < left or box[1] > high or box[3] < low:
                continue
            if beside(solid, x, y, along_x, along_y, width):
                continue
            # The lines rise: what is low and far along them stays below.
            if solid.edges:
                first = min((edge[0] - x) * along_x + (edge[1] - y) * along_y for edge in solid.edges)
            else:
                first = (solid.x - x) * along_x + (solid.y - y) * along_y - solid.radius
            rise = (high_end - self.level) * max(first - width, 0.0) / (way + 2 * width)
            if solid.shape.height > self.level + rise:
                near.append(solid)
        return near


_TOUCHING = 3.0  # mm behind a sensor at which a line of sight begins, so that what touches it hides the light
_ON_THE_WAY = 20.0  # mm from one of several poses to any other: 20 ms at the robot's top speed
_ROBOT = 50.0  # mm from one of several poses to a sensor at any other
