"""The guard: a process of its own that stops the wheels when the service no longer can.

A Khepera keeps its last speed when its host is silent, so somebody must speak for a service that was killed or
hangs. This file is that somebody: it is run as a script by the path of its file, isolated and without site
packages, so that it starts in a few hundredths of a second and takes a few megabytes. It imports the standard
library only and nothing of ours; :mod:`khepera_hil.guarding` is the service's end.

The two are joined by a socket pair that keeps messages apart (SOCK_SEQPACKET); it is the heartbeat's pipe and
carries descriptors too. From the service come

* ``PORT`` with a descriptor: watch this port from now on; its wheels may be moving;
* ``LET_GO``: the port is gone, close your descriptor (or its device could not come back under its name);
* ``FOLDER`` with a descriptor: the run's folder;
* ``MOVING`` and ``RESTING``: a beat, with which of the two the wheels are;
* ``GOODBYE``: the service ends well, and there is nothing to do.

The guard says ``READY`` once and ``HEARD`` to each message, so that a guard that is held up itself is missed. It
acts when the wheels may be moving and the pipe ends without a goodbye, or brings
nothing for ``limit`` seconds: it says ``TRIPPED`` and why, and shuts its end of the pipe, so that a service that
wakes finds it gone from here on; throws away what has not left the host's buffer; sends a line end, which ends
half a command, and ``D,0,0``, and once more after 20 ms; writes a line to ``guard.jsonl`` in the run's folder; and
exits. As long as the service is well it never sends a byte.
"""

from __future__ import annotations

import array
import contextlib
import json
import os
import select
import signal
import socket
import sys
import termios
import time

__all__ = [
    "FOLDER",
    "GOODBYE",
    "HEARD",
    "LET_GO",
    "LOG",
    "MOVING",
    "PORT",
    "READY",
    "RESTING",
    "TRIPPED",
    "Guard",
]

PORT, LET_GO, FOLDER, MOVING, RESTING, GOODBYE = b"P", b"L", b"F", b"m", b"r", b"Q"
READY, HEARD, TRIPPED = b"G", b"H", b"T"

LOG = "guard.jsonl"

STOP = b"\nD,0,0\n"
AGAIN = 0.020
"""Seconds between the two orders to stand still."""

SLICE = 0.050
"""Seconds of silence that are counted at a time, at most twice that: while the machine lets neither of us run
(a virtual machine held up, both cores full) the silence is not the service's."""

BLOCKED = 0.5
"""Seconds after which a port that takes no byte is given up."""


