"""The emulator for programs of any kind, behind endpoints of the operating system's: one for each robot.

One thread, no busy waiting; clients come and go, the robots go on as robots do.
"""

from __future__ import annotations

import select
from collections.abc import Callable, Collection, Iterable

from khepera_hil.clock import Clock, WallClock
from khepera_hil.disturbed import Disturbed
from khepera_hil.emulator import Emulator
from khepera_hil.endpoints import Endpoint

__all__ = ["serve"]

_LONGEST_SLEEP = 0.1
"""Seconds: the world is moved on at least so often, so that no request finds a long time to catch up with."""

_LONGEST_GAP = 2.0
"""Seconds between two looks at the clock; beyond it this process was stopped, and the robots' time with it."""

_UNSENT = 4096
"""Characters under way at which no more are taken from the client: its writes then block, as on a real port."""


def serve(
    lines: Iterable[tuple[Endpoint, Emulator]],
    *,
    stop: int,
    watch: Callable[[float], None] = lambda now: None,
    clock: Clock | None = None,
) -> float:
    """Carry the bytes between endpoints and emulators until ``stop`` is readable; the robots' time then.

    Emulators of one world are to be one :class:`~khepera_hil.emulator.Company`. ``stop`` is a file descriptor: make
    it a pipe's end that a signal handler writes to. ``watch`` is told the robots' time, at least every 0.1 s.
    ``clock`` is the wall's. A client on a terminal that sets another rate than the robot's reads and writes
    garbage. Where faults unplug a line, its endpoint is gone meanwhile.
    """
    served = [_Served(endpoint, emulator) for endpoint, emulator in lines]
    time = _Unstopped(clock or WallClock())
    while True:
        now = time.now()
        for line in served:
            line.to_client(now)
        watch(now)
        due = min((moment for line in served if (moment := line.emulator.next_event()) is not None), default=None)
        wait = _LONGEST_SLEEP if due is None else min(_LONGEST_SLEEP, max(0.0, due - time.now()))
        waiting = [stop, *(descriptor for line in served for descriptor in line.readable(now))]
        ready, _, _ = select.select(waiting, [], [], wait)
        if stop in ready:
            now = time.now()
            for line in served:
                line.emulator.advance(now)
            return now
        if ready:
            for line in served:
                line.from_client(ready, time.now())


class _Served:
    """One line: who opens it, and the robot at its end."""

    def __init__(self, endpoint: Endpoint, emulator: Emulator) -> None:
        self.endpoint, self.emulator = endpoint, emulator

    def readable(self, now: float) -> list[int]:
        """What to wait on."""
        return self.endpoint.readable(client=self.emulator.unsent(now) < _UNSENT)

    def to_client(self, now: float) -> None:
        """All that leaves the robot passes here."""
        endpoint, emulator = self.endpoint, self.emulator
        if isinstance(emulator, Disturbed) and emulator.unplugged(now):
            endpoint.unplug()
            if emulator.plug_in(now):
                endpoint.plug_in()
        self._follow(now)
        endpoint.send(emulator.transmitted(now))
        if not emulator.talking:
            endpoint.said_all()

    def from_client(self, ready: Collection[int], now: float) -> None:
        """All that reaches the robot passes here."""
        if data := self.endpoint.read(ready):
            self._follow(now)
            self.emulator.receive(data, now)

    def _follow(self, now: float) -> None:
        """Nothing times the bytes between a client and us, so its rate is the one that stands now."""
        rate = self.endpoint.rate
        if rate is not None:
            self.emulator.follow(rate, now)


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
