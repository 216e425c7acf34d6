"""Steering by any joystick or gamepad that Linux shows, through the package evdev (the extra ``joystick``).

evdev is small, kept up, and asks the kernel where the stick is at any moment, so no event is waited for; pygame
would bring a window system along.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from khepera_hil.errors import LinkLost, UsageError
from khepera_hil.teaching.hand import MOST

__all__ = ["Joystick", "open_joystick"]

_DEAD = 0.08
"""Share of the way from the middle within which a released stick may rest."""


class Axis(Protocol):
    """What evdev says of an axis."""

    value: int
    min: int
    max: int


class Device(Protocol):
    """What is needed of evdev's InputDevice."""

    name: str

    def absinfo(self, axis_num: int, /) -> Any:
        """The axis: see :class:`Axis`."""

    def active_keys(self) -> Sequence[Any]:
        """The buttons that are pressed."""

    def close(self) -> None:
        """Give it back."""


class Joystick:
    """The stick's horizontal axis, asked for when it is wanted; the button START ends the lesson."""

    def __init__(self, device: Device, axis: int, start: int) -> None:
        self.name = device.name
        self._device, self._axis, self._start = device, axis, start
        self._done = False

    @property
    def done(self) -> bool:
        """Whether the button START was pressed."""
        return self._done

    def vrot(self) -> int:
        """The stick's deflection now. Raises LinkLost when the joystick was unplugged."""
        try:
            axis: Axis = self._device.absinfo(self._axis)
            self._done = self._done or self._start in self._device.active_keys()
        except OSError as error:
            raise LinkLost(f"the joystick {self.name} is gone: {error.strerror or error}") from None
        half = (axis.max - axis.min) / 2
        way = (axis.value - axis.min) / half - 1 if half > 0 else 0.0
        if abs(way) <= _DEAD:
            return 0
        # From the edge of the dead middle on, so that the smallest deflections can be had too.
        share = (abs(way) - _DEAD) / (1 - _DEAD)
        return round(min(1.0, share) * MOST) * (1 if way > 0 else -1)

    def close(self) -> None:
        """Give the device back."""
        self._device.close()


def open_joystick() -> Joystick:
    """The first joystick or gamepad that this computer shows. Raises UsageError with what to do."""
    try:
        import evdev
    except ImportError:
        raise UsageError(
            "--teacher joystick needs the package evdev: pip install 'khepera-hil[joystick]'"
        ) from None
    codes = evdev.ecodes
    paths = evdev.list_devices()
    for path in paths:
        device = evdev.InputDevice(path)
        able: dict[int, Any] = device.capabilities()
        axes = [code for code, _ in able.get(codes.EV_ABS, [])]
        buttons = able.get(codes.EV_KEY, [])
        if codes.ABS_X in axes and any(codes.BTN_JOYSTICK <= button <= codes.BTN_THUMBR for button in buttons):
            return Joystick(device, codes.ABS_X, codes.BTN_START)
        device.close()
    hidden = len(list(Path("/dev/input").glob("event*"))) - len(paths)
    more = f" ({hidden} input devices may not be opened by you: join the group input)" if hidden > 0 else ""
    raise UsageError(f"this computer shows no joystick{more}: plug one in, or teach by --teacher keyboard")
