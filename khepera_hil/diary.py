"""The emulated robots' own log: what really happened, where the clients at the other ends cannot see it.

JSON lines, each one object that was handed to the kernel by one write: first ``{"start": ...}`` with the robot and
its arena, then a line for each tenth of a second in which anything happened, and ``{"end": ..., "score": ...}``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from khepera_hil.errors import RecordingError
from khepera_hil.faults import Fault
from khepera_hil.world import World, name_of

__all__ = ["Diary"]

_PERIOD = 0.1
_MOST = 100  # requests told in a line; a fast line carries five hundred in this time, and all are counted
_MOVED = 1e-6  # m or rad

_Pose = tuple[float, float, float]


class Diary:
    """Keeps the log of ``world`` in the file ``path``, behind what is there already; ``about`` is the start's.

    A line has ``t`` (s since power-up), ``pose`` (x m, y m, theta rad, the true ones), ``charge`` (of the battery,
    0..1), and where there are any ``requests`` (the lines that the robot took up, ``more`` if not all are told),
    ``moved`` (movable things whose pose changed, by name) and ``faults`` (what was done to the line: when, bytes to
    whom, which kind, to what). Of several robots a line has what belongs to each under ``robots``, by name, for
    those of which there is anything to tell, and the end has ``scores``. A full disk ends the log, not the robot:
    ``complain`` is told once.

    Raises RecordingError when the file cannot be opened.
    """

    def __init__(
        self, path: Path, world: World, about: Mapping[str, Any], *, complain: Callable[[str], None]
    ) -> None:
        self._path, self._world, self._complain = path, world, complain
        try:
            # A pipe that nobody reads is refused, and one that is full ends the log: nothing here waits.
            flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NONBLOCK
            self._file: int | None = os.open(path, flags, 0o644)
        except OSError as error:
            raise RecordingError(f"the log {path} cannot be written: {error.strerror}") from None
        self._broken = False
        self._pages = {name_of(robot.number): _Page() for robot in world.robots}
        self._next = 0.0
        self._poses: dict[str, _Pose] = {}
        size = [side / 1000 for side in world.arena.size]
        self._write({"start": {**about, "size": size, "shapes": world.shapes()}})

    @property
    def whole(self) -> bool:
        """Whether all of it could be written."""
        return not self._broken

    def request(self, moment: float, line: bytes, robot: int = 1) -> None:
        """A robot took up a request."""
        self._pages[name_of(robot)].request(line)

    def fault(self, fault: Fault, robot: int = 1) -> None:
        """Something was done to a robot's line."""
        self._pages[name_of(robot)].faults.append((round(fault.at, 3), fault.way, fault.kind, fault.what))

    def watch(self, now: float) -> None:
        """Write a line if it is time for one and there is something to tell."""
        if now >= self._next:
            self._next = now + _PERIOD
            self._line(now)

    def close(self, now: float) -> None:
        """The last lines, with the score."""
        self._line(now)
        robots = self._world.robots
        scores = {name_of(robot.number): self._world.score(robot.number) for robot in robots}
        end = {"score": scores["robot"]} if len(robots) == 1 else {"scores": scores}
        self._write({"end": round(now, 3), **end})
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _line(self, now: float) -> None:
        poses = self._world.poses()
        moved = {name: pose for name, pose in poses.items() if _differ(pose, self._poses.get(name))}
        if not moved and not any(page.filled for page in self._pages.values()):
            return
        self._poses = poses
        line: dict[str, Any] = {"t": round(now, 3)}
        if len(self._pages) == 1:
            line |= self._told("robot", poses)
        else:
            line["robots"] = {
                name: self._told(name, poses) for name, page in self._pages.items() if name in moved or page.filled
            }
        if others := {name: _rounded(pose) for name, pose in moved.items() if name not in self._pages}:
            line["moved"] = others
        self._write(line)

    def _told(self, name: str, poses: Mapping[str, _Pose]) -> dict[str, Any]:
        """What belongs to one robot, which is then forgotten."""
        robot = next(one for one in self._world.robots if name_of(one.number) == name)
        return {"pose": _rounded(poses[name]), "charge": round(robot.battery.charge, 4), **self._pages[name].torn()}

    def _write(self, line: dict[str, Any]) -> None:
        if self._file is None:
            return
        data = json.dumps(line).encode("ascii") + b"\n"
        try:
            if os.write(self._file, data) < len(data):
                raise OSError(None, "no room left for a whole line")
        except OSError as error:
            os.close(self._file)
            self._file, self._broken = None, True
            self._complain(f"the log {self._path} ends here: {error.strerror}")


class _Page:
    """What one robot was asked, and what was done to its line, since the last line of the log."""

    def __init__(self) -> None:
        self._requests: list[str] = []
        self._more = 0
        self.faults: list[tuple[float, str, str, str]] = []

    @property
    def filled(self) -> bool:
        return bool(self._requests or self.faults)

    def request(self, line: bytes) -> None:
        if len(self._requests) < _MOST:
            self._requests.append(line.decode("ascii", "backslashreplace"))
        else:
            self._more += 1

    def torn(self) -> dict[str, Any]:
        """Its parts that are not empty; it is empty then."""
        parts = {"requests": self._requests, "faults": self.faults, "more": self._more}
        self._requests, self.faults, self._more = [], [], 0
        return {name: part for name, part in parts.items() if part}


def _differ(pose: _Pose, before: _Pose | None) -> bool:
    return before is None or any(abs(new - old) > _MOVED for new, old in zip(pose, before, strict=True))


def _rounded(pose: _Pose) -> list[float]:
    return [round(value, 6) for value in pose]
