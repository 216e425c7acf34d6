"""A bounded queue and one thread behind it: what is derived from the log never holds up the loop.

With the wall clock a full queue drops the newest tick and counts it; with the simulated clock the loop waits
for room, so that nothing is dropped and a run repeats. An error of the sink never reaches the loop: it is
kept, the rest of the run is discarded, and :meth:`Follower.close` tells it once.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

__all__ = ["Follower", "Sink"]

T = TypeVar("T")
T_contra = TypeVar("T_contra", contravariant=True)

IDLE = 1.0
"""Seconds without a tick after which the sink is asked to flush."""


class Sink(Protocol[T_contra]):
    """Where the items go. Its methods are called by the follower's thread only."""

    def write(self, item: T_contra, dropped: int) -> None:
        """Take one item; ``dropped`` is how many were lost so far."""

    def flush(self) -> None:
        """Nothing came for a while: bring out what is held back."""

    def close(self) -> None:
        """The last item was written."""


class Follower(Generic[T]):
    """Feeds ``sink`` from a queue of ``capacity`` items.

    ``sink`` may be a function that opens it: it is called in the follower's thread, so that a file that cannot be
    opened, or an opening that hangs, does not hold up whoever waits for it by :meth:`wait_until_open`.

    ``waits``: :meth:`offer` waits for room instead of dropping, but never longer than ``patience`` seconds: a
    sink that takes nothing for so long is given up. ``deadline`` (s) bounds :meth:`close`.
    """

    def __init__(
        self,
        sink: Sink[T] | Callable[[], Sink[T]],
        *,
        name: str,
        waits: bool,
        capacity: int = 256,
        patience: float = 30.0,
        deadline: float = 10.0,
    ) -> None:
        self.name = name
        self._refused = 0  # counted by the loop's thread
        self._discarded = 0  # counted by the follower's: two counters, so neither needs a lock
        self.error: str | None = None
        """Why the sink gave up, or None."""
        self._open: Callable[[], Sink[T]] = sink if callable(sink) else lambda: sink
        self._opened = threading.Event()
        self._waits = waits
        self._patience = patience
        self._deadline = deadline
        self._queue: queue.Queue[T | None] = queue.Queue(capacity)
        self._closed = False
        # A daemon: a sink that hangs must not keep the process alive; close() joins with a deadline.
        self._thread = threading.Thread(target=self._run, name=f"follower of {name}", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """Items that never reached the sink so far."""
        return self._refused + self._discarded

    def wait_until_open(self) -> None:
        """Wait until the sink was opened, or has failed to be within ``patience`` seconds."""
        if not self._opened.wait(self._patience):
            self.error = f"it could not be opened within {self._patience:g} s"

    def offer(self, item: T) -> None:
        """Hand an item over; never raises."""
        if self.error is not None or self._closed:
            self._refused += 1
            return
        try:
            if self._waits:
                self._queue.put(item, timeout=self._patience)
            else:
                self._queue.put_nowait(item)
        except queue.Full:
            self._refused += 1
            if self._waits:
                self.error = f"it took nothing for {self._patience:g} s"

    def close(self) -> list[str]:
        """Let the sink take what is queued and close it; sentences about what was lost, told once."""
        if self._closed:
            return []
        self._closed = True
        end = time.monotonic() + self._deadline
        try:
            self._queue.put(None, timeout=self._deadline)
        except queue.Full:
            pass
        else:
            self._thread.join(max(0.0, end - time.monotonic()))
        losses = []
        if self.error is not None:
            losses.append(f"{self.name} is incomplete: {self.error}")
        elif self._thread.is_alive():
            losses.append(f"{self.name} was not finished within {self._deadline:g} s")
        if self.dropped:
            losses.append(f"{self.name} lacks {self.dropped} ticks")
        return losses

    def _run(self) -> None:
        try:
            sink = self._open()
        except Exception as error:  # noqa: BLE001 - as in _guarded
            self.error = f"{type(error).__name__}: {error}"
            return
        finally:
            self._opened.set()
        while True:
            try:
                item = self._queue.get(timeout=IDLE)
            except queue.Empty:
                if self.error is None:
                    self._guarded(sink.flush)
                continue
            if item is None:
                # Closed after an error too: what was written before it may still be worth finishing.
                self._guarded(sink.close)
                return
            if self.error is None:
                self._guarded(sink.write, item, self.dropped)
            else:
                self._discarded += 1  # taken off the queue all the same, so that nobody waits for room for ever

    def _guarded(self, step: Callable[..., None], *arguments: object) -> None:
        try:
            step(*arguments)
        except Exception as error:  # noqa: BLE001 - whatever a sink dies of, it must not reach the loop
            if self.error is None:
                self.error = f"{type(error).__name__}: {error}"
