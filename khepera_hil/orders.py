"""Orders of the operator to a running service, over a Unix socket in the run's folder.

A client connects, sends one line of JSON, ``{"order": "vigil on"}``, and gets one back, ``{"ok": "..."}`` or
``{"error": "..."}``; then the connection is closed. Only the user that the service runs as, and root, may connect.

The loop looks at the socket once a tick (:meth:`OrderSocket.take`) and never waits for it: few clients at a time,
few bytes of each, for a short time. What is no order changes nothing.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from khepera_hil.errors import OrderRefused

__all__ = ["SOCKET", "Order", "OrderSocket", "Orders", "deliver", "ordered"]

SOCKET = "orders.sock"

LONGEST = 1024
"""Bytes of a message at the most, its line end included."""

PATIENCE = 2.0
"""Seconds that a client has to say its line."""

CLIENTS = 8
"""At a time; whoever comes when there are so many has to wait."""

_ORDER = re.compile(r"[a-z][a-z0-9-]*( [a-z0-9][a-z0-9.-]*){0,7}")


@dataclass(frozen=True)
class Order:
    """What was ordered, in words such as ``vigil on``, and how to answer whoever ordered it."""

    words: str
    _reply: Callable[[dict[str, str]], None] = field(default=lambda answer: None, repr=False)

    def obeyed(self, text: str) -> None:
        """Say what comes of it."""
        self._reply({"ok": text})

    def refused(self, why: str) -> None:
        """Say why nothing comes of it."""
        self._reply({"error": why})


class Orders(Protocol):
    """Where orders come from: this socket, keys at the terminal, a scenario."""

    def take(self) -> list[Order]:
        """Those that came since the last call. Never waits."""


def ordered(text: str) -> str:
    """``text`` as an order's words. Raises OrderRefused when it is none."""
    words = " ".join(text.split())
    if len(text) > LONGEST or not _ORDER.fullmatch(words):
        raise OrderRefused(f"{text[:60]!r} is no order: a word such as stop, or some, such as vigil on")
    return words


@dataclass
class _Client:
    connection: socket.socket
    deadline: float
    heard: bytes = b""

    def reply(self, answer: dict[str, str]) -> None:
        """Say it and hang up; the kernel's buffer holds it, so nobody waits for a client that reads nothing."""
        with contextlib.suppress(OSError):
            self.connection.send(json.dumps(answer).encode() + b"\n")
        with contextlib.suppress(OSError):
            # Hung up on with something unread, the client would be told of that and not of the answer.
            for _ in range(8):
                if not self.connection.recv(1 << 16):
                    break
        self.connection.close()


class OrderSocket:
    """The service's end. Raises OSError when the folder cannot hold a socket."""

    def __init__(self, folder: Path, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._folder = folder
        self._clients: deque[_Client] = deque()
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            os.fchmod(self._listener.fileno(), 0o600)  # before there is a name: nobody else ever finds it open
            with _short(folder) as name:
                self._listener.bind(name)
            self._listener.listen(CLIENTS)
            self._listener.setblocking(False)
        except BaseException:
            self._listener.close()
            raise

    def take(self) -> list[Order]:
        """The orders that have come whole by now; whoever sent anything else gets an error."""
        self._welcome()
        found: list[Order] = []
        for _ in range(len(self._clients)):
            client = self._clients.popleft()
            try:
                order = self._listen(client)
            except OrderRefused as error:
                client.reply({"error": str(error)})
            except OSError:
                client.connection.close()
            else:
                if order is None:
                    self._clients.append(client)
                else:
                    found.append(order)
        return found

    def close(self) -> None:
        """Nobody takes orders any more."""
        self._listener.close()
        for client in self._clients:
            client.reply({"error": "the run has ended"})
        self._clients.clear()
        with contextlib.suppress(OSError):
            (self._folder / SOCKET).unlink()

    def _welcome(self) -> None:
        with contextlib.suppress(OSError):  # nobody is waiting, or no descriptor is left for him
            while len(self._clients) < CLIENTS:
                connection, _ = self._listener.accept()
                connection.setblocking(False)
                self._clients.append(_Client(connection, self._now() + PATIENCE))

    def _listen(self, client: _Client) -> Order | None:
        """What the client has said, once its line is whole."""
        with contextlib.suppress(BlockingIOError):
            heard = client.connection.recv(LONGEST + 1)
            client.heard += heard
            if not heard:
                raise OrderRefused("the message ended before its line did")
        line, end, _ = client.heard.partition(b"\n")
        if len(line) >= LONGEST:
            raise OrderRefused(f"a message has at most {LONGEST} bytes")
        if end:
            return Order(ordered(_said(line)), client.reply)
        if self._now() >= client.deadline:
            raise OrderRefused(f"no whole line came within {PATIENCE:g} s")
        return None


def deliver(folder: Path, words: str, timeout: float = 5.0) -> str:
    """Give an order to the run of this folder; what it says to it.

    Raises OrderRefused with its reason, or when nobody answers within ``timeout`` seconds; ConnectionError or
    FileNotFoundError when nobody is there.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(timeout)
        try:
            with _short(folder) as name:
                connection.connect(name)
            with contextlib.suppress(BrokenPipeError):  # it has hung up, and may have said why
                connection.sendall(json.dumps({"order": words}).encode() + b"\n")
            line = b""
            while not line.endswith(b"\n") and (more := connection.recv(4096)):
                line += more
        except (TimeoutError, BlockingIOError):
            raise OrderRefused(f"the run in {folder} does not answer within {timeout:g} s") from None
    try:
        answer = json.loads(line)
        if "ok" in answer:
            return str(answer["ok"])
        why = str(answer["error"])
    except (ValueError, TypeError, KeyError, RecursionError):
        raise ConnectionResetError(f"the run in {folder} ended without an answer") from None
    raise OrderRefused(why)


def _said(line: bytes) -> str:
    try:
        message = json.loads(line.decode("utf-8"))
    except (ValueError, RecursionError):
        raise OrderRefused("the message is no JSON") from None
    if not isinstance(message, dict) or set(message) != {"order"} or not isinstance(message["order"], str):
        raise OrderRefused('the message is not {"order": "..."}')
    words: str = message["order"]
    return words


@contextmanager
def _short(folder: Path) -> Iterator[str]:
    """A name of the folder's socket that fits into the 107 bytes that a socket's name may have, however deep the
    folder lies: by way of its descriptor, so nobody has to change into it."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{descriptor}/{SOCKET}"
    finally:
        os.close(descriptor)
