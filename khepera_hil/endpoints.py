"""Where clients find the emulated robot: a pseudo-terminal under a name that stays, or a TCP port.

Neither ever waits: :func:`~khepera_hil.serve.serve` does, on the descriptors that they name.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import socket
import struct
import termios
import tty
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from khepera_hil.errors import PortError

__all__ = ["LOOPBACK", "REFUSAL", "Endpoint", "pseudo_terminal", "tcp_port"]

LOOPBACK = "127.0.0.1"

REFUSAL = b"khepera-hil: the robot has a client already, and takes one at a time\r\n"
"""What a second client reads before its connection is closed."""

_AT_ONCE = 4096  # bytes taken from a client in one go
_REFUSED = 8  # refused clients that may still be reading their line
_SILENT = (10, 5, 3)  # s until a silent client is asked for a sign of life, between such questions, and how many

_TCGETS2 = 0x802C542A  # Linux: a rate as a number, also one that has no name


class Endpoint(Protocol):
    """One client at a time, who comes and goes."""

    @property
    def name(self) -> str:
        """What a client opens."""

    @property
    def device(self) -> str:
        """What stands behind the name."""

    @property
    def rate(self) -> int | None:
        """The baud rate that the client has set; None where the endpoint has none, and only the pace is real."""

    def readable(self, *, client: bool) -> list[int]:
        """Descriptors to wait on; those of a client's bytes only if there is room for them."""

    def read(self, ready: Collection[int]) -> bytes:
        """What the client has sent, where its descriptor is among those that are ready."""

    def send(self, data: bytes) -> None:
        """Hand bytes to the client. What nobody takes is lost, as on a port that nobody reads."""

    def said_all(self) -> None:
        """The robot has nothing more to say: who only waited for that may be let go."""


class _PseudoTerminal:
    rate_by_default: int

    def __init__(self, link: Path, master: int, slave: int) -> None:
        self.name = str(link)
        self.device = os.ttyname(slave)
        self._master, self._slave = master, slave

    @property
    def rate(self) -> int | None:
        answer = fcntl.ioctl(self._slave, _TCGETS2, bytes(44))
        speed: int = struct.unpack("36xII", answer)[1]
        return speed or None  # 0: it hung up

    def readable(self, *, client: bool) -> list[int]:
        return [self._master] if client else []

    def read(self, ready: Collection[int]) -> bytes:
        return os.read(self._master, _AT_ONCE) if self._master in ready else b""

    def send(self, data: bytes) -> None:
        while data:
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                return

    def said_all(self) -> None:
        """Who opens a terminal, and when, is not seen from here."""


@contextmanager
def pseudo_terminal(link: Path, baud: int) -> Iterator[Endpoint]:
    """A pseudo-terminal under the name ``link``, a symbolic link that is removed at the end.

    Raw and without echo from the first byte, at ``baud`` until a client sets another rate: the settings stay while
    clients come and go, as a real port's do. Raises PortError when the link cannot be made.
    """
    master, slave = os.openpty()
    try:
        # Our end of the slave stays open, so that nothing is lost and no end is seen between two clients.
        tty.setraw(slave)
        attributes = termios.tcgetattr(slave)
        attributes[4] = attributes[5] = getattr(termios, f"B{baud}")
        attributes[2] |= termios.CSTOPB
        termios.tcsetattr(slave, termios.TCSANOW, attributes)
        os.set_blocking(master, False)
        with _linked(link, os.ttyname(slave)):
            yield _PseudoTerminal(link, master, slave)
    finally:
        os.close(master)
        os.close(slave)


@contextmanager
def _linked(link: Path, device: str) -> Iterator[None]:
    """A name that stays while the device's changes; only what a dead emulator left behind is replaced."""
    try:
        if link.is_symlink() and str(link.readlink()).startswith("/dev/pts/") and not link.exists():
            link.unlink()
        link.symlink_to(device)
    except FileExistsError:
        what = f"points to {link.readlink()}, which is alive" if link.is_symlink() else "is there already"
        raise PortError(f"{link} {what}; choose another name for the link, or remove it") from None
    except OSError as error:
        raise PortError(f"the link {link} cannot be made: {error.strerror}") from None
    try:
        yield
    finally:
        if link.is_symlink() and str(link.readlink()) == device:
            link.unlink()


