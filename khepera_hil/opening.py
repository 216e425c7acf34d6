"""Open a port of any kind that pyserial's ``serial_for_url`` takes, with a sentence for each failure.

Whatever its kind, an open port is read the same way afterwards: ``timeout`` is set to what is left of a deadline,
then comes ``read(max(1, in_waiting))``. A kind that cannot be read so at a robot's pace is mended here.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import select
import socket
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Protocol

import serial
from serial import rfc2217
from serial.tools import list_ports

from khepera_hil import adapter
from khepera_hil.errors import PortError

try:
    from termios import error as TermiosError
except ImportError:  # a host without termios cannot raise its error either
    TermiosError = OSError  # type: ignore[misc,assignment]  # stands for the class that is not there

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

__all__ = ["PORT_ERRORS", "WRITE_TIMEOUT", "Port", "close_port", "descriptor", "open_port", "reopen", "search"]

WRITE_TIMEOUT = 0.08
"""Seconds for a request of a few bytes to be taken by the host; only a peer that stopped reading needs more."""

PORT_ERRORS = (OSError, TermiosError)
"""All that an open port raises when it is gone. SerialException is an OSError, termios.error is not."""

# A handler's own check of a name is uneven: hwgrep:// lets a bad pattern's re.error out, spy:// and alt:// a
# TypeError or a LookupError, where socket:// raises SerialException.
_OPENING_ERRORS = (*PORT_ERRORS, ValueError, ArithmeticError, NotImplementedError, TypeError, LookupError, re.error)

_FORMS = {
    "socket": "socket://HOST:PORT",
    "rfc2217": "rfc2217://HOST:PORT",
    "spy": "spy://DEVICE?file=NAME",
    "hwgrep": "hwgrep://PATTERN",
    "loop": "loop://",
}
"""How pyserial's kinds of ports are named."""


class Port(Protocol):
    """What a link needs of an open pyserial port, whatever its kind."""

    timeout: float | None

    @property
    def port(self) -> str | None:
        """The name under which it was opened."""

    @property
    def in_waiting(self) -> int:
        """Bytes (or, on a socket, whether there are any) that a read would give at once."""

    def read(self, size: int = ..., /) -> bytes:
        """``size`` bytes, or what came within ``timeout`` seconds."""

    def write(self, data: bytes, /) -> int | None:
        """Hand bytes to the line."""

    def close(self) -> None:
        """Give the port back."""


class _Device(serial.Serial):
    """A device, whose writing has one deadline: pyserial calls a write that was done, but late, a failure too."""

    def write(self, b: ReadableBuffer, /) -> int:
        """Hand bytes to the line. Raises SerialTimeoutException when it does not take them in time."""
        if not self.is_open:
            raise serial.PortNotOpenError
        data = bytes(memoryview(b))
        fd, length = self.fileno(), len(data)
        deadline = time.monotonic() + WRITE_TIMEOUT
        while data:
            with contextlib.suppress(BlockingIOError):
                data = data[os.write(fd, data) :]
            left = deadline - time.monotonic()
            if data and not select.select([], [fd], [], max(left, 0.0))[1] and left <= 0:
                raise serial.SerialTimeoutException("what is written is not taken")
        return length


class _PortServer(rfc2217.Serial):
    """pyserial's client of RFC 2217 port servers, made fit for one deadline for each request.

    pyserial takes every new ``timeout`` for a new setting of the line, negotiates all settings again and sleeps for
    at least 50 ms. But the server knows no read timeout: it is ours alone, and the line's settings stay. Also
    pyserial refuses a write timeout, although its socket can keep one; and it reads a single byte when no time is
    left, where every other kind of port gives all that is there.
    """

    _timeout: float | None  # SerialBase's; what its read waits

    @property
    def timeout(self) -> float | None:
        """Seconds that a read waits."""
        return self._timeout

    @timeout.setter
    def timeout(self, seconds: float | None) -> None:
        self._timeout = seconds

    def open(self) -> None:
        """Connect and negotiate the line's settings."""
        super().open()
        line = _socket_of(self)
        if line is not None:
            line.settimeout(WRITE_TIMEOUT)  # the reader thread only looks more often whether it should end

    def read(self, size: int = 1, /) -> bytes:
        """``size`` bytes, or what came within ``timeout`` seconds and what has come until then."""
        data = super().read(size)
        while len(data) < size and self.in_waiting:
            data += super().read(1)
        return data


def open_port(url: str, baud: int, say: Callable[[str], None] = lambda remark: None) -> Port:
    """Open whatever ``serial_for_url`` takes: 8 data bits, 2 stop bits, no parity, no flow control (manual, 3.1.3).

    A device is locked against other users of such locks, and its adapter asked to pass bytes on at once; ``say``
    gets a sentence where it will not. Raises PortError, one sentence that says what to do.
    """
    port = None
    try:
        port = _unopened(url, baud)
        port.open()
        port.write(b"")  # spy:// with the option raw opens, and would fail at each write
    except _OPENING_ERRORS as error:
        if port is not None:
            close_port(port)
        raise PortError(_what_to_do(url, baud, error)) from error
    if isinstance(port, _Device):
        if others := [other for other in search(port) if other is not None]:
            close_port(port)
            raise PortError(f"{url!r} is in use by another program, {', '.join(others)}: end that first")
        if (remark := adapter.hurry(port)) is not None:
            say(remark)
    line = _socket_of(port)
    if line is not None:
        # Two small packets in a row, as a resynchronisation sends, would wait for the peer's delayed receipt.
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return port


