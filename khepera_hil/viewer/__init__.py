"""The viewer's file of a run, ``run.rrd``: derived from the log's ticks, with its own layout inside.

Importing this package does not import rerun, which takes half a second and 60 MB; opening a file does.
All calls into rerun are made by whoever calls the sink, in practice one follower's thread.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from khepera_hil.reading import read_manifest, read_ticks, tick_of
from khepera_hil.recording import Tick

if TYPE_CHECKING:
    from khepera_hil.viewer.sink import RerunFile

__all__ = ["FILE", "ROWS_FAST", "ROWS_WALL", "open_file", "remake"]

FILE = "run.rrd"

ROWS_WALL = 10
"""Ticks held back with the wall clock: a killed process loses the last second of the file (never of the log)."""

ROWS_FAST = 50
"""Ticks held back with the simulated clock, where a killed run is simply run again; a smaller, cheaper file."""


def open_file(path: Path | str, manifest: Mapping[str, Any], *, rows: int) -> RerunFile:
    """A sink that writes a run of ``manifest`` to ``path`` (overwritten), ``rows`` ticks to a chunk."""
    # rerun's own log would speak between our lines; what it loses is found at the flush, and told once.
    os.environ.setdefault("RUST_LOG", "off")
    from khepera_hil.viewer.sink import RerunFile  # late: this is what imports rerun

    return RerunFile(Path(path), manifest, rows=rows)


def remake(folder: Path | str, ticks: Iterable[Tick] | None = None) -> Path:
    """Make ``run.rrd`` of a run's folder anew from its manifest and log; the old one stays until it is whole.

    The log has only the hashes of the distributions: to have them in the file, pass ``ticks`` whose answers
    were computed again. Raises RecordingError when manifest or log are damaged.
    """
    path = Path(folder) / FILE
    manifest = read_manifest(folder)
    beside = path.with_suffix(".rrd.new")
    sink = open_file(beside, manifest, rows=ROWS_FAST)
    try:
        for tick in ticks if ticks is not None else map(tick_of, read_ticks(folder)):
            sink.write(tick, 0)
    except BaseException:
        sink.close()
        beside.unlink()
        raise
    sink.close()
    os.replace(beside, path)
    return path
