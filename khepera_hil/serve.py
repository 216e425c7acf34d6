"""The emulator for programs of any kind, behind an endpoint of the operating system's.

One thread, no busy waiting; clients come and go, the robot goes on as a robot does.
"""

from __future__ import annotations

import select
from collections.abc import Callable

from khepera_hil.clock import Clock, WallClock
from khepera_hil.disturbed import Disturbed
from khepera_hil.emulator import Emulator
from khepera_hil.endpoints import Endpoint

__all__ = ["serve"]

_LONGEST_SLEEP = 0.1
"""Seconds: the world is moved on at least so often, so that no request finds a long time to catch up with."""

_LONGEST_GAP = 2.0
"""Seconds between two looks at the clock; beyond it this process was stopped, and the robot's time with it."""

_UNSENT = 4096
"""Characters under way at which no more are taken from the client: its writes then block, as on a real port."""


def serve(
    endpoint: Endpoint,
    emulator: Emulator,
    *,
    stop: int,
    watch: Callable[[float], None] = lambda now: None,
    clock: Clock | None = None,
) -> float:
    """Carry the bytes between ``endpoint`` and ``emulator`` until ``stop`` is readable; the robot's time then.

    ``stop`` is a file descriptor: make it a pipe's end that a signal handler writes to. ``watch`` is told the
    robot's time, at least every 0.1 s. ``clock`` is the wall's. A client on a terminal that sets another rate than
    the robot's reads and writes garbage. Where faults unplug the line, the endpoint is gone meanwhile.
    """
    time = _Unstopped(clock or WallClock())
    while True:
        now = time.now()
        if isinstance(emulator, Disturbed) and emulator.unplugged(now):
            endpoint.unplug()
            if emulator.plug_in(now):
                endpoint.plug_in()
        _to_client(endpoint, emulator, now)
        watch(now)
        due = emulator.next_event()
        wait = _LONGEST_SLEEP if due is None else min(_LONGEST_SLEEP, max(0.0, due - time.now()))
        waiting = [stop, *endpoint.readable(client=emulator.unsent(now) < _UNSENT)]
        ready, _, _ = select.select(waiting, [], [], wait)
        if stop in ready:
            now = time.now()
            emulator.advance(now)
            return now
        if ready:
            _from_client(endpoint, emulator, endpoint.read(ready), time.now())


def _to_client(endpoint: Endpoint, emulator: Emulator, now: float) -> None:
    """All that leaves the robot passes here."""
    _follow(endpoint, emulator)
    endpoint.send(emulator.transmitted(now))
    if not emulator.talking:
        endpoint.said_all()


def _from_client(endpoint: Endpoint, emulator: Emulator, data: bytes, now: float) -> None:
    """All that reaches the robot passes here."""
    if data:
        _follow(endpoint, emulator)
        emulator.receive(data, now)


def _follow(endpoint: Endpoint, emulator: Emulator) -> None:
    """Nothing times the bytes between a client and us, so its rate is the one that stands now."""
    rate = endpoint.rate
    if rate is not None:
        emulator.host_baud = rate


class _Unstopped:
    """Time while this process runs: after a Ctrl-Z of an hour there is no hour of physics to catch up with."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._last = clock.now()
        self._lost = self._last

    def now(self) -> float:
        now = self._clock.now()
        if now - self._last > _LONGEST_GAP:
            self._lost += now - self._last
        self._last = now
        return now - self._lost
