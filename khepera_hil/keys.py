"""Keys at the terminal as orders to the running service: v, i and q, as they are pressed."""

from __future__ import annotations

import contextlib
import os
import select
import termios
import tty
from collections.abc import Callable
from typing import Any, TextIO

from khepera_hil.orders import Order

__all__ = ["HELP", "KEYS", "Keys", "foreground"]

KEYS = {"v": "vigil", "i": "identify", "q": "stop"}
HELP = "keys: v vigil on or off, i identify an object, q end"


def foreground(stream: TextIO) -> bool:
    """Whether the keys of this terminal are ours: a job in the background that asks for them is stopped for it."""
    try:
        return stream.isatty() and os.tcgetpgrp(stream.fileno()) == os.getpgrp()
    except (OSError, ValueError):
        return False


class Keys:
    """Reads a terminal without the return key and never waits for it; Ctrl-C stays what it is.

    ``descriptor`` is the terminal's; ``say`` gets what comes of an order.
    """

    def __init__(self, descriptor: int, say: Callable[[str, str], None]) -> None:
        self._descriptor: int | None = descriptor
        self._say = say
        self._before: list[Any] = termios.tcgetattr(descriptor)
        tty.setcbreak(descriptor, termios.TCSANOW)

    def take(self) -> list[Order]:
        """An order for each key that was pressed since the last call; other keys are none."""
        if self._descriptor is None:
            return []
        try:
            if os.tcgetpgrp(self._descriptor) != os.getpgrp():
                return []
            if not select.select([self._descriptor], [], [], 0)[0]:
                return []
            pressed = os.read(self._descriptor, 64)
        except OSError:  # a terminal that was closed says so by an error
            pressed = b""
        if not pressed:
            self._descriptor = None
        return [Order(KEYS[key], self._answered) for key in pressed.decode("latin-1").lower() if key in KEYS]

    def close(self) -> None:
        """Make the terminal what it was."""
        if self._descriptor is not None:
            with contextlib.suppress(termios.error):  # it may be gone
                termios.tcsetattr(self._descriptor, termios.TCSANOW, self._before)
            self._descriptor = None

    def _answered(self, answer: dict[str, str]) -> None:
        if "ok" in answer:
            self._say("info", answer["ok"])
        else:
            self._say("warning", answer["error"])
