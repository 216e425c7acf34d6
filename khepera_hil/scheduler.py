"""The loop's beat: absolute deadlines, lateness measured, missed ones skipped and counted, never caught up."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from khepera_hil.clock import Clock

__all__ = ["PAUSE", "Beat", "beats"]

PAUSE = 0.05
"""Seconds of waiting after which the loop shows that it is awake, and sees whether it shall stop."""


@dataclass(frozen=True)
class Beat:
    """One tick is due."""

    tick: int
    """How many ticks came before."""
    due: float
    """Seconds since the first tick's deadline: a whole number of periods."""
    late: float
    """Seconds between the deadline and now."""
    missed: int
    """Whole periods that were skipped just before."""


def beats(
    clock: Clock,
    period: float,
    *,
    duration: float | None,
    stopped: Callable[[], bool],
    waiting: Callable[[], None] = lambda: None,
) -> Iterator[Beat]:
    """A beat every ``period`` seconds, the first at once, until ``duration`` seconds are over or ``stopped()``.

    The n-th deadline is start + n * period, never the last one plus a period, so that nothing drifts. Whoever
    comes back more than a period late has missed deadlines; they are skipped and counted in the next beat.
    ``waiting`` is called every PAUSE of the time between; a simulated clock does not wait.
    """
    start = clock.now()
    number = tick = 0  # the deadline's number, and how many of them were kept
    while not stopped():
        due = number * period
        # Half a period of slack, since a duration such as 0.3 is seldom an exact multiple of 0.1.
        if duration is not None and due > duration - period / 2:
            return
        _wait(clock, start + due, stopped, waiting)
        late = max(0.0, clock.now() - (start + due))
        missed = int(late / period)
        if missed:
            number += missed
            due, late = number * period, late - missed * period
            if duration is not None and due > duration - period / 2:
                return
        if stopped():
            return
        yield Beat(tick, due, late, missed)
        number, tick = number + 1, tick + 1


def _wait(clock: Clock, moment: float, stopped: Callable[[], bool], waiting: Callable[[], None]) -> None:
    while not clock.simulated and moment - clock.now() > PAUSE:
        clock.sleep_until(clock.now() + PAUSE)
        if stopped():
            return
        waiting()
    clock.sleep_until(moment)
