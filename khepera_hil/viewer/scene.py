"""The arena and the robot in it, in metres, x right and y up.

The manifest's ``world`` is ``{"name", "size": [width, depth], "shapes": [...]}``, or null where nobody can see
the robot. A shape has ``name``, ``kind``, ``pose`` (x, y, theta), ``height``, ``movable``, and ``polygon`` (its
corners in its own frame) or ``radius``.

The viewer's plane has y down, so everything hangs below one mirror, ``/world``; data stay in true coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from khepera_hil.recording import Pose, Tick
from khepera_hil.viewer import colours
from khepera_hil.viewer.columns import Columns, Lane, Stamp

__all__ = ["TRAIL", "Scene", "hatching", "readings", "trails"]

TRAIL = "/world/trail"

RADIUS = 0.0285
"""Of the robot's body (57 mm in diameter: paper, section 4.1)."""

_PLACE = np.radians([68, 43, 13, -13, -43, -68, -158, 158])
_AIM = np.radians([90, 45, 10, -10, -45, -90, -180, 180])
_ROOT = 0.028 * np.column_stack([np.cos(_PLACE), np.sin(_PLACE)])
_WAY = np.column_stack([np.cos(_AIM), np.sin(_AIM)])
# Where the eight sensors sit and look, counter-clockwise from ahead: the KiKS simulator's geometry, which
# tables measured on real robots bear out.

MARKED = {"mover": 7.0, "lamp": 8.0, "flame": 8.0}
"""Kinds of things whose names stand beside them, and how far up each is drawn; the base is at 3, others at 6."""

LOW = 0.05
"""Height (m) below which a thing is drawn darker."""

RAY = 0.06
"""Length of a full reading's ray (m)."""

DARK = 500
"""About what the light sensors answer in the dark; less is brighter (paper, section 4.1)."""


def trails(manifest: Mapping[str, Any]) -> list[str]:
    """The entities of the trails: the robot's own, then those of other robots in the same arena."""
    shapes = (manifest.get("world") or {}).get("shapes", ())
    return [TRAIL, *(_trail(str(shape["name"])) for shape in shapes if _is_another(shape))]


def _is_another(shape: Mapping[str, Any]) -> bool:
    """Whether it is a robot, and not the one whose run this is."""
    return bool(shape["kind"] == "robot" and shape["name"] != "robot")


def _trail(name: str) -> str:
    return f"/world/trails/{rr.escape_entity_path_part(name)}"


def readings(tick: Tick, letter: str) -> NDArray[np.float64] | None:
    """The eight numbers of the robot's answer to ``letter``, or None when it gave no whole answer."""
    words = tick.raw.get(letter, "").strip().split(",")[1:]
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        return None
    return numbers if len(numbers) == 8 else None


