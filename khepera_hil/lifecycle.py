"""The service's states as a chart that refuses what does not fit.

The library would by default ignore an event that has no transition and swallow an error in a callback; for
something that moves motors both are switched off.
"""

from __future__ import annotations

from statemachine import State, StateChart

__all__ = ["Lifecycle"]


class Lifecycle(StateChart["Lifecycle"]):
    """From the opened port to wheels that stand still.

    ``disconnected`` -> ``connecting`` (handshake) -> ``ready`` (wheels commanded to zero) -> ``running`` (the
    loop) -> ``stopping`` (wheels commanded to zero) -> ``stopped``; from everywhere but the end to
    ``faulted``, in which the line is lost or the robot is silent and nothing more can be commanded.
    """

    allow_event_without_transition = False
    catch_errors_as_events = False

    disconnected = State(initial=True)
    connecting = State()
    ready = State()
    running = State()
    stopping = State()
    stopped = State(final=True)
    faulted = State(final=True)

    connect = disconnected.to(connecting)
    connected = connecting.to(ready)
    start = ready.to(running)
    stop = ready.to(stopping) | running.to(stopping)
    rest = stopping.to(stopped)
    fail = (
        disconnected.to(faulted)
        | connecting.to(faulted)
        | ready.to(faulted)
        | running.to(faulted)
        | stopping.to(faulted)
    )
