"""A small robot in a thread, the cables to it, and a client's end that is never in a hurry."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import threading
import tty
from collections.abc import Iterator

from khepera_hil.clock import WallClock
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import Port
from khepera_hil.protocol import COMMAND_NOT_FOUND, RequestLines, RequestRefused, encode_answer, parse_request

BAUD = 38400
ANSWERS: dict[str, tuple[int | str, ...]] = {
    "B": ("5.01", "5.00"),
    "K": (0,) * 6,
    "E": (0, 0),
    "N": (1, 2, 3, 4, 5, 6, 7, 1023),
    "O": (498, 501, 497, 499, 500, 502, 500, 499),
    "D": (),
}


class SwitchedOff(Exception):
    """A robot ends in the middle of a request."""


class Robot:
    """Serves one descriptor in a thread until it is switched off; ``mute`` robots read and say nothing."""

    def __init__(self, fd: int, mute: bool = False) -> None:
        self._fd = fd
        self._mute = mute
        self._woken, self._wake = os.pipe()
        self.heard = bytearray()
        self.answers = dict(ANSWERS)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        with contextlib.suppress(SwitchedOff):
            self._serve_until_off()

    def _serve_until_off(self) -> None:
        editor = RequestLines()
        while True:
            ready, _, _ = select.select([self._fd, self._woken], [], [])
            if self._woken in ready:
                return
            data = os.read(self._fd, 1024)
            if not data:
                return
            self.heard += data
            for line in editor.feed(data):
                if line and not self._mute:
                    os.write(self._fd, self._answer(line))

    def _answer(self, line: bytes) -> bytes:
        try:
            request = parse_request(line)
        except RequestRefused as refused:
            return refused.reply
        assert request is not None
        if request[0] not in self.answers:
            return COMMAND_NOT_FOUND
        return encode_answer(request[0], *self.answers[request[0]])

    def off(self) -> None:
        os.write(self._wake, b".")
        self._thread.join(10)
        assert not self._thread.is_alive()
        os.close(self._woken)
        os.close(self._wake)


class Cable:
    """A pseudo-terminal: its name for the client, its other end for a robot."""

    def __init__(self) -> None:
        self.end, self._terminal = pty.openpty()
        tty.setraw(self._terminal)
        self.name = os.ttyname(self._terminal)

    def pull(self) -> None:
        for fd in (self.end, self._terminal):
            with contextlib.suppress(OSError):
                os.close(fd)


@contextlib.contextmanager
def connected(port: Port) -> Iterator[Khepera]:
    link = Link(
        port, WallClock(), baud=BAUD, margin=1.0
    )  # generous: this machine may be busy, and nothing is timed
    try:
        yield Khepera(link)
    finally:
        link.close()
