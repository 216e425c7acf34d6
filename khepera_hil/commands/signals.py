"""What a run does when the system speaks to it."""

from __future__ import annotations

import os
import signal
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from khepera_hil.service import Service

__all__ = ["heeded"]

_STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGTSTP)


@contextmanager
def heeded(service: Service) -> Iterator[None]:
    """Whatever asks the process to end or to pause ends the loop at its next tick, with wheels that stand still.

    Ctrl-C, SIGTERM, SIGQUIT and Ctrl-Z do so: a robot must not drive on because its job was stopped. All that
    follows is bounded in time, so a second Ctrl-C, which a wrapper may send, changes nothing. A terminal that is
    closed (SIGHUP) does not: the guard watches on, orders still arrive, and the run goes on without its terminal.
    """
    before = {which: signal.getsignal(which) for which in (*_STOPPING, signal.SIGHUP)}

    def stop(which: int, frame: FrameType | None) -> None:
        service.stop("signal")

    def hang_up(which: int, frame: FrameType | None) -> None:
        _leave_the_terminal()
        service.remark("warning", "the terminal has gone (SIGHUP); the run goes on")

    for which in _STOPPING:
        signal.signal(which, stop)
    if before[signal.SIGHUP] is not signal.SIG_IGN:  # nohup has seen to it
        signal.signal(signal.SIGHUP, hang_up)
    try:
        yield
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)


def _leave_the_terminal() -> None:
    """Each standard stream that is a terminal becomes /dev/null: writing to a terminal that is gone fails."""
    nowhere = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
    for fd in range(3):
        with suppress(OSError):
            about = os.fstat(fd)
            if stat.S_ISCHR(about.st_mode) and about.st_rdev != os.fstat(nowhere).st_rdev:
                os.dup2(nowhere, fd)
    os.close(nowhere)