class Scene:
    """Static shapes once; then the robot's pose, its readings as rays, its trail, and what was moved."""

    def __init__(self, stream: rr.RecordingStream, manifest: Mapping[str, Any]) -> None:
        self.lanes = {
            "robot": Lane("/world/robot", _poses),
            "proximity": Lane("/world/robot/proximity", _rays),
            "light": Lane("/world/robot/light", _rays),
            "trail": Lane(TRAIL, _points),
        }
        _log(stream, "/world", rr.Transform3D(scale=[1, -1, 1]))
        _robot(stream, "/world/robot", colours.ROBOT)
        _rays_of(stream)
        _trail_of(stream, TRAIL, colours.ROBOT)
        self._movable: dict[str, Lane] = {}
        self._others: dict[str, Lane] = {}
        self._first: dict[str, Pose] = {}
        world = manifest.get("world")
        if world:
            _floor(stream, world["size"])
            for shape in world["shapes"]:
                self._shape(stream, shape)

    def _shape(self, stream: rr.RecordingStream, shape: Mapping[str, Any]) -> None:
        name, kind = str(shape["name"]), str(shape["kind"])
        if _is_another(shape):
            self._another(stream, shape)
        if kind == "robot":
            return
        path = "/world/" + "/".join(rr.escape_entity_path_part(part) for part in (kind, name))
        x, y, theta = shape["pose"]
        mark = kind in MARKED
        if shape.get("movable") or kind == "flame":
            self.lanes[f"movable {name}"] = self._movable[name] = Lane(path, _poses)
            # Not static, which would hide every later pose: it goes out with the first tick.
            self._first[name] = (x, y, theta)
        else:
            turn = rr.RotationAxisAngle([0, 0, 1], radians=theta)
            _log(stream, path, rr.Transform3D(translation=[x, y, 0], rotation=turn))
        height = float(shape.get("height", 0.0))
        look: dict[str, Any] = {
            "labels": [name if mark else f"{name}, {1000 * height:.0f} mm high"],
            "show_labels": mark,
            "draw_order": {"base": 3.0, **MARKED}.get(kind, 6.0),
        }
        colour = colours.shape(kind, bool(shape.get("movable")))
        # What the lamp is seen over is darker than what hides it.
        bright = kind in ("lamp", "flame", "mover")
        fill = colours.mixed(colour, 1.0 if bright else 0.3 if height < LOW else 0.6)
        if "radius" in shape:
            disc = rr.Points2D([[0, 0]], radii=shape["radius"], colors=colours.packed(fill), **look)
            _log(stream, f"{path}/shape", disc)
            return
        points = np.asarray(shape["polygon"], np.float64)
        outline = np.vstack([points, points[:1]])
        edge = rr.LineStrips2D([outline], radii=0.0015, colors=colours.packed(colour), **look)
        _log(stream, f"{path}/shape", edge)
        strips, half = hatching(points)
        inside = rr.LineStrips2D(
            strips, radii=1.15 * half, colors=colours.packed(fill), draw_order=look["draw_order"] - 1
        )
        _log(stream, f"{path}/filling", inside)
        if kind == "base":  # its lamp stands in its middle, and so would its name
            at = [[0, 0.2 * points[:, 1].min() + 0.8 * points[:, 1].max()]]
            name_only = rr.Points2D(at, radii=0.0, colors=colours.packed(colour), labels=["base"], show_labels=True)
            _log(stream, f"{path}/name", name_only)

    def _another(self, stream: rr.RecordingStream, shape: Mapping[str, Any]) -> None:
        """Another robot: its body, its name and its trail; what it reads, nobody here knows."""
        name = str(shape["name"])
        path, colour = f"/world/robots/{rr.escape_entity_path_part(name)}", colours.other(len(self._others))
        self.lanes[name] = self._movable[name] = Lane(path, _poses)
        self.lanes[f"trail {name}"] = self._others[name] = Lane(_trail(name), _points)
        x, y, theta = shape["pose"]
        self._first[name] = (x, y, theta)
        _robot(stream, path, colour)
        # A label has its point's colour, and the disc's is the ground's.
        named = rr.Points2D([[0, 0]], radii=0.0, colors=colours.packed(colour), labels=[name], show_labels=True)
        _log(stream, f"{path}/name", named)
        _trail_of(stream, _trail(name), colour)

    def write(self, tick: Tick, stamp: Stamp) -> None:
        """Keep one tick's rows."""
        if tick.pose is not None:
            self.lanes["robot"].add(stamp, tick.pose)
            self.lanes["trail"].add(stamp, tick.pose[:2])
        proximity, light = readings(tick, "N"), readings(tick, "O")
        self.lanes["proximity"].add(stamp, None if proximity is None else proximity / 1023)
        self.lanes["light"].add(stamp, None if light is None else np.clip(1 - light / DARK, 0, 1))
        moved, self._first = {**self._first, **tick.moved}, {}
        for name, pose in moved.items():
            lane = self._movable.get(name)
            if lane is not None:
                lane.add(stamp, pose)
            if name in self._others:
                self._others[name].add(stamp, pose[:2])


