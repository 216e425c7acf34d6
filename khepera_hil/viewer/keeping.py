"""The viewer's file of a very long run: the last hour, and two minutes around whatever happened before that.

What is older is deleted, so that neither the disk nor the memory of the recorder fills up; the log keeps
everything.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rerun as rr

from khepera_hil.recording import Tick
from khepera_hil.viewer.segments import Segments, segment_file
from khepera_hil.viewer.sink import RerunSink

__all__ = ["Keeping"]

_PIECE = 1200.0
"""Seconds of one piece of the last hour."""

_LAST = 3600.0

_BEFORE = _AFTER = 60.0
"""Seconds of the two minutes around an event."""

_CLIPS = 200
"""So many two minutes are kept, the last ones."""


class Keeping:
    """A sink. An event is an order or anything that the program said of the world: not what is said of the line.

    The pieces of the last hour are ``run-0007.rrd``, those around events ``event-00012345.rrd`` by their first
    tick.
    """

    def __init__(self, path: Path, manifest: Mapping[str, Any], *, rows: int) -> None:
        self._path, self._manifest, self._rows = path, manifest, rows
        self._hour = Segments(path, manifest, rows=rows, seconds=_PIECE)
        self._oldest = 0
        self._past: deque[tuple[Tick, int]] = deque()
        self._clip: RerunSink | None = None
        self._until = 0.0
        self._clips: deque[Path] = deque()

    def write(self, tick: Tick, dropped: int) -> None:
        """Keep the tick, and delete what is too old."""
        self._hour.write(tick, dropped)
        piece = int(tick.t // _PIECE)
        while self._oldest < piece - _LAST / _PIECE:
            with contextlib.suppress(FileNotFoundError):  # nothing was recorded then
                segment_file(self._path, self._oldest).unlink()
            self._oldest += 1
        while self._past and self._past[0][0].t < tick.t - _BEFORE - 1e-6:
            self._past.popleft()
        if tick.orders or any(_happened(level, text) for level, text in tick.events):
            self._until = tick.t + _AFTER
            if self._clip is None:
                self._clip = self._open(tick)
                for before, lost in self._past:
                    self._clip.write(before, lost)
        self._past.append((tick, dropped))
        if self._clip is not None:
            self._clip.write(tick, dropped)
            if tick.t >= self._until:
                self._clip.close()
                self._clip = None

    def flush(self) -> None:
        """Bring out what is held back."""
        self._hour.flush()
        if self._clip is not None:
            self._clip.flush()

    def close(self) -> None:
        """Finish all files."""
        self._hour.close()
        if self._clip is not None:
            self._clip.close()

    def _open(self, tick: Tick) -> RerunSink:
        first = self._past[0][0] if self._past else tick
        path = self._path.with_name(f"event-{first.tick:08d}{self._path.suffix}")
        self._clips.append(path)
        while len(self._clips) > _CLIPS:
            self._clips.popleft().unlink(missing_ok=True)
        return RerunSink(rr.FileSink(str(path), write_footer=True), self._manifest, rows=self._rows)


def _happened(level: str, text: str) -> bool:
    return level == "alarm" or (level == "info" and any(word in text for word in ("fire", "object")))
