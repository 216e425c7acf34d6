"""A served robot in a thread, behind a pseudo-terminal or TCP, and clients that know nothing of ours."""

from __future__ import annotations

import os
import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from khepera_hil.disturbed import Disturbed
from khepera_hil.emulator import Emulator
from khepera_hil.endpoints import Endpoint, pseudo_terminal, tcp_port
from khepera_hil.serve import serve
from khepera_hil.uart import FIFO_16550
from khepera_hil.world import World

PATIENCE = 20.0
"""Seconds after which a client gives up: this machine may be busy, and nothing here is timed."""


@dataclass
class Served:
    """What a client opens, and the robot behind it."""

    url: str
    endpoint: Endpoint
    emulator: Emulator


@contextmanager
def served(kind: str, folder: Path, baud: int = 38400, world: World | None = None, **more: Any) -> Iterator[Served]:
    """A server in a thread; ``kind`` is ``pty`` or ``tcp``."""
    make = Disturbed if "faults" in more else Emulator
    robot = make(world or World("empty"), baud, host_follows=kind == "tcp", fifo=FIFO_16550, **more)
    stop, ender = os.pipe()
    ends = SimpleQueue[float]()
    with ExitStack() as stack:
        if kind == "pty":
            endpoint = stack.enter_context(pseudo_terminal(folder / "khepera", baud))
        else:
            endpoint = stack.enter_context(tcp_port("127.0.0.1", 0))
        thread = threading.Thread(target=lambda: ends.put(serve([(endpoint, robot)], stop=stop)))
        thread.start()
        try:
            yield Served(endpoint.name, endpoint, robot)
        finally:
            os.write(ender, b"x")
            thread.join(timeout=PATIENCE)
            os.close(stop)
            os.close(ender)
            assert not thread.is_alive()
            assert ends.get(timeout=1) > 0


class ManualClient:
    """Written from the manual's dialogues alone: bytes out, whole lines in. Nothing of ``khepera_hil``.

    ``end`` is how it ends its commands, ``bytewise`` whether it writes each byte by itself.
    """

    def __init__(self, url: str, *, end: bytes = b"\r", bytewise: bool = False) -> None:
        self._end, self._bytewise = end, bytewise
        self._socket: socket.socket | None = None
        self._heard = bytearray()
        if url.startswith("socket://"):
            host, _, port = url.removeprefix("socket://").rpartition(":")
            self._socket = socket.create_connection((host, int(port)), PATIENCE)
            self._fd = self._socket.fileno()
        else:
            self._fd = os.open(url, os.O_RDWR | os.O_NOCTTY)

    def __enter__(self) -> ManualClient:
        return self

    def __exit__(self, *_: object) -> None:
        if self._socket is not None:
            self._socket.close()
        else:
            os.close(self._fd)

    def send(self, *commands: str) -> None:
        """All of them at once, without waiting for an answer."""
        data = b"".join(command.encode() + self._end for command in commands)
        for piece in [data[i : i + 1] for i in range(len(data))] if self._bytewise else [data]:
            os.write(self._fd, piece)

    def line(self) -> str:
        """The next line, without its CR LF."""
        deadline = time.monotonic() + PATIENCE
        while b"\n" not in self._heard:
            ready, _, _ = select.select([self._fd], [], [], max(0.0, deadline - time.monotonic()))
            assert ready, f"nothing but {bytes(self._heard)!r} came"
            data = os.read(self._fd, 4096)
            assert data, "the line was closed"
            self._heard += data
        line, _, rest = self._heard.partition(b"\n")
        self._heard[:] = rest
        assert line.endswith(b"\r")
        return line[:-1].decode("ascii")

    def ask(self, command: str) -> str:
        """A command and its answer."""
        self.send(command)
        return self.line()

    def settle(self) -> None:
        """Read away what there is (the boot text, what was said to a client before) until an answer is ours."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            self.send("G,4711,-4711", "H")
            while select.select([self._fd], [], [], 0.5)[0]:
                self._heard += os.read(self._fd, 4096)
                if self._heard.endswith(b"h,4711,-4711\r\n"):
                    self._heard.clear()
                    return
        raise AssertionError("no answer came")