def _trail_of(stream: rr.RecordingStream, path: str, colour: int) -> None:
    """The trail's look, once; its points come tick by tick."""
    look = rr.Points2D.from_fields(radii=[0.003], colors=colours.packed(colours.faded(colour, 0.6)))
    _log(stream, path, look)


def _robot(stream: rr.RecordingStream, path: str, colour: int) -> None:
    turn = np.linspace(0, 2 * np.pi, 49)
    rim = RADIUS * np.column_stack([np.cos(turn), np.sin(turn)])
    wheels = [[[-0.0075, y], [0.0075, y]] for y in (0.0265, -0.0265)]
    _log(
        stream,
        f"{path}/body",
        rr.LineStrips2D(
            [rim, *wheels, [[0.008, 0], [RADIUS, 0]]],
            radii=[0.0014, 0.0024, 0.0024, 0.0022],
            colors=colours.packed(colour, colours.LEFT, colours.RIGHT, colour),
            draw_order=50.0,
        ),
    )
    _log(
        stream,
        f"{path}/disc",
        rr.Points2D([[0, 0]], radii=RADIUS, colors=colours.packed(0x2B3340FF), draw_order=40.0),
    )


def _rays_of(stream: rr.RecordingStream) -> None:
    for kind, colour, width in (("light", colours.LAMP, 0.0012), ("proximity", colours.DRAWN, 0.0024)):
        _log(
            stream,
            f"/world/robot/{kind}",
            rr.LineStrips2D.from_fields(
                colors=colours.packed(colours.faded(colour, 0.9)), radii=[width], draw_order=45.0
            ),
        )


def _floor(stream: rr.RecordingStream, size: tuple[float, float]) -> None:
    width, height = size
    edge = np.array([[0, 0], [width, 0], [width, height], [0, height], [0, 0]])
    _log(stream, "/world/floor", rr.LineStrips2D([edge], radii=0.003, colors=colours.packed(colours.WALL)))


def hatching(points: NDArray[np.float64], lines: int = 24) -> tuple[NDArray[np.float32], float]:
    """A polygon (n, 2) filled by level strokes, since the viewer fills none: strokes (m, 2, 2), half their width.

    Strokes have round ends, so each stops half its width before the edge.
    """
    low, high = points[:, 1].min(), points[:, 1].max()
    half = (high - low) / lines / 2
    after = np.roll(points, -1, axis=0)
    strokes = []
    for y in low + half * (2 * np.arange(lines) + 1):
        crossed = (points[:, 1] <= y) != (after[:, 1] <= y)
        (x0, y0), (x1, y1) = points[crossed].T, after[crossed].T
        ends = np.sort(x0 + (y - y0) * (x1 - x0) / (y1 - y0))
        for left, right in zip(ends[::2], ends[1::2], strict=True):
            if right - left > 2 * half:
                strokes.append([[left + half, y], [right - half, y]])
    return np.array(strokes, np.float32).reshape(-1, 2, 2), float(half)


def _poses(rows: list[Pose]) -> Columns:
    x, y, theta = np.array(rows, np.float64).T
    zero = np.zeros(len(rows))
    return rr.Transform3D.columns(
        translation=np.column_stack([x, y, zero]),
        quaternion=np.column_stack([zero, zero, np.sin(theta / 2), np.cos(theta / 2)]),
    )


def _points(rows: list[tuple[float, float]]) -> Columns:
    return rr.Points2D.columns(positions=np.array(rows))


def _rays(rows: list[NDArray[np.float64] | None]) -> Columns:
    """Eight strokes a row in the robot's frame, as long as the reading (0..1) is strong."""
    strips = [
        np.stack([_ROOT, _ROOT + _WAY * (RAY * row[:, None])], axis=1).astype(np.float32)
        for row in rows
        if row is not None
    ]
    columns = rr.LineStrips2D.columns(strips=np.concatenate(strips) if strips else [])
    return columns.partition([0 if row is None else 8 for row in rows])


def _log(stream: rr.RecordingStream, path: str, what: Any) -> None:
    stream.log(path, what, static=True, strict=True)
