"""What keeps the machine out of the loop's way: garbage collection in idle time, and a class of its own.

What waits for the tick hardly matters, the scheduler's class does: as SCHED_FIFO the loop wakes within a
millisecond also where both cores are busy (see the README's figures). It takes a privilege (CAP_SYS_NICE, or
``LimitRTPRIO`` of a systemd unit), so it is asked for by ``--realtime`` and never required.
"""

from __future__ import annotations

import ctypes
import gc
import os
import resource
import time
from collections.abc import Callable

__all__ = ["PRIORITY", "Collector", "ask_for_realtime"]

PRIORITY = 50
"""Of SCHED_FIFO, between 1 and 99; the guard takes a higher one."""

_CURRENT, _FUTURE = 1, 2  # MCL_CURRENT and MCL_FUTURE of mlockall(2)


def ask_for_realtime() -> list[str]:
    """SCHED_FIFO for this thread and no page of this process swapped out; a sentence for what was refused."""
    refused = []
    try:
        # Without the flag every thread started from here on would inherit it, the recorder among them.
        flags = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, flags, os.sched_param(PRIORITY))
    except (OSError, AttributeError) as error:
        refused.append(f"--realtime: SCHED_FIFO was refused ({_why(error)}); the loop runs in the ordinary class")
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        # Under a limit what is taken later must not be locked: the page that does not fit would be refused.
        unlimited = os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY
        if libc.mlockall(_CURRENT | _FUTURE if unlimited else _CURRENT) != 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    except (OSError, AttributeError) as error:
        refused.append(f"--realtime: memory could not be locked ({_why(error)}); a page may have to be fetched")
    return refused


def _why(error: Exception) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


class Collector:
    """Python's garbage collector, held off the tick: it works when the loop has time to spare, or not at all.

    A full collection of what a service imports takes tens of milliseconds, and it comes when it likes. So what
    exists at the start is set aside for good, the collector is switched off, and between ticks the young are
    collected, now and then all that came since the start. ``now`` is a stopwatch (s).
    """

    YOUNG, ALL = 50, 3000
    """Ticks between two collections of the young, and of everything."""

    def __init__(self, now: Callable[[], float] = time.perf_counter) -> None:
        self._now = now
        self._ticks = 0
        self._takes = [0.0, 0.0, 0.0]  # seconds that the last one of each kind took
        self._due = [False, False, False]
        self._was_enabled = gc.isenabled()

    def begin(self) -> None:
        """Set aside what there is, and switch the collector off."""
        gc.collect()
        gc.freeze()
        gc.disable()

    def idle(self, slack: float) -> None:
        """After a tick, with so many seconds left before the next: collect what is due, if it fits.

        What does not fit into three times its length waits, but not for ever: after as many ticks again it is done
        all the same, since memory that grows would end the run.
        """
        self._ticks += 1
        if self._ticks % self.YOUNG == 0 or self._due[1]:
            self._collect(1, slack)
        if self._ticks % self.ALL == 0 or self._due[2]:
            self._collect(2, slack)

    def _collect(self, generation: int, slack: float) -> None:
        overdue = self._due[generation] and self._ticks % (self.YOUNG if generation == 1 else self.ALL) == 0
        if slack < 3 * self._takes[generation] and not overdue:
            self._due[generation] = True
            return
        began = self._now()
        gc.collect(generation)
        self._takes[generation] = self._now() - began
        self._due[generation] = False

    def end(self) -> None:
        """As before."""
        gc.unfreeze()
        if self._was_enabled:
            gc.enable()
