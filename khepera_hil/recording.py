"""A run's folder: what the robot said, what the program answered, what was sent, tick by tick.

``runs/<date>T<time>-<program>-<seed>/`` holds

* ``manifest.json``: program, seed, versions, the questions with their variables and values, the arena, and at
  the end how the run ended; it is replaced as a whole, so there is always a readable one;
* ``ticks.jsonl``: the log, one JSON object a line, and when it is large ``ticks-0001.jsonl``, ``ticks-0002.jsonl``
  ... after it. A tick is acknowledged when :meth:`Recording.write` has returned: its line was handed to the kernel
  by one unbuffered ``os.write``, and a killed process loses none. It is not forced to the disk: a power cut may
  cost the last seconds.

Everything else (the viewer's file, live views) is derived and hangs behind the log as a :class:`Listener`.
``reading`` is the way back.

The log's columns, one object a tick: ``tick`` (how many came before), ``t`` (s of robot time since the start),
``missed`` (deadlines skipped just before), ``state`` (of the service when the tick was done), ``raw`` (command
letter -> the robot's answer), ``orders`` (of the operator), ``evidence``, ``clipped`` (variable -> how often
perception clipped it), ``answers`` (key of a question -> hash of its probabilities), ``sketch`` (the same -> one
number made of them, see :meth:`Answer.sketch`), ``u`` (the uniform number behind each draw), ``draws``, ``command``
(left, right in pulse/10 ms as the robot acknowledged them, or null), ``pose`` (x m, y m, theta rad, or null),
``moved`` (movable shapes whose pose changed), ``events`` (level, text), ``late_ms``, ``work_ms``, ``wall``
(s since 1970).
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import importlib.metadata
import json
import math
import os
import platform
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from khepera_hil import __version__
from khepera_hil.errors import RecordingError

__all__ = [
    "FORMAT",
    "HOST_COLUMNS",
    "LOG",
    "MANIFEST",
    "Answer",
    "Listener",
    "Pose",
    "Recording",
    "Tick",
    "Value",
    "log_file",
]

MANIFEST = "manifest.json"
LOG = "ticks.jsonl"

SEGMENT = 32 << 20
"""Bytes of one file of the log; an hour at 10 Hz takes some 20 MB."""

FORMAT = 1
"""Version of the folder's layout; a reader refuses a newer one."""

HOST_COLUMNS = ("work_ms", "late_ms", "wall")
"""Columns of the log that belong to the host: two runs that are the same differ here and nowhere else."""

_PACKAGES = ("numpy", "scipy", "pymunk", "pyserial", "python-statemachine", "rerun-sdk")

Value = int | float | str
"""A variable's value: a number or one of the paper's words."""

Pose = tuple[float, float, float]
"""x and y in metres, theta in radians, counter-clockwise; x right, y up."""


@dataclass(frozen=True)
class Answer:
    """What a question answered: the probabilities of ``variables`` over ``values``.

    ``values`` holds one tuple for each variable; ``p`` is float64 and its shape is the variables' sizes. The
    array is kept, not copied: whoever hands it over does not change it any more.
    """

    question: str
    variables: tuple[str, ...]
    values: tuple[tuple[Value, ...], ...]
    p: NDArray[np.float64]

    def digest(self) -> str:
        """BLAKE2b, 8 bytes in hex, of the probabilities as little-endian float64 in C order."""
        return hashlib.blake2b(np.ascontiguousarray(self.p, "<f8").tobytes(), digest_size=8).hexdigest()

    def sketch(self) -> float:
        """One number that tells how far apart two distributions are whose hashes differ.

        The sum of ``p[i] * w[i]`` in C order with ``w[i] = 2 * ((i + 1) * golden mod 1) - 1``, golden = 0.618...:
        no further apart than the distributions' absolute differences in sum, and alike only by rare chance where
        those are not.
        """
        return float(self.p.ravel() @ _weights(self.p.size))


@lru_cache(maxsize=64)
def _weights(size: int) -> NDArray[np.float64]:
    places = np.arange(1, size + 1, dtype=np.float64)
    weights: NDArray[np.float64] = 2.0 * np.fmod(places * 0.6180339887498949, 1.0) - 1.0
    return weights