class _TcpPort:
    rate = None

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        host, port = listener.getsockname()[:2]
        self.device = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
        self.name = f"socket://{self.device}"
        self._client: socket.socket | None = None
        self._ended = False  # the client sends no more, but may still read
        self._refused: list[socket.socket] = []

    def readable(self, *, client: bool) -> list[int]:
        open_ = [self._listener, *self._refused]
        if client and self._client is not None and not self._ended:
            open_.append(self._client)
        return [one.fileno() for one in open_]

    def read(self, ready: Collection[int]) -> bytes:
        data = b""
        if self._client is not None and self._client.fileno() in ready:
            try:
                data = self._client.recv(_AT_ONCE)
                self._ended = not data
            except BlockingIOError:
                pass
            except OSError:
                self._drop()
        for refused in [one for one in self._refused if one.fileno() in ready]:
            with contextlib.suppress(OSError):
                if refused.recv(_AT_ONCE):
                    continue  # it talks before it reads
            self._refused.remove(refused)
            refused.close()
        # Last, so that a client who came when the one before had gone finds the place free.
        if self._listener.fileno() in ready:
            self._accept()
        return data

    def send(self, data: bytes) -> None:
        while data and self._client is not None:
            try:
                data = data[self._client.send(data) :]
            except BlockingIOError:
                return
            except OSError:
                self._drop()

    def said_all(self) -> None:
        """Whoever has ended its sending has its answers now."""
        if self._ended:
            self._drop()

    def close(self) -> None:
        self._drop()
        for one in (*self._refused, self._listener):
            one.close()

    def _accept(self) -> None:
        try:
            client, _ = self._listener.accept()
        except OSError:
            return  # it has thought better of it
        client.setblocking(False)
        if self._client is not None and not self._ended and _alive(self._client):
            self._refuse(client)
            return
        self._drop()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # A client whose machine died must not keep the robot from all others.
        client.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        options = (socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT)
        for option, value in zip(options, _SILENT, strict=True):
            client.setsockopt(socket.IPPROTO_TCP, option, value)
        self._client = client

    def _refuse(self, client: socket.socket) -> None:
        """Say why; it is closed when the client has read that and gone: closing at once could take it back."""
        with contextlib.suppress(OSError):
            client.send(REFUSAL)
            client.shutdown(socket.SHUT_WR)
        self._refused.append(client)
        if len(self._refused) > _REFUSED:
            self._refused.pop(0).close()

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
        self._client, self._ended = None, False


def _alive(client: socket.socket) -> bool:
    """Whether a client of whom nothing is ready to be read may still send."""
    try:
        return bool(client.recv(1, socket.MSG_PEEK))
    except BlockingIOError:
        return True
    except OSError:
        return False


@contextmanager
def tcp_port(host: str, port: int) -> Iterator[Endpoint]:
    """A TCP port; 0 is any that is free. Raises PortError when it cannot be listened on."""
    try:
        family, _, _, _, place = socket.getaddrinfo(
            host or LOOPBACK, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.create_server(place[:2], family=family)
    except (OSError, UnicodeError) as error:
        raise PortError(_why_not(host, port, error)) from None
    listener.setblocking(False)
    served = _TcpPort(listener)
    try:
        yield served
    finally:
        served.close()


def _why_not(host: str, port: int, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if isinstance(error, (socket.gaierror, UnicodeError)) or number == errno.EADDRNOTAVAIL:
        return f"{host!r} is no address of this machine; write {LOOPBACK}, or 0.0.0.0 for all of them"
    if number == errno.EADDRINUSE:
        return f"somebody listens on port {port} already; choose another, or 0 for any that is free"
    if number in (errno.EACCES, errno.EPERM):
        return f"port {port} may not be listened on by you; choose one above 1023"
    return f"port {port} of {host!r} cannot be listened on: {error}"
