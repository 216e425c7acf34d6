"""How far a campaign is, and how long it still takes: one line, on a terminal always the same one."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TextIO

__all__ = ["Progress", "duration", "progress_stream"]

_EVERY = {True: 0.5, False: 10.0}
"""Seconds from line to line, on a terminal and in a file."""


class Progress:
    """Tells of ``total`` cases how many are done; ``known`` more need not be."""

    def __init__(
        self, name: str, total: int, known: int, stream: TextIO | None, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._name, self._total, self._known, self._stream, self._now = name, total, known, stream, now
        self._live = stream is not None and stream.isatty()
        self._began = self._told = now()
        self._done = 0
        self._ended = 0.0
        self._end = ""  # of the line that stands on the terminal

    def done(self, cases: int) -> None:
        """So many more are."""
        self._done += cases
        self._ended = self._now()

    def line(self) -> str:
        """What is told now. The rate is that of this sitting; what remains is reckoned with it."""
        words = [f"{self._name}: {self._done} of {self._total} trials"]
        seconds = self._ended - self._began
        if self._done and seconds > 0:
            rate = self._done / seconds
            words.append(f"{rate:.3g} a second" if rate >= 0.1 else f"{60 * rate:.3g} a minute")
            if left := self._total - self._done:
                words.append(f"about {duration(max(0.0, left / rate - (self._now() - self._ended)))} left")
        if self._known:
            words.append(f"{self._known} known from before")
        return ", ".join(words)

    def tell(self, *, now: bool = False) -> None:
        """Write the line, if it is time."""
        if self._stream is None or (not now and self._now() - self._told < _EVERY[self._live]):
            return
        self._told = self._now()
        self._write(f"\r{self.line()}\x1b[K" if self._live else f"{self.line()}\n")
        self._end = "\n" if self._live else ""

    def say(self, text: str) -> None:
        """Something else, on a line of its own."""
        self._write(f"{self._end}{self._name}: {text}\n")
        self._end = ""

    def end(self) -> None:
        """The last line."""
        self.tell(now=True)
        self._write(self._end)
        self._end = ""

    def _write(self, text: str) -> None:
        if self._stream is not None:
            self._stream.write(text)
            self._stream.flush()


def duration(seconds: float) -> str:
    """In words: seconds, minutes, or hours and minutes."""
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60:02} min"


def progress_stream() -> TextIO | None:
    """Where progress is told: standard error, unless it is closed."""
    return sys.stderr
