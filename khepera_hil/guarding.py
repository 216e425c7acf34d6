"""The service's end of its guard (see :mod:`khepera_hil.guard`): start it, beat, hand descriptors over, part.

A guard that is gone, for whatever reason, ends the run: :class:`~khepera_hil.errors.GuardLost`. It may have
tripped because we hung, and then somebody decided that the wheels shall stand still; or it was killed or is held up
itself, and then nobody would stop them if we were killed too.
"""

from __future__ import annotations

import array
import contextlib
import os
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Protocol

from khepera_hil import guard
from khepera_hil.errors import GuardLost

__all__ = ["Guarding", "Process", "Unguarded", "limit"]

STARTING = 10.0
"""Seconds that the guard may take to start."""

SPARING = 0.04
"""Seconds between two beats at the least; exchanges with the robot may come faster."""


ANSWERS = 2.0
"""Limits without an answer, while we run, after which the guard counts as gone: it must not be lost to a busy
machine, and to be without it for a moment is no danger yet."""


def limit(period: float) -> float:
    """Seconds without a beat after which the guard acts, for a tick every ``period`` seconds."""
    return max(0.4, period + 0.3)


class Guarding(Protocol):
    """What a service asks of its guard. Every method but the last two may raise GuardLost."""

    def watch(self, descriptor: int | None) -> None:
        """This port from now on; its wheels may be moving. None: the port is gone, or has no descriptor."""

    def beat(self) -> None:
        """The service is well."""

    def moving(self) -> None:
        """The wheels will be told to move now: call it right before."""

    def check(self) -> None:
        """See whether it is still there and well; it is not disturbed by that."""

    def resting(self) -> None:
        """The robot has confirmed that it stands still."""

    def record_in(self, folder: Path) -> None:
        """Where to leave a line, should there be one."""

    def close(self) -> None:
        """Part in peace: there is nothing to be stopped any more."""


class Unguarded:
    """For a port without a descriptor: the emulator in our own process, which ends with us, or a loop."""

    def watch(self, descriptor: int | None) -> None:
        """Nobody watches."""

    def beat(self) -> None:
        """Nobody listens."""

    def moving(self) -> None:
        """Nobody cares."""

    def check(self) -> None:
        """Nobody is missed."""

    def resting(self) -> None:
        """Nobody cares."""

    def record_in(self, folder: Path) -> None:
        """Nothing will be written."""

    def close(self) -> None:
        """Nobody is there."""


class Process:
    """A guard that runs. ``limit`` (s): see :func:`limit`. Raises GuardLost when it does not start."""

    def __init__(self, limit: float) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            with theirs:
                self._process = _started(theirs, limit)
            try:
                ours.settimeout(STARTING)
                if ours.recv(1) != guard.READY:
                    raise GuardLost("the guard, which would stop the wheels for us, ended as it started")
            except BaseException:
                self._process.kill()
                self._process.wait()
                raise
        except OSError as error:
            ours.close()
            raise GuardLost(f"the guard, which would stop the wheels for us, does not start: {error}") from error
        except BaseException:
            ours.close()
            raise
        ours.setblocking(False)
        self._pipe = ours
        self._moving = self._lost = False
        self._beaten = 0.0
        self._patience = ANSWERS * limit
        self._unanswered = 0
        self._silent, self._listened = 0.0, time.monotonic()

    @property
    def pid(self) -> int:
        """Of the guard's process."""
        return self._process.pid

    def watch(self, descriptor: int | None) -> None:
        """Hand the port's descriptor over, or have the guard close its own."""
        self._moving = descriptor is not None
        if descriptor is None:
            self._send(guard.LET_GO)
        else:
            self._send(guard.PORT, descriptor)

    def beat(self) -> None:
        """Say that we are well, if it is time to say so again."""
        if time.monotonic() - self._beaten >= SPARING:
            self.check()
            self._send(guard.MOVING if self._moving else guard.RESTING)

    def moving(self) -> None:
        """Have the guard armed, and know that it is there."""
        if self._lost:
            raise GuardLost("the guard is gone, so nothing may be set in motion")
        if self._moving:
            # It knows, and has its beats. To wake it here would give it the processor, at the one moment at which
            # we should not be held up: between this look and the order.
            self.check()
        else:
            self._moving = True
            self._send(guard.MOVING)

    def check(self) -> None:
        """Hear its answers, without waiting for one."""
        if self._lost:
            return
        try:
            while (said := self._said()) == guard.HEARD:
                self._unanswered -= 1
                self._silent = 0.0
        except BlockingIOError:
            self._wonder()
            return
        self._lost = True
        raise GuardLost(_last_words(said))

    def _said(self) -> bytes:
        """The next that it said; nothing more when it is gone. Raises BlockingIOError."""
        try:
            return self._pipe.recv(500)
        except ConnectionResetError:
            pass  # it went with beats of ours unread; what it said before comes after that
        except BlockingIOError:
            raise
        except OSError:
            return b""
        try:
            return self._pipe.recv(500)
        except OSError:
            return b""

    def _wonder(self) -> None:
        """Whether it has been silent for too long. What we have slept through ourselves is not held against it."""
        now = time.monotonic()
        if self._unanswered:
            self._silent += min(now - self._listened, self._patience / 8)
        self._listened = now
        if self._silent >= self._patience:
            self._lost = True
            raise GuardLost("the guard does not answer, is it held up? Without it the wheels may not move")

    def resting(self) -> None:
        """The guard is armed no more."""
        if self._moving:
            self._moving = False
            self._send(guard.RESTING)

    def record_in(self, folder: Path) -> None:
        """Hand the folder over, which may be renamed meanwhile."""
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            self._send(guard.FOLDER, descriptor)
        finally:
            os.close(descriptor)

    def close(self) -> None:
        """Wait until the guard has gone, so that its descriptor does not keep the port from being opened again."""
        with contextlib.suppress(OSError):
            self._pipe.send(guard.GOODBYE)
        self._pipe.close()
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send(self, message: bytes, *descriptors: int) -> None:
        """To a guard that was found gone before nothing is sent: that was said."""
        if self._lost:
            return
        rights = (socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", descriptors))
        try:
            self._pipe.sendmsg([message], [rights] if descriptors else [])
        except BlockingIOError:
            self._lost = True
            raise GuardLost("the guard takes no beats any more; the wheels are stopped") from None
        except OSError:
            self.check()  # it may have said why
            self._lost = True
            raise GuardLost(_last_words(b"")) from None
        self._beaten = time.monotonic()
        self._unanswered += 1


def _last_words(said: bytes) -> str:
    """Why the guard is gone; nothing when it was killed."""
    if said.startswith(guard.TRIPPED):
        why = said[1:].decode("utf-8", "replace")
        return f"the guard has stopped the wheels because {why}; start anew when you know why"
    return "the guard is gone, was it killed? Without it the wheels may not move; they are stopped"


def _started(pipe: socket.socket, limit: float) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-I", "-S", "-B", guard.__file__, str(pipe.fileno()), repr(limit)],
        pass_fds=[pipe.fileno()],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        start_new_session=True,  # out of reach of the terminal's Ctrl-C and Ctrl-Z
        cwd="/",
        env={},
    )
