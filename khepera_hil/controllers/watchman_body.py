"""The watchman's body beyond its wheels: micro-turbine, LED, and how long its camera holds a frame."""

from __future__ import annotations

__all__ = ["AT_REST", "Body"]

_PORT = 32
"""Where the general I/O turret's digital port is on the extension bus (command W); its bit 0 drives the turbine."""

_LED = 1  # the one in front
_FRAMES = ("T", 2, "U,2")  # a frame each 100 ms
_AGAIN = 20
"""Ticks after which everything is said again: a robot that was reset, or did not hear, has forgotten it."""

_LIT = 10  # ticks that the LED is on after an alarm

Command = tuple[int | str, ...]

AT_REST: tuple[Command, ...] = (("W", 0, _PORT), ("L", _LED, 0))


class Body:
    """Knows what was commanded, and commands what has changed; and all of it every two seconds."""

    def __init__(self) -> None:
        self._since = _AGAIN
        self._turbine = self._led = False
        self._lit = 0

    def step(self, *, blow: bool, alarm: bool, sees: bool) -> list[Command]:
        """What is to be sent in this tick. ``alarm``: it sounds now; ``sees``: the camera has answered."""
        self._lit = _LIT if alarm else max(0, self._lit - 1)
        led = self._lit > 0
        self._since += 1
        commands: list[Command] = []
        # One thing more than the turbine in a tick: the wire is full.
        if blow != self._turbine or self._since >= _AGAIN:
            commands.append(("W", int(blow), _PORT))
        if self._since >= _AGAIN:
            self._since = 0
            if sees:
                commands.append(_FRAMES)
        elif led != self._led or self._since == _AGAIN // 2:
            commands.append(("L", _LED, int(led)))
            self._led = led
        self._turbine = blow
        return commands
