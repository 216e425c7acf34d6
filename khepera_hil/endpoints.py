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
import time
import tty
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
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

_TIOCGEXCL = 0x80045440
_LOCK_LOOKED_AT = 1.0  # s, since it takes some milliseconds

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

    def unplug(self) -> None:
        """Be gone, for the client too, as an adapter that was pulled out. Does nothing where it is gone already."""

    def plug_in(self) -> None:
        """Be there again, under the same name. Raises PortError where somebody has taken it."""


class _PseudoTerminal:
    def __init__(self, link: Path, baud: int) -> None:
        self.name = str(link)
        self._link, self._baud = link, baud
        self._open = ExitStack()
        self._master: int | None = None
        self._look_again = 0.0
        self.plug_in()

    @property
    def rate(self) -> int | None:
        if self._master is None:
            return None
        answer = fcntl.ioctl(self._slave, _TCGETS2, bytes(44))
        speed: int = struct.unpack("36xII", answer)[1]
        return speed or None  # 0: it hung up

    def readable(self, *, client: bool) -> list[int]:
        return [self._master] if client and self._master is not None else []

    def read(self, ready: Collection[int]) -> bytes:
        return os.read(self._master, _AT_ONCE) if self._master is not None and self._master in ready else b""

    def send(self, data: bytes) -> None:
        while data and self._master is not None:
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                return

    def said_all(self) -> None:
        """Who opens a terminal, and when, is not seen from here; but who locked it may be gone with the lock left.

        A client may ask that nobody else opens the terminal (Java's jSerialComm does). On a real port this ends
        with its last user; here we hold it open.
        """
        if self._master is None or not _flag(self._slave, _TIOCGEXCL):
            return
        if time.monotonic() >= self._look_again:
            self._look_again = time.monotonic() + _LOCK_LOOKED_AT
            if not _held_by_others(self.device, self._slave):
                fcntl.ioctl(self._slave, termios.TIOCNXCL)

    def unplug(self) -> None:
        self._master = None
        self._open.close()

    def plug_in(self) -> None:
        with ExitStack() as opening:
            master, self._slave = os.openpty()
            opening.callback(os.close, master)
            # Our end of the slave stays open, so that nothing is lost and no end is seen between two clients.
            opening.callback(os.close, self._slave)
            tty.setraw(self._slave)
            attributes = termios.tcgetattr(self._slave)
            attributes[4] = attributes[5] = getattr(termios, f"B{self._baud}")
            attributes[2] |= termios.CSTOPB
            termios.tcsetattr(self._slave, termios.TCSANOW, attributes)
            os.set_blocking(master, False)
            self.device = os.ttyname(self._slave)
            opening.enter_context(_linked(self._link, self.device))
            self._open = opening.pop_all()
        self._master = master


@contextmanager
def pseudo_terminal(link: Path, baud: int) -> Iterator[Endpoint]:
    """A pseudo-terminal under the name ``link``, a symbolic link that is removed at the end.

    Raw and without echo from the first byte, at ``baud`` until a client sets another rate: the settings stay while
    clients come and go, as a real port's do. Raises PortError when the link cannot be made.
    """
    terminal = _PseudoTerminal(link, baud)
    try:
        yield terminal
    finally:
        terminal.unplug()


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


def _flag(descriptor: int, question: int) -> bool:
    (answer,) = struct.unpack("i", fcntl.ioctl(descriptor, question, bytes(4)))
    return bool(answer)


def _held_by_others(device: str, ours: int) -> bool:
    """Whether anybody whose descriptors we may see has ``device`` open, but for our own descriptor."""
    mine = Path(f"/proc/{os.getpid()}/fd/{ours}")
    for descriptor in Path("/proc").glob("[0-9]*/fd/*"):
        with contextlib.suppress(OSError):  # closed since, or not ours to look at
            if descriptor != mine and os.readlink(descriptor) == device:
                return True
    return False


class _TcpPort:
    rate = None

    def __init__(self, listener: socket.socket) -> None:
        self._listener: socket.socket | None = listener
        self._address, self._family = listener.getsockname(), listener.family
        host, port = self._address[:2]
        self.device = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
        self.name = f"socket://{self.device}"
        self._client: socket.socket | None = None
        self._ended = False  # the client sends no more, but may still read
        self._refused: list[socket.socket] = []

    def readable(self, *, client: bool) -> list[int]:
        open_ = [*self._refused]
        if self._listener is not None:
            open_.append(self._listener)
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
        if self._listener is not None and self._listener.fileno() in ready:
            self._accept(self._listener)
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

    def unplug(self) -> None:
        self._drop()
        while self._refused:
            self._refused.pop().close()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def plug_in(self) -> None:
        try:
            self._listener = socket.create_server(self._address[:2], family=self._family)
        except OSError as error:
            raise PortError(_why_not(self._address[0], self._address[1], error)) from None
        self._listener.setblocking(False)

    def _accept(self, listener: socket.socket) -> None:
        try:
            client, _ = listener.accept()
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
        served.unplug()


def _why_not(host: str, port: int, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if isinstance(error, (socket.gaierror, UnicodeError)) or number == errno.EADDRNOTAVAIL:
        return f"{host!r} is no address of this machine; write {LOOPBACK}, or 0.0.0.0 for all of them"
    if number == errno.EADDRINUSE:
        return f"somebody listens on port {port} already; choose another, or 0 for any that is free"
    if number in (errno.EACCES, errno.EPERM):
        return f"port {port} may not be listened on by you; choose one above 1023"
    return f"port {port} of {host!r} cannot be listened on: {error}"
