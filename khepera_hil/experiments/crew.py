"""Who tries the cases: what a crew is, and the one of this computer's own processes.

A process has one case at a time, so that when it dies it is known which case that costs. Cases and results travel
as JSON. A process ends when the one that started it does, in whatever way that is.
"""

from __future__ import annotations

import gc
import importlib
import json
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from typing import Protocol

from khepera_hil.experiments.cases import Case, Result

__all__ = ["Crew", "Ended", "Processes", "Trial", "cores", "measured"]


@dataclass(frozen=True)
class Trial:
    """A function of a module's own, which any process can find: from a case to its result."""

    module: str
    name: str

    @classmethod
    def of(cls, function: Callable[[Case], Result]) -> Trial:
        """Raises ValueError for what other processes cannot find."""
        if "<" in function.__qualname__:
            raise ValueError(f"a trial is a function of a module's own, and not {function.__qualname__}")
        return cls(function.__module__, function.__qualname__)


def measured(trial: Trial, case: str) -> str:
    """The result of a case. Raises what the trial raises, and ValueError where its result is no JSON."""
    function = importlib.import_module(trial.module)
    for name in trial.name.split("."):
        function = getattr(function, name)
    return json.dumps(function(json.loads(case)), allow_nan=False)  # type: ignore[operator]  # by now it is one


@dataclass(frozen=True)
class Ended:
    """What came of a case: its result, or the trial's error, or how its worker died; none of them if it was not
    tried at all.
    """

    case: str
    result: str | None = None
    error: Exception | None = None
    died: str | None = None
    again: bool = True
    """Whether one that died with its worker may be tried again."""


class Crew(Protocol):
    """Workers that try cases."""

    def free(self) -> int:
        """How many more cases can be tried at this moment."""

    def start(self, case: str) -> None:
        """Try it."""

    def ended(self, seconds: float) -> list[Ended]:
        """What has ended; waits so long for something, and says nothing if it does not come."""

    def close(self) -> None:
        """Send all home; what is under way is given up."""


def cores() -> int:
    """Of this computer, as many as this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Processes:
    """A crew of so many processes, started when they are needed and anew when they die."""

    def __init__(self, trial: Trial, workers: int) -> None:
        self._trial, self._workers = trial, workers
        # Not copies of this process, which has threads (pyarrow's, a viewer's) that a copy would not have.
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload([trial.module])
        self._idle: list[_Process] = []
        self._busy: list[_Process] = []

    def free(self) -> int:
        """How many more cases can be tried at this moment."""
        return self._workers - len(self._busy)

    def start(self, case: str) -> None:
        """Try it, in a process that has nothing to do or in a new one."""
        while self._idle:
            process = self._idle.pop()
            if process.take(case):
                break
            process.close()  # it died of something in its sleep
        else:
            process = _Process(self._context, self._trial)
            process.take(case)
        self._busy.append(process)

    def ended(self, seconds: float) -> list[Ended]:
        """What has ended, and what died."""
        found = []
        ready = set(wait([process.pipe for process in self._busy], seconds))
        for process in [process for process in self._busy if process.pipe in ready]:
            self._busy.remove(process)
            ended = process.ended()
            found.append(ended)
            if ended.died is None:
                self._idle.append(process)
        return found

    def close(self) -> None:
        """Those who wait go home by themselves; the others are told to, and then made to."""
        for process in self._idle:
            process.pipe.close()
        for process in self._busy:
            process.process.terminate()
        until = time.monotonic() + 5
        for process in (*self._idle, *self._busy):
            process.process.join(max(0.0, until - time.monotonic()))
            process.close()
        self._idle, self._busy = [], []


@dataclass
class _Process:
    context: ForkServerContext
    trial: Trial
    pipe: Connection = field(init=False)
    process: BaseProcess = field(init=False)
    case: str = ""

    def __post_init__(self) -> None:
        self.pipe, theirs = self.context.Pipe()
        try:
            self.process = self.context.Process(target=_work, args=(theirs, self.trial), daemon=True)
            self.process.start()
        finally:
            theirs.close()

    def take(self, case: str) -> bool:
        """Whether it is there to take it."""
        self.case = case
        try:
            self.pipe.send_bytes(case.encode())
        except OSError:
            return False
        return True

    def ended(self) -> Ended:
        """What it has to say, or how it died."""
        try:
            result, error = pickle.loads(self.pipe.recv_bytes())  # noqa: S301  (our own process sent it)
        except (EOFError, OSError):  # nothing came, or only the beginning of something
            self.process.join(5)
            ended = Ended(self.case, died=_how(self.process.exitcode))
            self.close()
            return ended
        return Ended(self.case, result, error)

    def close(self) -> None:
        self.pipe.close()
        if self.process.is_alive():
            self.process.kill()
        self.process.join()
        self.process.close()


def _how(code: int | None) -> str:
    if code is None:
        return "fell silent"
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was killed by {signal.Signals(-code).name}"
    except ValueError:
        return f"was killed by signal {-code}"


def _work(pipe: Connection, trial: Trial) -> None:
    """A process's life: a case comes, its result goes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started the others
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))  # what a trial has open, it closes
    threading.Thread(target=_with_the_parent, daemon=True).start()
    gc.freeze()  # modules stay anyway, and need not be looked through after every case
    while True:
        try:
            case = pipe.recv_bytes().decode()
        except (EOFError, OSError):
            return
        result, error = None, None
        try:
            result = measured(trial, case)
        except Exception as wrong:  # noqa: BLE001  (whatever it is, it is the campaign's to tell)
            error = _portable(wrong)
        pipe.send_bytes(pickle.dumps((result, error)))
        # A description and its questions hold one another: few objects, which the collector is in no hurry to look
        # for, and tables of a hundred megabytes. A worker of the fusion's grew to two gigabytes.
        gc.collect()


def _with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _portable(error: Exception) -> Exception:
    """The error, with where it was raised as a note; or one that says the same, if it cannot be sent."""
    where = "".join(traceback.format_exception(error))
    try:
        error.__cause__ = error.__context__ = None
        error.add_note(where)
        pickle.loads(pickle.dumps(error))  # noqa: S301  (our own)
    except Exception:  # noqa: BLE001  (an error's own pickling may raise anything)
        return RuntimeError(f"{type(error).__name__}: {error}\n{where}")
    return error