@dataclass(slots=True)
class Tick:
    """One turn of the loop. Not to be changed once it is written: listeners read it in their own time.

    ``answers`` and ``draws`` are keyed by the question's short role ("Vrot", "H"): a draw stands under the key
    of the question that it was drawn from. See the module's text for units.
    """

    tick: int
    t: float
    state: str = ""
    raw: dict[str, str] = field(default_factory=dict)
    orders: list[str] = field(default_factory=list)
    evidence: dict[str, Value] = field(default_factory=dict)
    clipped: dict[str, int] = field(default_factory=dict)
    answers: dict[str, Answer] = field(default_factory=dict)
    u: dict[str, float] = field(default_factory=dict)
    draws: dict[str, Value] = field(default_factory=dict)
    command: tuple[int, int] | None = None
    events: list[tuple[str, str]] = field(default_factory=list)
    missed: int = 0
    late_ms: float = 0.0
    work_ms: float = 0.0
    wall: float = 0.0
    pose: Pose | None = None
    moved: dict[str, Pose] = field(default_factory=dict)

    def line(self) -> bytes:
        """The tick as one line of the log. Raises RecordingError when something in it is no JSON."""
        row = {
            "tick": self.tick,
            "t": _short(self.t, 6),
            "missed": self.missed,
            "state": self.state,
            "raw": self.raw,
            "orders": self.orders,
            "evidence": self.evidence,
            "clipped": self.clipped,
            "answers": {key: answer.digest() for key, answer in self.answers.items()},
            "sketch": {key: _sketched(answer) for key, answer in self.answers.items()},
            "u": self.u,  # exact: a replay draws with it again
            "draws": self.draws,
            "command": self.command,
            "pose": None if self.pose is None else [_short(v, 6) for v in self.pose],
            "moved": {name: [_short(v, 6) for v in pose] for name, pose in self.moved.items()},
            "events": self.events,
            "late_ms": _short(self.late_ms, 3),
            "work_ms": _short(self.work_ms, 3),
            "wall": _short(self.wall, 6),
        }
        try:
            return _LINE.encode(row).encode() + b"\n"
        except (TypeError, ValueError) as error:
            culprit = next((name for name, value in row.items() if not _is_json(value)), "?")
            raise RecordingError(
                f"tick {self.tick} cannot be logged: its column {culprit!r} holds {row.get(culprit)!r}, "
                f"which is no JSON ({error})"
            ) from None


class Listener(Protocol):
    """Who hears of every tick after it was logged. A listener never raises and never holds the loop's clock up."""

    def offer(self, tick: Tick) -> None:
        """Take the tick, or drop and count it."""

    def close(self) -> list[str]:
        """Finish within a bounded time; sentences for the user when something was lost, else nothing."""


