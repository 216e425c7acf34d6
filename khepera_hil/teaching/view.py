"""What somebody sees who stands beside the arena and looks at it from above."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, inf, pi, sin
from typing import Any, Protocol

__all__ = ["BODY", "Eyes", "Seen", "View"]

Pose = tuple[float, float, float]

BODY = 0.0285
"""The robot's radius, m."""


class Eyes(Protocol):
    """Who can see the arena: the emulator's witness. Metres, radians counter-clockwise."""

    def shapes(self) -> list[dict[str, Any]]:
        """Everything there is, at its starting pose."""

    def poses(self) -> Mapping[str, Pose]:
        """Where the robot and all that can be moved are now."""


@dataclass(frozen=True)
class Seen:
    """A thing as it lies from the robot: ``gap`` from its body's edge (mm), ``bearing`` of its nearest point
    (degrees, clockwise positive, 0 ahead), ``centre`` the bearing of its middle.
    """

    name: str
    gap: float
    bearing: float
    centre: float


class View:
    """The arena at a glance."""

    def __init__(self, eyes: Eyes) -> None:
        self._eyes = eyes
        shapes = eyes.shapes()
        self._solid = [s for s in shapes if s["kind"] not in ("lamp", "base") and s["name"] != "robot"]
        self._lamps = [shape for shape in shapes if shape["kind"] == "lamp"]

    def look(self) -> list[Seen]:
        """Every solid thing, the nearest first."""
        poses = self._eyes.poses()
        robot = poses["robot"]
        seen = [self._seen(shape, poses.get(shape["name"], tuple(shape["pose"])), robot) for shape in self._solid]
        return sorted(seen, key=lambda thing: thing.gap)

    def lamp(self) -> Seen | None:
        """The nearest lamp."""
        robot = self._eyes.poses()["robot"]
        lamps = [self._seen(shape, tuple(shape["pose"]), robot) for shape in self._lamps]
        return min(lamps, key=lambda lamp: lamp.gap, default=None)

    def _seen(self, shape: dict[str, Any], pose: Pose, robot: Pose) -> Seen:
        x, y = nearest_point(shape, pose, robot)
        reach = 0.0 if "polygon" in shape else shape.get("radius", 0.0)
        gap = hypot(x - robot[0], y - robot[1]) - reach - BODY
        return Seen(shape["name"], 1000 * gap, _bearing(robot, x, y), _bearing(robot, pose[0], pose[1]))


def nearest_point(shape: dict[str, Any], pose: Pose, robot: Pose) -> tuple[float, float]:
    """The point of a polygon's outline that is nearest to the robot, or a disc's centre; m."""
    if "polygon" not in shape:
        return pose[0], pose[1]
    cosine, sine = cos(pose[2]), sin(pose[2])
    corners = [(pose[0] + cosine * x - sine * y, pose[1] + sine * x + cosine * y) for x, y in shape["polygon"]]
    best, found = inf, corners[0]
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        dx, dy = bx - ax, by - ay
        along = ((robot[0] - ax) * dx + (robot[1] - ay) * dy) / max(dx * dx + dy * dy, 1e-12)
        along = min(1.0, max(0.0, along))
        x, y = ax + along * dx, ay + along * dy
        if (far := hypot(x - robot[0], y - robot[1])) < best:
            best, found = far, (x, y)
    return found


def _bearing(robot: Pose, x: float, y: float) -> float:
    """Degrees clockwise from where the robot looks, in (-180, 180]."""
    turn = robot[2] - atan2(y - robot[1], x - robot[0])
    return degrees((turn + pi) % (2 * pi) - pi)
