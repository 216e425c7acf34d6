"""The way back: a run's folder as it was recorded, and whatever is wrong with one said in a sentence.

Reading parses JSON and nothing else: nothing in a folder is ever executed or unpickled. What a file says is
looked at before anybody works with it, so that a damaged or foreign one raises RecordingError with its name (and
the line), here and nowhere later.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import stat
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from khepera_hil.errors import RecordingError
from khepera_hil.kinds import FAR, WRONG, as_number, as_pose, as_uniform, as_value, check_manifest
from khepera_hil.recording import FORMAT, LOG, MANIFEST, Tick, log_file

__all__ = ["Run", "find", "read_manifest", "read_ticks", "recorded", "tick_of"]

LONGEST = 1 << 20
"""Bytes that a line of the log may have; the programs' are below ten thousand."""

LARGEST = 64 << 20
"""Bytes that a manifest may have."""

LAST = "last"


@dataclass(frozen=True)
class Run:
    """A recorded run: its folder and its manifest, already looked at."""

    folder: Path
    manifest: Mapping[str, Any]

    @property
    def name(self) -> str:
        """The folder's name, under which ``--runs`` has it."""
        return self.folder.resolve().name

    @property
    def program(self) -> str:
        """What ran."""
        return str(self.manifest.get("program", "?"))

    @property
    def questions(self) -> list[dict[str, Any]]:
        """What was asked each tick, as the manifest has it: key, name, variables, values, main."""
        return list(self.manifest.get("questions") or [])

    def rows(self) -> Iterator[dict[str, Any]]:
        """The log's rows."""
        return read_ticks(self.folder)

    def ticks(self) -> Iterator[Tick]:
        """The log's ticks, without their distributions, of which the log has the hashes only."""
        return map(tick_of, self.rows())

    @property
    def going_on(self) -> bool:
        """Whether somebody is writing it at this moment."""
        try:
            with _opened(self.folder / LOG) as log:
                fcntl.flock(log, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return False
        return False

    def last_row(self) -> dict[str, Any] | None:
        """The last acknowledged tick, found from the end of the log; None where there is none."""
        names = _log_files(self.folder)
        for name in reversed(names):
            path = self.folder / name
            try:
                with _opened(path) as log:
                    size = log.seek(0, os.SEEK_END)
                    log.seek(max(0, size - 2 * LONGEST))
                    lines = log.read().split(b"\n")[:-1]  # what follows the last newline was never acknowledged
            except OSError as error:
                raise _unreadable(path, error) from None
            if lines:
                return _row(lines[-1], f"{path}, the last line")
        return None


def find(name: str | Path, runs: Path) -> Run:
    """The run that ``name`` means: a folder's path, a folder's name under ``runs``, or ``last``, the latest there.

    Raises RecordingError when there is none, or it is damaged.
    """
    if str(name) == LAST and not Path(name).is_dir():
        found = [run for run in recorded(runs) if isinstance(run, Run)]
        if not found:
            raise RecordingError(f"there is no recorded run in {runs}; make one with khepera-hil, or say --runs")
        return found[-1]
    try:
        for folder in (Path(name), runs / name):
            if folder.is_dir():
                return Run(folder, read_manifest(folder))
        if Path(name).exists():
            raise RecordingError(f"{name} is a file, and a run is a folder with {MANIFEST} in it")
    except OSError as error:
        raise _unreadable(Path(name), error) from None
    raise RecordingError(f"there is no run {name}, here or in {runs}; khepera-hil runs lists what there is")


def recorded(runs: Path) -> list[Run | RecordingError]:
    """The runs in a folder in the order of their start, and for each folder that looks like one and cannot be
    read the error that says why. Raises RecordingError when ``runs`` itself cannot be read.
    """
    try:
        folders = sorted(path for path in runs.iterdir() if path.is_dir())
    except FileNotFoundError:
        return []
    except OSError as error:
        raise _unreadable(runs, error) from None
    good: list[Run] = []
    bad: list[Run | RecordingError] = []
    for folder in folders:
        if not (folder / MANIFEST).exists() and not (folder / LOG).exists():
            continue  # somebody else's
        try:
            good.append(Run(folder, read_manifest(folder)))
        except RecordingError as error:
            bad.append(error)
    # Two of one second bear numbers: -2 comes before -10.
    good.sort(key=lambda run: (str(run.manifest.get("started", "")), len(run.name), run.name))
    return [*bad, *good]


def read_manifest(folder: Path | str) -> dict[str, Any]:
    """The manifest of a run's folder. Raises RecordingError when there is none, or it is not one of ours."""
    path = Path(folder) / MANIFEST
    try:
        with _opened(path) as file:
            text = file.read(LARGEST + 1)
        if len(text) > LARGEST:
            raise RecordingError(f"{path} is not the manifest of a run: it is larger than {LARGEST >> 20} MB")
        manifest = _load(text)
    except FileNotFoundError:
        raise RecordingError(f"{folder} is not a run's folder: there is no {MANIFEST} in it") from None
    except OSError as error:
        raise _unreadable(path, error) from None
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{path} is damaged: {error}") from None
    if not isinstance(manifest, dict) or not isinstance(manifest.get("format"), int):
        raise RecordingError(f"{path} is not the manifest of a run")
    if manifest["format"] > FORMAT:
        raise RecordingError(
            f"{path} has format {manifest['format']}, newer than {FORMAT}: use a newer khepera-hil"
        )
    try:
        check_manifest(manifest)
    except WRONG as error:
        raise RecordingError(f"{path} is damaged: {_said(error)}") from None
    return manifest


def read_ticks(folder: Path | str) -> Iterator[dict[str, Any]]:
    """The log's rows, in order, over all of its files. A last line without its end, left by a killed process, was
    never acknowledged and is passed over; anything else that is no tick raises RecordingError with file and line.
    """
    number, before = 0, -1
    while True:
        path = Path(folder) / log_file(number)
        number += 1
        following = Path(folder) / log_file(number)
        try:
            with _opened(path) as log:
                for at, line in enumerate(iter(lambda: log.readline(LONGEST), b""), 1):
                    where = f"{path}, line {at}"
                    if not line.endswith(b"\n"):
                        if len(line) < LONGEST and not following.exists():
                            return
                        raise RecordingError(f"{where} is damaged: it has no end")
                    row = _row(line, where)
                    if row["tick"] <= before:
                        raise RecordingError(f"{where} is damaged: tick {row['tick']} comes after tick {before}")
                    before = row["tick"]
                    yield row
        except OSError as error:
            raise _unreadable(path, error) from None
        if not following.exists():
            if len(_log_files(Path(folder))) > number:
                raise RecordingError(f"{following} is missing: a part of the log is lost")
            return


def tick_of(row: Mapping[str, Any]) -> Tick:
    """The tick of a log's row. Its probabilities are not in the log, so ``answers`` is empty.

    Raises RecordingError when a column is missing or of another kind.
    """
    try:
        return Tick(
            tick=int(row["tick"]),
            t=as_number(row["t"]),
            missed=int(row["missed"]),
            state=str(row.get("state", "")),  # logs of before have none
            raw={str(k): str(v) for k, v in row["raw"].items()},
            orders=[str(order) for order in row["orders"]],
            evidence={str(k): as_value(v) for k, v in row["evidence"].items()},
            clipped={str(k): int(v) for k, v in row["clipped"].items()},
            u={str(k): as_uniform(v) for k, v in row["u"].items()},
            draws={str(k): as_value(v) for k, v in row["draws"].items()},
            command=None if row["command"] is None else (int(row["command"][0]), int(row["command"][1])),
            events=[(str(level), str(text)) for level, text in row["events"]],
            late_ms=as_number(row["late_ms"]),
            work_ms=as_number(row["work_ms"]),
            wall=as_number(row["wall"], 10 * FAR),
            pose=None if row["pose"] is None else as_pose(row["pose"]),
            moved={str(k): as_pose(v) for k, v in row["moved"].items()},
        )
    except WRONG as error:
        raise RecordingError(f"tick {row.get('tick')!r} of the log is damaged: {_said(error)}") from None


def _log_files(folder: Path) -> list[str]:
    """The log's files that are there, in order."""
    first = [LOG] if (folder / LOG).exists() else []
    return first + sorted(path.name for path in folder.glob("ticks-[0-9][0-9][0-9][0-9].jsonl"))


def _opened(path: Path) -> BinaryIO:
    """The file, opened without waiting for it: a pipe in its place would never have an end."""
    file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise OSError(errno.EINVAL, "it is not a plain file")
    return os.fdopen(file, "rb")


def _row(line: bytes, where: str) -> dict[str, Any]:
    try:
        row = _load(line)
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{where} is damaged: {error}") from None
    if not isinstance(row, dict) or type(row.get("tick")) is not int or not 0 <= row["tick"] < 1 << 53:
        raise RecordingError(f"{where} is not a tick")
    return row


def _load(text: bytes) -> Any:
    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is not a number")

    found = json.loads(text.decode("utf-8"), parse_constant=refuse)
    if b"\\u" in text:  # an escape may make half a character, which nobody could print or export
        json.dumps(found, ensure_ascii=False).encode()
    return found


def _said(error: Exception) -> str:
    return f"it has no {error}" if isinstance(error, KeyError) else str(error)


def _unreadable(path: Path, error: OSError) -> RecordingError:
    return RecordingError(f"{path} cannot be read: {error.strerror or error}")
