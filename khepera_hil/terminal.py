"""What somebody at the terminal sees of a run: one live line, or plain lines where the output is piped."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from typing import TextIO

from khepera_hil.recording import Tick

__all__ = ["Terminal"]


_MANY = 12
"""Known variables beyond which only those of words are shown."""


class Terminal:
    """A follower's sink: it is offered every tick and shows some of them, in a thread of its own.

    On a terminal the same line is written again at most ten times a second; elsewhere a line is written every
    ten seconds of the robot's time. Events are lines of their own in both.
    """

    def __init__(
        self,
        out: TextIO,
        program: str,
        *,
        note: Callable[[], str] = lambda: "",
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._out, self._program, self._note, self._now = out, program, note, now
        self._live = out.isatty()
        self._shown_at = -1.0
        self._last = ""
        self._missed = 0
        self._said: set[str] = set()  # in the last tick that was shown

    def write(self, tick: Tick, dropped: int) -> None:
        """Show the tick, or not; that some were passed over (``dropped``) does not matter here."""
        self._missed += tick.missed
        for level, text in tick.events:
            if text not in self._said:  # it was said a tick ago: the log has it as often as it happened
                bell = "\a" if level == "alarm" and self._live else ""
                self._line(f"{tick.t:8.1f} s  {level}: {text}{bell}")
        self._said = {text for _, text in tick.events}
        if self._live:
            if self._now() - self._shown_at >= 0.1:
                self._shown_at = self._now()
                self._again(self._status(tick))
        elif tick.t - self._shown_at >= 10.0 or self._shown_at < 0:
            self._shown_at = tick.t
            self._line(self._status(tick))

    def flush(self) -> None:
        """Nothing is held back."""

    def close(self) -> None:
        """Leave the cursor on a fresh line."""
        if self._live and self._last:
            self._out.write("\n")
            self._out.flush()

    def _status(self, tick: Tick) -> str:
        if tick.state not in ("", "running", "degraded"):
            return f"{tick.t:8.1f} s  {self._program}: {tick.state} | missed {self._missed}"
        evidence = tick.evidence
        if len(evidence) > _MANY:  # numbers are told by what is drawn from them; the log has all
            evidence = {name: value for name, value in evidence.items() if isinstance(value, (str, bool))}
        known = " ".join(f"{name} {value}" for name, value in evidence.items()) or "no readings"
        drawn = (
            " ".join(
                f"{name} {value:+d}" if isinstance(value, int) else f"{name} {value}"
                for name, value in tick.draws.items()
            )
            or "nothing drawn"
        )
        sent = "none" if tick.command is None else "{} {}".format(*tick.command)
        # What is noted comes first: a narrow terminal cuts the end.
        note = self._note()
        return (
            f"{tick.t:8.1f} s  {self._program}{', ' if note else ''}{note}: {known} -> {drawn}, wheels {sent}"
            f" | late {tick.late_ms:.1f} ms, missed {self._missed}"
        )

    def _again(self, text: str) -> None:
        width = shutil.get_terminal_size().columns - 1
        self._last = text[:width].ljust(min(len(self._last), width))
        self._out.write("\r" + self._last)
        self._out.flush()

    def _line(self, text: str) -> None:
        if self._live and self._last:
            self._again("")
            self._out.write("\r")
            self._last = ""
        self._out.write(text + "\n")
        self._out.flush()
