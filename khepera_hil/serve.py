"""The emulator behind a pseudo-terminal: any program that can talk to a serial device can talk to it.

One thread, no busy waiting; clients come and go, the robot goes on as a robot does.
"""

from __future__ import annotations

import fcntl
import os
import select
import struct
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from khepera_hil.clock import WallClock
from khepera_hil.emulator import Emulator
from khepera_hil.errors import PortError
from khepera_hil.uart import FIFO_16550
from khepera_hil.world import World

__all__ = ["serve_pty"]

_LONGEST_SLEEP = 0.1
"""Seconds: the world is moved on at least so often, so that no request finds a long time to catch up with."""

_UNSENT = 4096
"""Characters under way at which no more are taken from the client: its writes then block, as on a real port."""

_TCGETS2 = 0x802C542A  # Linux: a rate as a number, also one that has no name


def serve_pty(
    link: Path,
    world: World,
    *,
    baud: int,
    stop: int,
    on_ready: Callable[[str], None] = lambda device: None,
) -> dict[str, Any]:
    """Serve a robot in ``world``, which talks at ``baud``, under the name ``link`` until ``stop`` is readable.

    ``stop`` is a file descriptor: make it a pipe's end that a signal handler writes to. ``on_ready`` gets the
    device's name when clients may come. Returns the world's score. ``link`` is a symbolic link that is
    removed at the end; a client that sets another rate than ``baud`` reads and writes garbage.

    Raises :class:`~khepera_hil.errors.PortError` when ``link`` cannot be made, and UsageError for a rate
    that no Khepera has.
    """
    emulator = Emulator(world, baud, fifo=FIFO_16550)
    with _pseudo_terminal(baud) as (master, slave), _linked(link, os.ttyname(slave)):
        on_ready(os.ttyname(slave))
        clock = WallClock()
        while True:
            now = clock.now()
            # Nothing times the bytes between a client and us, so the rate is the one that stands now.
            emulator.host_baud = _speed(slave) or baud
            _send(master, emulator.transmitted(now))
            full = emulator.unsent(now) >= _UNSENT
            due = emulator.next_event()
            wait = _LONGEST_SLEEP if due is None else min(_LONGEST_SLEEP, max(0.0, due - clock.now()))
            readable, _, _ = select.select([stop] if full else [stop, master], [], [], wait)
            if stop in readable:
                emulator.advance(clock.now())
                return world.score()
            if master in readable:
                emulator.host_baud = _speed(slave) or baud
                emulator.receive(os.read(master, _UNSENT), clock.now())


def _send(master: int, data: bytes) -> None:
    """What a client does not fetch is lost when the kernel's buffer is full, as on a port that nobody reads."""
    while data:
        try:
            data = data[os.write(master, data) :]
        except BlockingIOError:
            return


@contextmanager
def _pseudo_terminal(baud: int) -> Iterator[tuple[int, int]]:
    """Both ends, raw and without echo from the start; ours of the slave stays open while clients come and go."""
    master, slave = os.openpty()
    try:
        tty.setraw(slave)
        attributes = termios.tcgetattr(slave)
        attributes[4] = attributes[5] = getattr(termios, f"B{baud}")
        attributes[2] |= termios.CSTOPB
        termios.tcsetattr(slave, termios.TCSANOW, attributes)
        os.set_blocking(master, False)
        yield master, slave
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


def _speed(slave: int) -> int:
    """The rate that the client has set; 0 when it hung up or has set none."""
    answer = fcntl.ioctl(slave, _TCGETS2, bytes(44))
    speed: int = struct.unpack("36xII", answer)[1]
    return speed
