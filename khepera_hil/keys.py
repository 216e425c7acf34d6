"""Keys at the terminal as orders to the running service, as they are pressed: v, i, q, and digits for behaviors."""

from __future__ import annotations

import contextlib
import os
import re
import select
import termios
import tty
from collections.abc import Callable
from typing import Any, TextIO

from khepera_hil.orders import Order

__all__ = ["HELP", "KEYS", "LABELS", "Keys", "foreground"]

KEYS = {
    "v": "vigil",
    "i": "identify",
    "q": "stop",
    "1": "behavior idle",
    "2": "behavior patrol",
    "3": "behavior recognition",
    "4": "behavior fire-intervention",
    "5": "behavior homing",
    "6": "behavior recharge",
    "0": "behavior free",
}
HELP = "keys: v vigil on or off, i identify an object, q end"
LABELS = "1 idle, 2 patrol, 3 recognition, 4 fire-intervention, 5 homing, 6 recharge, 0 as the robot decides"
"""What more there is when the program takes the operator's word for Behavior."""


_SEQUENCE = re.compile(r"\x1b[\[O][0-9;]{0,16}[@-~]")
_HALF = re.compile(r"\x1b[\[O][0-9;]{0,16}$")
"""An arrow or a function key is several characters, digits among them, and none of ours; it may come in halves. The
escape key itself is one, and what follows it counts."""


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
        self._half = ""
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
        text = _SEQUENCE.sub("", self._half + pressed.decode("latin-1"))
        half = _HALF.search(text)
        text, self._half = (text, "") if half is None else (text[: half.start()], half[0])
        return [Order(KEYS[key], self._answered) for key in text.lower() if key in KEYS]

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
