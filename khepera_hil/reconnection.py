"""The way back to a robot whose line was lost: its device found again, under a name that stays, with pauses.

Opening may take its time (a name to look up, a server that does not answer), and the loop goes on ticking
meanwhile; so it happens in a thread. With the simulated clock it happens in the loop, when the clock says so, and a
run repeats.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from khepera_hil.clock import Clock
from khepera_hil.errors import KheperaHilError
from khepera_hil.khepera import Khepera

__all__ = ["FIRST_PAUSE", "LONGEST_PAUSE", "Reconnection", "stable_name"]

FIRST_PAUSE = 0.05
LONGEST_PAUSE = 0.2
"""Seconds between two attempts: the first pause, doubled up to the longest."""

BY_ID = Path("/dev/serial/by-id")


class Reconnection:
    """Calls ``reopen`` (which makes a new port, link and robot, or raises an error of ours) until it succeeds.

    Made when the line is lost; :meth:`poll` it once a tick and :meth:`close` it when it is not needed any more.
    """

    def __init__(self, reopen: Callable[[], Khepera], clock: Clock) -> None:
        self._reopen, self._clock = reopen, clock
        self._pause = FIRST_PAUSE
        self.attempts = 0
        self._next = clock.now() + FIRST_PAUSE
        self._found: Khepera | None = None
        self._error: BaseException | None = None
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        if not clock.simulated:
            # A daemon: an opening that hangs must not keep the process alive.
            self._thread = threading.Thread(target=self._search, name="reconnection", daemon=True)
            self._thread.start()

    def poll(self) -> Khepera | None:
        """The robot, its line opened and nothing said yet; or None for now. Raises what is no failure to open."""
        if self._thread is None and self._clock.now() >= self._next:
            self._attempt()
            self._next = self._clock.now() + self._lengthen()
        with self._lock:
            found, self._found = self._found, None
            if found is not None:
                self._ended.set()
            if self._error is not None:
                raise self._error
        return found

    def close(self) -> None:
        """Give up; a port that is opened all the same is closed again."""
        with self._lock:
            self._ended.set()
            found, self._found = self._found, None
        if found is not None:
            found.link.close()

    def _search(self) -> None:
        while not self._ended.wait(self._lengthen()):
            if self._attempt():
                return

    def _lengthen(self) -> float:
        pause, self._pause = self._pause, min(2 * self._pause, LONGEST_PAUSE)
        return pause

    def _attempt(self) -> bool:
        """Whether there is nothing left to be tried."""
        self.attempts += 1
        try:
            found = self._reopen()
        except KheperaHilError:
            return False
        except Exception as error:  # noqa: BLE001 - a mistake of ours, which poll() tells the loop
            with self._lock:
                self._error = error
            return True
        with self._lock:
            if not self._ended.is_set():
                self._found = found
                return True
        found.link.close()
        return True


def stable_name(port: str, by_id: Path = BY_ID) -> str:
    """A name of the same device that stays when it is unplugged and comes back as another.

    ``/dev/ttyUSB0`` may return as ``/dev/ttyUSB1``, while another adapter takes its place: where the system keeps
    names by the adapter's own number (udev does), that name. A port that is no device, or has no such name, keeps
    its own; a link of the user's is followed anew at each opening.
    """
    device = Path(port)
    try:
        if "://" in port or device.is_symlink() or not device.exists():
            return port
        names = sorted(by_id.iterdir())
        return next((str(name) for name in names if name.resolve() == device.resolve()), port)
    except OSError:
        return port
