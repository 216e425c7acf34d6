"""Sinks for a process of their own: what they did stands in a file."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

__all__ = ["Noting", "absent"]


class Noting:
    """Writes a line for each thing that it is told.

    Stands still before the first item until ``gate`` is there, dies of the item ``fails_at``, and, if it ``hangs``,
    hangs for good when it is closed.
    """

    def __init__(
        self, path: Path, *, gate: Path | None = None, fails_at: object = None, hangs: bool = False
    ) -> None:
        self._path, self._gate, self._fails_at, self._hangs = path, gate, fails_at, hangs
        self._note("open", os.getppid())

    def write(self, item: object, dropped: int) -> None:
        while self._gate is not None and not self._gate.exists():
            time.sleep(0.01)
        if item == self._fails_at:
            raise ValueError("no more")
        self._note(len(item) if isinstance(item, bytes) else item, dropped)

    def flush(self) -> None:
        pass

    def close(self) -> None:
        self._note("close", 0)
        while self._hangs:
            time.sleep(1.0)

    def _note(self, item: object, dropped: int) -> None:
        with self._path.open("a") as file:
            file.write(json.dumps([item, dropped]) + "\n")


def absent(**arguments: object) -> Noting:
    """Cannot be opened."""
    raise FileNotFoundError(f"nothing for {sorted(arguments)}")
