"""Steering by the arrow keys of a plain terminal.

A terminal tells when a key goes down and not when it comes up, so the stick stays where it was put: left and right
move it by two, up (or the space bar) lets it spring back to the middle, q ends.
"""

from __future__ import annotations

import os
import select
import termios
import tty
from typing import Any

from khepera_hil.errors import UsageError
from khepera_hil.teaching.hand import MOST

__all__ = ["HELP", "Keyboard"]

HELP = "left, right (or a, d): steer, and go on turning so; up, space: straight on; q: end"

_STEP = 2
_KEYS = {b"\x1b[D": -_STEP, b"\x1bOD": -_STEP, b"a": -_STEP, b"\x1b[C": _STEP, b"\x1bOC": _STEP, b"d": _STEP}
_MIDDLE = (b"\x1b[A", b"\x1bOA", b" ", b"w", b"s")
_ESCAPE = b"\x1b"
_SEQUENCE = 3
"""Bytes of an arrow key."""


class Keyboard:
    """Reads a terminal's keys as they come, without the return key; Ctrl-C stays what it is.

    ``descriptor`` is the terminal's. Raises UsageError where it is none.
    """

    def __init__(self, descriptor: int) -> None:
        if not os.isatty(descriptor):
            raise UsageError("--teacher keyboard needs a terminal to read keys from; this standard input is none")
        self._descriptor = descriptor
        self._before: list[Any] | None = termios.tcgetattr(descriptor)
        tty.setcbreak(descriptor, termios.TCSANOW)
        self._held = b""
        self._stick = 0
        self._done = False

    @property
    def done(self) -> bool:
        """Whether q was pressed, or the terminal is gone."""
        return self._done

    def vrot(self) -> int:
        """The stick after all keys that were pressed by now."""
        while select.select([self._descriptor], [], [], 0)[0]:
            try:
                data = os.read(self._descriptor, 256)
            except OSError:  # a closed pseudo-terminal says so by an error
                data = b""
            if not data:
                self._done = True
                self._stick = 0
                break
            self._held += data
        while key := self._next_key():
            if key in _KEYS:
                self._stick = max(-MOST, min(MOST, self._stick + _KEYS[key]))
            elif key in _MIDDLE:
                self._stick = 0
            elif key == b"q":
                self._done = True
        return self._stick

    def close(self) -> None:
        """Make the terminal what it was."""
        if self._before is not None:
            termios.tcsetattr(self._descriptor, termios.TCSANOW, self._before)
            self._before = None

    def _next_key(self) -> bytes:
        """The next whole key of what has come; half an arrow waits for its rest."""
        if self._held.startswith(_ESCAPE):
            if len(self._held) > 1 and self._held[1:2] not in (b"[", b"O"):
                length = 1  # the escape key itself, which means nothing here
            elif len(self._held) < _SEQUENCE:
                return b""
            else:
                length = _SEQUENCE
        else:
            length = 1
        key, self._held = self._held[:length], self._held[length:]
        return key
