"""The way back: a run's folder as it was recorded, and whatever is wrong with one said in a sentence.

Reading parses JSON and nothing else: nothing in a folder is ever executed or unpickled. What a file says is
looked at before anybody works with it, so that a damaged or foreign one raises RecordingError with its name (and
the line), here and nowhere later.
"""

from __future__ import annotations

import fcntl
import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from khepera_hil.errors import RecordingError
from khepera_hil.recording import FORMAT, LOG, MANIFEST, Pose, Tick, Value, log_file

__all__ = ["Run", "find", "read_manifest", "read_ticks", "recorded", "tick_of"]

LONGEST = 1 << 20
"""Bytes that a line of the log may have; the programs' are below ten thousand."""

LARGEST = 64 << 20
"""Bytes that a manifest may have."""

FAR = 1e9
"""No time (s), delay (ms) or place (m) of a run is beyond this; the viewer's nanoseconds would overflow."""

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
            with (self.folder / LOG).open("rb") as log:
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
                with path.open("rb") as log:
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
    for folder in (Path(name), runs / name):
        if folder.is_dir():
            return Run(folder, read_manifest(folder))
    if Path(name).exists():
        raise RecordingError(f"{name} is a file, and a run is a folder with {MANIFEST} in it")
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
        with path.open("rb") as file:
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
        _check(manifest)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
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
            with path.open("rb") as log:
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
            t=_number(row["t"]),
            missed=int(row["missed"]),
            state=str(row.get("state", "")),  # logs of before have none
            raw={str(k): str(v) for k, v in row["raw"].items()},
            orders=[str(order) for order in row["orders"]],
            evidence={str(k): _value(v) for k, v in row["evidence"].items()},
            clipped={str(k): int(v) for k, v in row["clipped"].items()},
            u={str(k): _uniform(v) for k, v in row["u"].items()},
            draws={str(k): _value(v) for k, v in row["draws"].items()},
            command=None if row["command"] is None else (int(row["command"][0]), int(row["command"][1])),
            events=[(str(level), str(text)) for level, text in row["events"]],
            late_ms=_number(row["late_ms"]),
            work_ms=_number(row["work_ms"]),
            wall=_number(row["wall"], 10 * FAR),
            pose=None if row["pose"] is None else _pose(row["pose"]),
            moved={str(k): _pose(v) for k, v in row["moved"].items()},
        )
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise RecordingError(f"tick {row.get('tick')!r} of the log is damaged: {_said(error)}") from None


def _log_files(folder: Path) -> list[str]:
    """The log's files that are there, in order."""
    first = [LOG] if (folder / LOG).exists() else []
    return first + sorted(path.name for path in folder.glob("ticks-[0-9][0-9][0-9][0-9].jsonl"))


def _row(line: bytes, where: str) -> dict[str, Any]:
    try:
        row = _load(line)
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{where} is damaged: {error}") from None
    if not isinstance(row, dict) or type(row.get("tick")) is not int or not 0 <= row["tick"] < 1 << 53:
        raise RecordingError(f"{where} is not a tick")
    return row


def _check(manifest: Mapping[str, Any]) -> None:
    """Refuse by any of the errors that wrong kinds raise what the readers of a manifest rely on."""
    keys = set()
    for question in manifest.get("questions") or []:
        key, variables, values = question["key"], question["variables"], question["values"]
        keys.add(key)
        _need(isinstance(key, str) and isinstance(question["name"], str), "a question has no name")
        _need(bool(variables) and len(variables) == len(values), f"question {key!r} has no variables or no values")
        for variable, domain in zip(variables, values, strict=True):
            _need(isinstance(variable, str), f"a variable of question {key!r} has no name")
            _need(bool(domain) and len(set(map(_value, domain))) == len(domain), f"{variable} has no values")
    _need(len(keys) == len(manifest.get("questions") or []), "two questions have one key")
    for name, domain in (manifest.get("evidence") or {}).items():
        _need(all(_value(value) is not None for value in domain), f"{name} has no values")
    for name in ("ending", "versions", "robot"):
        _need(isinstance(manifest.get(name) or {}, dict), f"{name} is no object")
    ending = manifest.get("ending") or {}
    _need(isinstance(ending.get("score") or {}, dict), "the score is no object")
    _need(_number(manifest.get("period_s", 0.1)) > 0, "the period is none")
    _need(isinstance(manifest.get("program", "?"), str), "the program has no name")
    world = manifest.get("world")
    if world is not None:
        width, depth = world["size"]
        _need(_number(width) > 0 and _number(depth) > 0, "the arena has no size")
        for shape in world["shapes"]:
            _pose(shape["pose"])
            _need(isinstance(shape["name"], str) and isinstance(shape["kind"], str), "a shape has no name")
            _number(shape.get("height", 0.0))
            if "radius" in shape:
                _need(_number(shape["radius"]) > 0, "a shape has no size")
            else:
                _need(len([(_number(x), _number(y)) for x, y in shape["polygon"]]) > 2, "a polygon has no corners")


def _need(good: bool, otherwise: str) -> None:
    if not good:
        raise ValueError(otherwise)


def _load(text: bytes) -> Any:
    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is not a number")

    return json.loads(text.decode("utf-8"), parse_constant=refuse)


def _number(value: Any, beyond: float = FAR) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(f"{value!r} is not a number")
    if not (math.isfinite(value) and abs(value) <= beyond):
        raise ValueError(f"{value!r} is out of range")
    return float(value)


def _uniform(value: Any) -> float:
    number = _number(value)
    if not 0 <= number < 1:
        raise ValueError(f"the uniform number {value!r} is not in [0, 1)")
    return number


def _pose(value: Any) -> Pose:
    x, y, theta = value
    return _number(x), _number(y), _number(theta)


def _value(value: Any) -> Value:
    if isinstance(value, (str, bool)):
        return value
    number = _number(value)
    return value if isinstance(value, int) else number


def _said(error: Exception) -> str:
    return f"it has no {error}" if isinstance(error, KeyError) else str(error)


def _unreadable(path: Path, error: OSError) -> RecordingError:
    return RecordingError(f"{path} cannot be read: {error.strerror or error}")
