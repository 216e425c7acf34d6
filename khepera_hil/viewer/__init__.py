"""Runs in the rerun viewer: the file ``run.rrd``, derived from the log's ticks, live views, and pictures.

Importing this package does not import rerun, which takes half a second and 60 MB; opening something does. All calls
into rerun are made by whoever calls the sink, in practice one follower's thread for each.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from khepera_hil.errors import RecordingError
from khepera_hil.follower import Follower
from khepera_hil.reading import read_manifest, read_ticks, tick_of
from khepera_hil.recording import Tick

if TYPE_CHECKING:
    from khepera_hil.viewer.segments import Segments

__all__ = ["FILE", "PIECE", "ROWS_FAST", "ROWS_WALL", "files", "open_file", "remake"]

FILE = "run.rrd"

ROWS_WALL = 10
"""Ticks held back with the wall clock: a killed process loses the last second of the file (never of the log)."""

ROWS_FAST = 200
"""Ticks held back with the simulated clock, where a killed run is simply run again; a smaller, cheaper file."""

PIECE = 1200.0
"""Seconds of the robot's time in one file, some 80 MB; a longer run has ``run-0001.rrd`` and so on."""

PATIENCE = 15.0
"""Seconds for which the making of a file may stand still."""


def open_file(path: Path | str, manifest: Mapping[str, Any], *, rows: int, seconds: float = PIECE) -> Segments:
    """A sink that writes a run of ``manifest`` to ``path`` (overwritten), ``rows`` ticks to a chunk."""
    # rerun's own log would speak between our lines; what it loses is found at the flush, and told once.
    os.environ.setdefault("RUST_LOG", "off")
    from khepera_hil.viewer.segments import Segments  # late: this is what imports rerun

    return Segments(Path(path), manifest, rows=rows, seconds=seconds)


def files(folder: Path | str) -> list[Path]:
    """The viewer's files of a run that are there, in order."""
    first = Path(folder) / FILE
    return [path for path in [first, *sorted(Path(folder).glob("run-[0-9][0-9][0-9][0-9].rrd"))] if path.exists()]


def remake(
    folder: Path | str,
    ticks: Iterable[Tick] | None = None,
    *,
    into: Path | str | None = None,
    seconds: float = PIECE,
) -> list[Path]:
    """Make the viewer's files of a run anew from its manifest and log; the old ones stay until the new are whole.

    The log has only the hashes of the distributions: to have them in the file, pass ``ticks`` whose answers
    were computed again. ``into`` is another folder for them. Raises RecordingError when manifest or log are
    damaged, or the files cannot be written.
    """
    manifest = read_manifest(folder)
    target = Path(folder if into is None else into)
    try:
        beside = Path(tempfile.mkdtemp(prefix="viewer-", dir=target))
    except OSError as error:
        raise RecordingError(f"{target} cannot be written: {error.strerror or error}") from None
    try:
        _make(beside / FILE, manifest, ticks if ticks is not None else map(tick_of, read_ticks(folder)), seconds)
        for old in files(target):
            old.unlink()
        made = [new.replace(target / new.name) for new in files(beside)]
    except OSError as error:
        raise RecordingError(f"{target} cannot be written: {error.strerror or error}") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)
    return made


def _make(path: Path, manifest: Mapping[str, Any], ticks: Iterable[Tick], seconds: float) -> None:
    """Write it in a thread that is given up when nothing goes on: on a full disk rerun may wait for ever."""
    follower: Follower[Tick] = Follower(
        lambda: open_file(path, manifest, rows=ROWS_FAST, seconds=seconds),
        name=FILE,
        waits=True,
        patience=PATIENCE,
        deadline=PATIENCE,
    )
    follower.wait_until_open()
    losses = [follower.error] if follower.error is not None else []
    if not losses:
        try:
            for tick in ticks:
                if follower.error is not None:
                    break
                follower.offer(tick)
        finally:
            losses = follower.close()
    if losses:
        raise RecordingError(
            f"the viewer's file cannot be written in {path.parent.parent}, is there room? {losses[0]}"
        )
