"""The service's states as a chart that refuses what does not fit.

The library would by default ignore an event that has no transition and swallow an error in a callback; for
something that moves motors both are switched off. ``docs/service.md`` shows the chart as :func:`diagram` draws it.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from statemachine import State, StateChart

__all__ = ["AILING", "WINDOW", "Health", "Lifecycle", "diagram"]

WINDOW = 10
"""Ticks that are looked back on."""

AILING = 3
"""Bad ones among them that make a run degraded. It takes WINDOW good ones in a row to be well again."""


class Health:
    """What the chart's guards ask: how the last ticks went, and what may be done to the wheels."""

    state: Any = None  # the chart's, kept here as the library wants it

    def __init__(self) -> None:
        self._ticks: deque[bool] = deque(maxlen=WINDOW)
        self.may_move = True
        """False after a reset of the robot, until somebody says that it may go on."""
        self.rested = False
        """Whether the robot confirmed the last order to stand still."""

    def add(self, good: bool) -> None:
        """Count a tick; a good one had readings, a decision and an acknowledged speed."""
        self._ticks.append(good)

    @property
    def ailing(self) -> bool:
        """Too many of the last ticks were bad."""
        return self._ticks.count(False) >= AILING

    @property
    def sound(self) -> bool:
        """The last ticks were good, all of them."""
        return self._ticks.count(True) == WINDOW


class Lifecycle(StateChart[Health]):
    """From the opened port to wheels that stand still.

    ``disconnected`` (no port) -> ``connecting`` (a port, and no confirmed handshake) -> ``ready`` (wheels confirmed
    to stand still) -> ``running`` or ``degraded`` (the loop) -> ``stopping`` (wheels commanded to zero) ->
    ``stopped``, or ``faulted`` when that could not be confirmed. From a line that is lost and from a robot that was
    reset the way leads back and forth again.
    """

    allow_event_without_transition = False
    catch_errors_as_events = False

    disconnected = State(initial=True)
    connecting = State()
    ready = State()
    running = State()
    degraded = State()
    stopping = State()
    stopped = State(final=True)
    faulted = State(final=True)

    connect = disconnected.to(connecting)
    connected = connecting.to(ready, cond="rested")
    start = ready.to(degraded, cond=["may_move", "ailing"]) | ready.to(running, cond="may_move", unless="ailing")
    degrade = running.to(degraded, cond="ailing")
    recover = degraded.to(running, cond="sound")
    lose = (
        connecting.to(disconnected) | ready.to(disconnected) | running.to(disconnected) | degraded.to(disconnected)
    )
    reset = ready.to(connecting) | running.to(connecting) | degraded.to(connecting)
    stop = (
        disconnected.to(stopping)
        | connecting.to(stopping)
        | ready.to(stopping)
        | running.to(stopping)
        | degraded.to(stopping)
    )
    rest = stopping.to(stopped, cond="rested")
    fail = (
        disconnected.to(faulted)
        | connecting.to(faulted)
        | ready.to(faulted)
        | running.to(faulted)
        | degraded.to(faulted)
        | stopping.to(faulted)
    )


def diagram() -> str:
    """The chart as mermaid draws it."""
    return f"{Lifecycle:mermaid}"
