"""Looking on while a run goes on: a server of its own for viewers, which come and go as they like.

The server keeps the last ``MEMORY`` of what it was sent, so that a viewer that comes late sees what was. It is fed
by a follower of its own (see ``follower``): neither the loop nor the file waits for a viewer, and nothing here ever
connects to one.
"""

from __future__ import annotations

import ipaddress
import os
import socket
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

from khepera_hil.errors import UsageError
from khepera_hil.recording import Tick
from khepera_hil.viewer import program

__all__ = ["Address", "LiveView", "address", "open_live"]

WEB_PORT = 9090
"""Where the page is, unless told otherwise; when it is taken, any free port."""

MEMORY = "256MiB"
"""What the server keeps for viewers that come late."""

ROWS = 2
"""Ticks in a chunk: viewers see a fifth of a second late."""


@dataclass(frozen=True)
class Address:
    """Where viewers are served: ``host`` is an IP address, ``named`` what the user calls it."""

    host: str
    named: str
    web_port: int
    grpc_port: int

    @property
    def stream(self) -> str:
        """For a viewer: ``rerun URL``."""
        return f"rerun+http://{self._reached}:{self.grpc_port}/proxy"

    @property
    def page(self) -> str:
        """For a browser."""
        return f"http://{self._reached}:{self.web_port}/?url={quote(self.stream, safe='')}"

    @property
    def _reached(self) -> str:
        """The name by which others reach it."""
        ip = ipaddress.ip_address(self.host)
        name = socket.gethostname() if ip.is_unspecified else self.named
        return f"[{name}]" if ":" in name else name


def address(text: str = "127.0.0.1") -> Address:
    """The address that ``text`` means, ``HOST`` or ``HOST:PORT`` (of the page), with ports that are free now.

    Raises UsageError when it is none, or cannot be listened on.
    """
    host, port = _split(text)
    try:
        ip = str(socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)[0][4][0])
    except (OSError, UnicodeError):
        raise UsageError(
            f"{host!r} is no address of this machine to serve at; write 127.0.0.1 or 0.0.0.0"
        ) from None
    try:
        if port is not None:
            web = program.free_port(ip, port)
        else:
            try:
                web = program.free_port(ip, WEB_PORT)
            except OSError:
                web = program.free_port(ip)
        return Address(ip, host, web, program.free_port(ip))
    except OSError as error:
        raise UsageError(f"cannot serve at {text}: {error.strerror or error}") from None


def _split(text: str) -> tuple[str, int | None]:
    bare = text.strip()
    if bare.startswith("["):
        host, bracket, rest = bare[1:].partition("]")
        port = rest[1:] if rest.startswith(":") else rest or (None if bracket else "]")
    elif bare.count(":") > 1:
        host, port = bare, None
    else:
        host, colon, port = bare.partition(":")
        port = port if colon else None
    if port is not None and not (port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise UsageError(f"{text!r} is no address to serve at; write HOST or HOST:PORT")
    return host or "127.0.0.1", None if port is None else int(port)


def open_live(manifest: Mapping[str, Any], where: Address, *, page: bool, window: bool) -> LiveView:
    """Serve viewers at ``where``; with a ``page`` for browsers, and with a ``window`` of our own on it."""
    os.environ.setdefault("RUST_LOG", "off")
    return LiveView(manifest, where, page=page, window=window)


class LiveView:
    """A follower's sink: the server, and the programs that were started beside it."""

    def __init__(self, manifest: Mapping[str, Any], where: Address, *, page: bool, window: bool) -> None:
        import rerun as rr  # late: half a second

        from khepera_hil.viewer.sink import RerunSink

        # Browsers are told by which page may read: ours, under whatever name it was reached.
        origins = [f"http://*:{where.web_port}"]
        server = rr.GrpcServerSink(
            where.host, where.grpc_port, server_memory_limit=MEMORY, cors_allow_origin=origins
        )
        self._sink = RerunSink(server, manifest, rows=ROWS)
        self._page: subprocess.Popen[bytes] | None = None
        if page:
            self._page = program.start(
                ["--serve-web", "--bind", where.host, "--web-viewer-port", str(where.web_port), where.stream]
            )
        if window:
            # On a port of its own, so that it is a new window and not one that is open already.
            program.start([where.stream, "--bind", "127.0.0.1", "--port", "auto"], outlives=True)

    def write(self, tick: Tick, dropped: int) -> None:
        """Send the tick to whoever looks on."""
        self._sink.write(tick, dropped)

    def flush(self) -> None:
        """Bring out what is held back."""
        self._sink.flush()

    def close(self) -> None:
        """End the server; a window stays open with what it has."""
        try:
            self._sink.close()
        finally:
            if self._page is not None:
                program.end(self._page)
