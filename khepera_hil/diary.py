"""The emulated robot's own log: what really happened, where the client at the other end cannot see it.

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
from khepera_hil.world import World

__all__ = ["Diary"]

_PERIOD = 0.1
_MOST = 100  # requests told in a line; a fast line carries five hundred in this time, and all are counted
_MOVED = 1e-6  # m or rad


class Diary:
    """Keeps the log of ``world`` in the file ``path``, behind what is there already; ``about`` is the start's.

    A line has ``t`` (s since power-up), ``pose`` (x m, y m, theta rad, the true ones), ``charge`` (of the battery,
    0..1), and where there are any ``requests`` (the lines that the robot took up, ``more`` if not all are told),
    ``moved`` (movable things whose pose changed, by name) and ``faults`` (what was done to the line: when, bytes to
    whom, which kind, to what). A full disk ends the log, not the robot: ``complain`` is told once.

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
        self._requests: list[str] = []
        self._faults: list[tuple[float, str, str, str]] = []
        self._more = 0
        self._next = 0.0
        self._poses: dict[str, tuple[float, float, float]] = {}
        size = [side / 1000 for side in world.arena.size]
        self._write({"start": {**about, "size": size, "shapes": world.shapes()}})

    @property
    def whole(self) -> bool:
        """Whether all of it could be written."""
        return not self._broken

    def request(self, moment: float, line: bytes) -> None:
        """The robot took up a request."""
        if len(self._requests) < _MOST:
            self._requests.append(line.decode("ascii", "backslashreplace"))
        else:
            self._more += 1

    def fault(self, fault: Fault) -> None:
        """Something was done to the line."""
        self._faults.append((round(fault.at, 3), fault.way, fault.kind, fault.what))

    def watch(self, now: float) -> None:
        """Write a line if it is time for one and there is something to tell."""
        if now >= self._next:
            self._next = now + _PERIOD
            self._line(now)

    def close(self, now: float) -> None:
        """The last lines, with the score."""
        self._line(now)
        self._write({"end": round(now, 3), "score": self._world.score()})
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _line(self, now: float) -> None:
        poses = self._world.poses()
        moved = {name: pose for name, pose in poses.items() if _differ(pose, self._poses.get(name))}
        if not moved and not self._requests and not self._faults:
            return
        self._poses = poses
        charge = round(self._world.battery.charge, 4)
        line: dict[str, Any] = {"t": round(now, 3), "pose": _rounded(poses["robot"]), "charge": charge}
        if self._requests:
            line["requests"] = self._requests
        if self._faults:
            line["faults"], self._faults = self._faults, []
        if self._more:
            line["more"] = self._more
        if others := {name: _rounded(pose) for name, pose in moved.items() if name != "robot"}:
            line["moved"] = others
        self._requests, self._more = [], 0
        self._write(line)

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


def _differ(pose: tuple[float, float, float], before: tuple[float, float, float] | None) -> bool:
    return before is None or any(abs(new - old) > _MOVED for new, old in zip(pose, before, strict=True))


def _rounded(pose: tuple[float, float, float]) -> list[float]:
    return [round(value, 6) for value in pose]
