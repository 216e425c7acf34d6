"""The viewer's file of a long run in pieces, so that neither memory nor a file grows without end.

A file's footer is kept in memory until the file is closed (about a kilobyte for each chunk), and no viewer likes
to open a whole day at once. Each piece has the layout and all that never changes; the pieces of a run share its
recording, so that a viewer that is given several shows them as one.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rerun as rr

from khepera_hil.recording import Pose, Tick
from khepera_hil.viewer.sink import RerunSink

__all__ = ["Segments", "segment_file"]


def segment_file(path: Path, number: int) -> Path:
    """The name of a run's pieces, counted from 0: ``run.rrd``, ``run-0001.rrd``, ..."""
    return path if number == 0 else path.with_name(f"{path.stem}-{number:04d}{path.suffix}")


class Segments:
    """A sink that begins a new piece after every ``seconds`` of the robot's time."""

    def __init__(self, path: Path, manifest: Mapping[str, Any], *, rows: int, seconds: float) -> None:
        self._path, self._manifest, self._rows, self._seconds = path, manifest, rows, seconds
        self._number = 0
        self._moved: dict[str, Pose] = {}
        self._sink = self._open()

    def write(self, tick: Tick, dropped: int) -> None:
        """Hand the tick on, to the next piece when this one is full."""
        if tick.t >= (self._number + 1) * self._seconds:
            self._number = int(tick.t // self._seconds)
            old, self._sink = self._sink, self._open()
            old.close()
        self._moved |= tick.moved
        self._sink.write(tick, dropped)

    def flush(self) -> None:
        """Bring out what is held back."""
        self._sink.flush()

    def close(self) -> None:
        """Finish the last piece."""
        self._sink.close()

    def _open(self) -> RerunSink:
        path = segment_file(self._path, self._number)
        return RerunSink(rr.FileSink(str(path), write_footer=True), self._where_things_are(), rows=self._rows)

    def _where_things_are(self) -> Mapping[str, Any]:
        """The manifest, but with what was moved where it is now."""
        world = self._manifest.get("world")
        if not world or not self._moved:
            return self._manifest
        shapes = [
            {**shape, "pose": list(self._moved.get(shape["name"], shape["pose"]))} for shape in world["shapes"]
        ]
        return {**self._manifest, "world": {**world, "shapes": shapes}}