class Guard:
    """One service's guard, at its end of the pipe."""

    def __init__(self, pipe: socket.socket, limit: float) -> None:
        self._pipe, self._limit = pipe, limit
        self._port: int | None = None
        self._folder: int | None = None
        self._moving = False
        self._beats = 0

    def watch(self) -> None:
        """Until the service says goodbye, or until it had to be spoken for."""
        poll = select.poll()
        poll.register(self._pipe, select.POLLIN)
        silent = 0.0
        while True:
            began = time.monotonic()
            # Without moving wheels there is nothing to wake up for but a message.
            if poll.poll(SLICE * 1000 if self._armed else None):
                silent = 0.0
                message, fds = self._receive()
                if message == GOODBYE:
                    return
                if not message:
                    if self._armed:
                        self._act("the service is gone")
                    return
                self._heed(message, fds)
                with contextlib.suppress(OSError):  # one that has not listened for long is not waited for
                    self._pipe.send(HEARD, socket.MSG_DONTWAIT)
            else:
                silent += min(time.monotonic() - began, 2 * SLICE)
                if silent >= self._limit:
                    self._act(f"the service gave no sign for {silent * 1000:.0f} ms")
                    return

    @property
    def _armed(self) -> bool:
        return self._moving and self._port is not None

    def _receive(self) -> tuple[bytes, list[int]]:
        """One message and its descriptors; an empty one when the pipe has ended."""
        fds = array.array("i")
        try:
            try:
                message, ancillary, _, _ = self._pipe.recvmsg(16, socket.CMSG_SPACE(fds.itemsize))
            except ConnectionResetError:
                # The service went with answers of ours unread. That is told once, and first; a goodbye comes after.
                message, ancillary, _, _ = self._pipe.recvmsg(16, socket.CMSG_SPACE(fds.itemsize))
        except OSError:
            return b"", []
        for level, kind, data in ancillary:
            if level == socket.SOL_SOCKET and kind == socket.SCM_RIGHTS:
                fds.frombytes(data[: len(data) - len(data) % fds.itemsize])
        return message, list(fds)

    def _heed(self, message: bytes, fds: list[int]) -> None:
        self._beats += 1
        if message in (PORT, LET_GO) and self._port is not None:
            os.close(self._port)
            self._port = None
        if message == PORT and fds:
            self._port, self._moving = fds.pop(0), True
        elif message == FOLDER and fds and self._folder is None:
            self._folder = fds.pop(0)
        elif message in (MOVING, RESTING):
            self._moving = message == MOVING
        for fd in fds:
            os.close(fd)

    def _act(self, why: str) -> None:
        assert self._port is not None
        with contextlib.suppress(OSError):  # the other end may be gone
            self._pipe.send(TRIPPED + why.encode(), socket.MSG_DONTWAIT)
            self._pipe.shutdown(socket.SHUT_RDWR)
        error = _stop(self._port)
        os.close(self._port)
        done = "could not tell the wheels to stop" if error else "told the wheels to stop"
        line = {"wall": time.time(), "why": why, "sent": error is None, "error": error, "beats": self._beats}
        with contextlib.suppress(OSError):  # the wheels are what counts
            self._write(line)
        _say(f"khepera-hil guard: {why}; {done}{f' ({error})' if error else ''}\n")

    def _write(self, line: dict[str, object]) -> None:
        if self._folder is None:
            return
        log = os.open(LOG, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644, dir_fd=self._folder)
        os.write(log, json.dumps(line).encode() + b"\n")
        os.close(log)


def _say(text: str) -> None:
    """On standard error, if it takes a line now: nobody may be reading."""
    poll = select.poll()
    poll.register(2, select.POLLOUT)
    with contextlib.suppress(OSError):
        if any(event & select.POLLOUT for _, event in poll.poll(0)):
            os.write(2, text.encode())


def _stop(port: int) -> str | None:
    """Order the wheels to stand still, twice; what went wrong when neither order got out."""
    # Half a command, or commands that would only come first, may wait in the host's buffer. What cannot be thrown
    # away (a socket's) goes first.
    with contextlib.suppress(OSError, termios.error):
        termios.tcflush(port, termios.TCOFLUSH)
    with contextlib.suppress(OSError):
        os.set_blocking(port, False)
    first = _written(port)
    time.sleep(AGAIN)
    second = _written(port)
    return None if first is None or second is None else first


def _written(port: int) -> str | None:
    """Write the order whole, or say why not."""
    left = STOP
    give_up = time.monotonic() + BLOCKED
    while left:
        try:
            left = left[os.write(port, left) :]
        except BlockingIOError:
            if time.monotonic() >= give_up:
                return "the port takes no byte"
            writable = select.poll()
            writable.register(port, select.POLLOUT)
            writable.poll(AGAIN * 1000)
        except OSError as error:
            return error.strerror or str(error)
    return None


def main(fd: int, limit: float) -> None:
    """Be the guard at this descriptor of the pipe."""
    # A Ctrl-C, a closed terminal, a manager that ends us with the service: none of them may come first.
    # SIGABRT is what a manager's watchdog ends a whole group by.
    for which in (
        signal.SIGINT,
        signal.SIGQUIT,
        signal.SIGTSTP,
        signal.SIGTERM,
        signal.SIGHUP,
        signal.SIGABRT,
        signal.SIGPIPE,
    ):
        signal.signal(which, signal.SIG_IGN)
    # Above a service with --realtime, or one in an endless loop on a single core would keep us from running.
    # We wake for some microseconds at each beat. Where it is not allowed, the ordinary class must do.
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))
    with socket.socket(fileno=fd) as pipe:
        pipe.send(READY)
        Guard(pipe, limit).watch()


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
