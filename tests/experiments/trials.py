"""Trials for the tests of campaigns: what other processes run, and how a test holds, kills and counts them."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from khepera_hil.experiments.cases import Case, Result

__all__ = ["cases", "log", "nan", "pids", "trial", "until"]


def cases(folder: Path, number: int, **more: dict[str, Any]) -> list[Case]:
    """So many; ``s3={"deaths": 1}`` tells what is special about the one of seed 3."""
    return [{"seed": seed, "folder": str(folder), **more.get(f"s{seed}", {})} for seed in range(number)]


def trial(case: Case) -> Result:
    """Note that it was begun, do what the case says, note that it was done."""
    folder, seed = Path(case["folder"]), int(case["seed"])
    (folder / f"pid-{seed}").write_text(str(os.getpid()))
    _note(folder / "begun", seed)
    begun = (folder / "begun").read_text().split().count(str(seed))
    if begun <= case.get("deaths", 0):
        os.kill(os.getpid(), signal.SIGKILL)
    if case.get("fails"):
        raise ZeroDivisionError("as it was told")
    if case.get("held"):
        until((folder / "go").exists)
    _note(folder / "done", seed)
    return {"twice": 2 * seed, "half": seed / 2, "name": f"n{seed}", "seed": str(seed), "list": [seed, {"a": None}]}


def _note(path: Path, seed: int) -> None:
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.write(file, f"{seed}\n".encode())
    os.close(file)


def log(folder: Path, name: str = "done") -> list[int]:
    """The seeds that were begun, or done, in the order of it."""
    path = folder / name
    return [int(line) for line in path.read_text().split()] if path.exists() else []


def pids(folder: Path) -> dict[int, int]:
    """By seed, the process that tried it last."""
    found = {int(path.name.removeprefix("pid-")): path.read_text() for path in folder.glob("pid-*")}
    return {seed: int(pid) for seed, pid in found.items() if pid}


def until(true: Callable[[], object], seconds: float = 60) -> None:
    """Wait until it is, and fail if it never is."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def nan(case: Case) -> Result:
    """What JSON has no word for."""
    return {"value": float("nan")}