class Recording:
    """The open folder of a run that is going on. Made by :meth:`create`; one thread writes."""

    def __init__(self, folder: Path, manifest: dict[str, Any], log: int, segment: int = SEGMENT) -> None:
        self.folder = folder
        self.manifest = manifest
        self._log: int | None = log
        self._files = [log]
        self._segment = segment
        self._room = segment
        self._listeners: list[Listener] = []

    @classmethod
    def create(
        cls,
        runs_dir: Path | str,
        *,
        program: str,
        seed: int,
        manifest: Mapping[str, Any],
        started: datetime,
        segment: int = SEGMENT,
    ) -> Recording:
        """Make the folder, its manifest and its empty log; never overwrite (``-2``, ``-3`` ... when taken).

        ``manifest`` is what the caller knows (questions, arena, port, period, data); program, seed, start,
        versions and host are added. A file of the log takes ``segment`` bytes. Raises RecordingError when the
        folder cannot be made.
        """
        whole: dict[str, Any] = {
            "program": program,
            "seed": seed,
            "started": started.isoformat(timespec="seconds"),
            "versions": _versions(),
            "python": platform.python_version(),
            "platform": platform.platform(),
            "host_columns": list(HOST_COLUMNS),
            **manifest,
        }
        name = f"{started:%Y-%m-%dT%H-%M-%S}-{program}-{seed}"
        folder = None
        try:
            Path(runs_dir).mkdir(parents=True, exist_ok=True)
            folder = _new_folder(Path(runs_dir), name)
            whole = {"format": FORMAT, "run": folder.name, **whole}
            _replace(folder / MANIFEST, whole)
            log = _new_file(folder / LOG)
        except OSError as error:
            if folder is not None:
                with contextlib.suppress(OSError):  # half a folder is no run
                    (folder / MANIFEST).unlink(missing_ok=True)
                    folder.rmdir()
            raise RecordingError(
                f"the run's folder cannot be made in {runs_dir}: {error.strerror or error}; "
                "choose a folder that can be written with --runs"
            ) from None
        with contextlib.suppress(OSError):  # where files cannot be locked nobody can see that the run goes on
            fcntl.flock(log, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return cls(folder, whole, log, segment)

    def follow(self, listener: Listener) -> None:
        """Let ``listener`` hear of every tick from now on."""
        self._listeners.append(listener)

    def write(self, tick: Tick) -> None:
        """Log the tick by one ``os.write``, then tell the listeners.

        Raises RecordingError when the line was not taken whole; what was taken of it is cut off again.
        """
        if self._log is None:
            raise RecordingError(f"the recording {self.folder} is closed")
        line = tick.line()
        if len(line) > self._room:
            self._next_file()
        try:
            taken = os.write(self._log, line)
        except OSError as error:
            raise self._unwritten(tick, error.strerror or str(error)) from None
        self._room -= taken
        if taken != len(line):
            with contextlib.suppress(OSError):
                os.ftruncate(self._log, os.fstat(self._log).st_size - taken)
            raise self._unwritten(tick, f"only {taken} of {len(line)} bytes were taken, the disk may be full")
        for listener in self._listeners:
            listener.offer(tick)

    def close(self, ending: Mapping[str, Any]) -> list[str]:
        """Finish: log to disk, listeners closed, ``ending`` (how and why) in the manifest.

        Returns sentences about what the listeners lost. Closing twice does nothing. Raises RecordingError
        when the manifest cannot be written; the log is whole all the same.
        """
        if self._log is None:
            return []
        self._log = None
        for log in self._files:
            with contextlib.suppress(OSError):  # a file that cannot be synced is as written as it will be
                os.fsync(log)
            os.close(log)
        losses = [sentence for listener in self._listeners for sentence in listener.close()]
        self.manifest["ending"] = {**ending, "losses": losses}
        try:
            _replace(self.folder / MANIFEST, self.manifest)
        except OSError as error:
            raise RecordingError(
                f"how the run ended cannot be written to {self.folder / MANIFEST}: {error.strerror or error}"
            ) from None
        return losses

    def _next_file(self) -> None:
        """Go on in a new file. Where there can be none the old one goes on: no tick is lost for tidiness."""
        self._room = self._segment
        with contextlib.suppress(OSError):
            log = _new_file(self.folder / log_file(len(self._files)))
            # The full one stays open: it is synced at the end, when nobody waits for it.
            self._files.append(log)
            self._log = log

    def _unwritten(self, tick: Tick, why: str) -> RecordingError:
        return RecordingError(
            f"tick {tick.tick} cannot be written to {self.folder / LOG}: {why}; "
            "make room there, or choose another folder with --runs"
        )


def log_file(number: int) -> str:
    """The name of the log's files, counted from 0."""
    return LOG if number == 0 else f"ticks-{number:04d}.jsonl"


def _new_file(path: Path) -> int:
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC, 0o644)


def _new_folder(parent: Path, name: str) -> Path:
    number = 1
    while True:
        folder = parent / (name if number == 1 else f"{name}-{number}")
        try:
            folder.mkdir()
        except FileExistsError:
            number += 1
        else:
            return folder


def _replace(path: Path, content: Mapping[str, Any]) -> None:
    """Write the whole file beside the old one, then put it in its place: a reader sees one or the other."""
    handle, beside = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(_PAGE.encode(content).encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())
        os.chmod(beside, 0o644)  # mkstemp makes it private
        os.replace(beside, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(beside)
        raise


def _versions() -> dict[str, str]:
    found = {"khepera-hil": __version__}
    for package in _PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[package] = importlib.metadata.version(package)
    return found


def _plain(value: object) -> object:
    """Perception and draws may hand over numpy's scalars."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} is not a number, text, list or mapping")


# Made once, not for every tick.
_LINE = json.JSONEncoder(allow_nan=False, ensure_ascii=False, separators=(",", ":"), default=_plain)
_PAGE = json.JSONEncoder(allow_nan=False, ensure_ascii=False, indent=1, default=_plain)


def _is_json(value: object) -> bool:
    try:
        _LINE.encode(value)
    except (TypeError, ValueError):
        return False
    return True


def _sketched(answer: Answer) -> float | None:
    """An answer that is no distribution does not stop the log."""
    number = answer.sketch()
    return _short(number, 12) if math.isfinite(number) else None


def _short(value: float, digits: int) -> float:
    return round(float(value), digits)