def reopen(port: Port, url: str, baud: int, say: Callable[[str], None] = lambda remark: None) -> Port:
    """Open anew what was lost. Raises PortError while it is not there.

    Everything is opened by its name, as at first; but the robot inside this process is the one that ``port`` knows.
    """
    if not getattr(port, "unplugged", False):
        return open_port(url, baud, say)
    try:
        port.open()  # type: ignore[attr-defined]  # only an emulator's port can be unplugged so
    except PORT_ERRORS as error:
        raise PortError(f"{url!r} is unplugged") from error
    return port


def search(port: Port) -> Iterator[str | None]:
    """Other programs that have the same device open, where that can be seen (see :func:`adapter.search`)."""
    if not isinstance(port, _Device) or not port.is_open:
        return iter(())
    return adapter.search(port.fileno())


def close_port(port: Port) -> None:
    """Give a port back that may be gone already. Raises nothing."""
    line = _socket_of(port)
    with contextlib.suppress(*PORT_ERRORS):  # gone is what was wanted
        port.close()
    if line is not None:
        line.close()  # pyserial leaves a socket open whose peer went first


def descriptor(port: Port) -> int | None:
    """The descriptor by which another process can write to an open port; None for a port that has none.

    What is written to a device, a socket or a port server's socket comes out at the robot as it is.
    """
    line = _socket_of(port)
    try:
        number = line.fileno() if line is not None else port.fileno()  # type: ignore[attr-defined] # of some kinds only
    except (OSError, AttributeError, ValueError):
        return None
    return number if isinstance(number, int) and number >= 0 else None


def _unopened(url: str, baud: int) -> serial.Serial | _PortServer:
    """The port of the class that the name asks for."""
    if _kind(url) == "rfc2217":
        port = _PortServer(None, baud, stopbits=serial.STOPBITS_TWO, timeout=0)
        port.port = url
        return port
    settings: dict[str, Any] = {
        "baudrate": baud,
        "stopbits": serial.STOPBITS_TWO,
        "timeout": 0,
        "write_timeout": WRITE_TIMEOUT,
        "exclusive": True,
    }
    if not _kind(url) and os.name == "posix":
        device = _Device(None, **settings)
        device.port = url
        return device
    return serial.serial_for_url(url, **settings, do_not_open=True)


def _kind(url: str) -> str:
    """What stands before ``://``, in small letters as pyserial reads it; empty for a device."""
    kind, mark, _ = url.partition("://")
    return kind.lower() if mark else ""


def _socket_of(port: object) -> socket.socket | None:
    """The socket inside a port of the kinds socket:// and rfc2217://, which pyserial keeps to itself."""
    line = getattr(port, "_socket", None)
    return line if isinstance(line, socket.socket) else None


def _what_to_do(url: str, baud: int, error: Exception) -> str:
    """The sentence for a port that did not open."""
    number = _errno(error)
    kind = _kind(url)
    said = str(error)
    if kind and "not known" in said and isinstance(error, ValueError):
        return f"{url!r} is no kind of port: use a device such as /dev/ttyUSB0, socket://HOST:PORT or emulator"
    if kind == "rfc2217" and "support RFC2217" in said:
        return f"what listens at {url!r} is no port server of RFC 2217: try socket://HOST:PORT"
    if kind == "rfc2217" and ("rejected" in said or "does not accept" in said):
        return (
            f"the port server of {url!r} cannot set its line to {baud} baud, 8 data bits and 2 stop bits ({said})"
        )
    if kind == "rfc2217" and "waiting for option" in said:
        return f"the port server of {url!r} leaves a setting unconfirmed: try ?ign_set_control behind it ({said})"
    if kind == "spy" and isinstance(error, TypeError):
        return f"{url!r} cannot be written raw by pyserial: leave out the option raw"
    if kind == "spy" and isinstance(error, OSError) and error.filename:
        return f"the file of {url!r} cannot be written: {error.strerror}: {error.filename!r}"
    if kind == "hwgrep" and "no ports found" in said:
        return f"no port matches {url!r}; {_ports_here()}"
    if number == errno.ENOENT:
        return f"there is no port {url!r}; {_ports_here()}"
    if number in (errno.EACCES, errno.EPERM):
        return f"{url!r} may not be opened by you: join its group, mostly dialout, and log in again"
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{url!r} is in use by another program: end that first"
    if number in (errno.ENOTTY, errno.EISDIR, errno.ENOTDIR, errno.EINVAL):
        return f"{url!r} is no serial port: give the name of one"
    if number in (errno.ENXIO, errno.ENODEV, errno.EIO):
        return f"{url!r} has a name but no device behind it: is the adapter plugged in?"
    if number == errno.ECONNREFUSED:
        return f"nobody listens at {url!r}: start the server there, or mend the address"
    if isinstance(error, (ValueError, OverflowError)) and "://" not in url:
        return f"{url!r} cannot be set to {baud} baud: choose another rate (--baud)"
    if number is None and isinstance(error, OSError) and "timed out" in said:
        return f"nobody answers at {url!r}: mend the address, or see that the machine is on"
    if number is None and kind in _FORMS:
        # Python's own errors in pyserial's reading of a name say nothing to the user.
        dumb = any(isinstance(one, (TypeError, LookupError)) for one in _chain(error))
        return f"{url!r} cannot be opened, write it as {_FORMS[kind]}{'' if dumb else f' ({said})'}"
    return f"{url!r} cannot be opened, check its name: {said}"


def _ports_here() -> str:
    seen = ", ".join(sorted(port.device for port in list_ports.comports()))
    return f"this computer has {seen}" if seen else "this computer shows no serial port: is the adapter plugged in?"


def _errno(error: BaseException) -> int | None:
    """The operating system's number for what went wrong; pyserial often hides it one or two errors down."""
    for one in _chain(error):
        number = getattr(one, "errno", None) or (one.args[0] if isinstance(one, TermiosError) else None)
        if isinstance(number, int):
            return number
    return None


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """An error and those that it came from."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__
