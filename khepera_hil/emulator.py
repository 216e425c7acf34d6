"""The robot's end of the protocol: bytes in, bytes out at the wire's pace, a world behind them.

No I/O, no thread, no clock of its own: every method is told what time it is (seconds since power-up), and
time never goes back. Who carries the bytes is none of its business: ``ports`` does it inside the process,
``serve`` over a pseudo-terminal.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from khepera_hil.errors import UsageError
from khepera_hil.protocol import (
    BAUD_RATES,
    COMMAND_NOT_FOUND,
    COMMANDS,
    ENCODER_PULSES_PER_MM,
    SPEED_UNIT_MM_S,
    RequestLines,
    RequestRefused,
    encode_answer,
    parse_request,
)
from khepera_hil.uart import Fifo, Line
from khepera_hil.world import World

__all__ = ["BOOT_TEXT", "VERSIONS", "Emulator"]

BOOT_TEXT = (
    b"ROM of minirobot KHEPERA, Edoardo Franzi K-Team S.A. October 22, 1998 Rev. 5.01\r\n"
    b"Serial Communication Protocol\r\n"
)
"""What a Khepera prints when it is switched on in a serial mode (K-Team's Khepera FAQ)."""

VERSIONS = ("5.01", "5.00")
"""Of the BIOS and of the protocol, as a real robot answered B."""

_WAITING_REQUESTS = 4096
"""Requests that the robot keeps while it is still answering earlier ones; what comes on top of them is lost.
No manual names a limit."""

_SPEED_MODE = 0  # command K's second value: 0 speed, 1 position, 2 PWM

Value = int | str


class Emulator:
    """A Khepera on its cable.

    ``baud`` is the robot's own rate (its mode jumpers), ``host_baud`` the rate of the other end, by default
    the same; where they differ, bytes arrive garbled both ways. ``fifo`` is the number of characters that the
    host's UART collects before its driver sees them (1: each at once; see :class:`~khepera_hil.uart.Fifo`).

    A request counts when the last bit of its CR or LF has arrived, and it is taken up when the answer before
    it has left; so requests may be sent ahead and are answered in order. The command itself takes no time:
    nothing published says how long the robot needs.

    Raises :class:`~khepera_hil.errors.UsageError` for a rate that no Khepera has.
    """

    def __init__(self, world: World, baud: int, *, host_baud: int | None = None, fifo: int = 1) -> None:
        if baud not in BAUD_RATES:
            rates = ", ".join(map(str, BAUD_RATES))
            raise UsageError(f"no Khepera talks at {baud} baud; choose one of {rates}")
        self.world = world
        self.baud = baud
        self._to_robot = Line(host_baud or baud, baud)
        self._to_host = Line(baud, host_baud or baud)
        self._fifo = Fifo(fifo)
        self._lines = RequestLines()
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._leds = [0, 0]
        self._counters_at_zero = [0, 0]
        self._speed_command = (0, 0)
        self._answers: dict[str, Callable[..., tuple[Value, ...]]] = {
            "B": lambda: VERSIONS,
            "D": self._set_speed,
            "E": self._measured_speeds,
            "G": self._set_counters,
            "H": self._counters,
            "K": self._motion_status,
            "L": self._change_led,
            "N": lambda: tuple(self.world.proximity()),
            "O": lambda: tuple(self.world.light()),
        }
        self._now = -1.0
        """Until when everything has happened; earlier than any time when there is something new."""
        self._to_host.send(BOOT_TEXT, 0.0)

    @property
    def host_baud(self) -> int:
        """The rate that the other end is set to."""
        return self._to_robot.sender

    @host_baud.setter
    def host_baud(self, baud: int) -> None:
        if baud != self.host_baud:
            self._to_robot.sender = self._to_host.receiver = baud
            self._now = -1.0

    @property
    def leds(self) -> tuple[int, int]:
        """LED 0 (lateral) and 1 (front): 1 is on."""
        return self._leds[0], self._leds[1]

    def receive(self, data: bytes, now: float) -> None:
        """The host puts ``data`` on the wire, behind what it has not sent yet."""
        self._to_robot.send(data, now)
        self._now = -1.0

    def unsent(self, now: float) -> int:
        """How many characters the host has handed over whose last bit has not left."""
        left = (self._to_robot.free - now) * self.host_baud / 11
        return max(0, math.ceil(left - 1e-6))

    def drop_unsent(self, now: float) -> None:
        """The host forgets what it has not sent."""
        self._to_robot.clear(now)

    def advance(self, now: float) -> None:
        """Let everything happen that happens until ``now``, in its order."""
        if now == self._now:
            return
        self._now = now
        for moment, byte in self._to_robot.arrived(now):
            for line in self._lines.feed(bytes((byte,))):
                if line and len(self._waiting) < _WAITING_REQUESTS:
                    self._waiting.append((moment, line))
        while self._waiting and (moment := self._next_answer()) <= now:
            self.world.advance(moment)
            self._to_host.send(self._answer(self._waiting.popleft()[1]), moment)
        self.world.advance(now)
        for moment, byte in self._to_host.certain(now):
            self._fifo.put(moment, byte, self.host_baud)

    def transmitted(self, now: float) -> bytes:
        """Take out what has come to the host's driver by ``now``."""
        self.advance(now)
        return self._fifo.shown(now)

    def next_event(self) -> float | None:
        """A moment before which the host sees no further byte, unless it sends something (None: never).

        It may be too early, never too late: who waits for bytes sleeps until then and asks again.
        """
        moments = [
            self._next_answer() if self._waiting else None,
            self._to_robot.next_arrival(b"\r\n"),
            self._to_host.next_arrival(),
            self._fifo.next_show(),
        ]
        return min((moment for moment in moments if moment is not None), default=None)

    def _next_answer(self) -> float:
        return max(self._waiting[0][0], self._to_host.free)

    def _answer(self, line: bytes) -> bytes:
        try:
            request = parse_request(line)
        except RequestRefused as refused:
            # A letter whose command is not built in is refused below, whatever comes after it.
            if line.strip()[:1].decode("ascii", "replace") in COMMANDS.keys() - self._answers.keys():
                return COMMAND_NOT_FOUND
            return refused.reply
        if request is None:
            return b""
        letter, values = request
        if letter not in self._answers:
            return COMMAND_NOT_FOUND
        return encode_answer(letter, *self._answers[letter](*values))

    def _set_speed(self, left: int, right: int) -> tuple[Value, ...]:
        self._speed_command = (left, right)
        self.world.set_speed(left * SPEED_UNIT_MM_S, right * SPEED_UNIT_MM_S)
        return ()

    def _measured_speeds(self) -> tuple[Value, ...]:
        """Pulses in the last whole 10 ms, as the robot counts them."""
        before, after = self.world.wheel_window()
        speeds = [_pulses(new) - _pulses(old) for old, new in zip(before, after, strict=True)]
        return tuple(max(-255, min(255, speed)) for speed in speeds)

    def _set_counters(self, *values: int) -> tuple[Value, ...]:
        self._counters_at_zero = [
            _pulses(way) - value for way, value in zip(self.world.wheel_travel(), values, strict=True)
        ]
        return ()

    def _counters(self) -> tuple[Value, ...]:
        """32-bit counters that wrap around."""
        return tuple(
            (_pulses(way) - zero + 2**31) % 2**32 - 2**31
            for way, zero in zip(self.world.wheel_travel(), self._counters_at_zero, strict=True)
        )

    def _motion_status(self) -> tuple[Value, ...]:
        """In speed mode the error is the speed asked for less the measured one, and 0 means on target."""
        status: list[Value] = []
        for asked, measured in zip(self._speed_command, self._measured_speeds(), strict=True):
            error = asked - int(measured)
            status += [int(error == 0), _SPEED_MODE, error]
        return tuple(status)

    def _change_led(self, led: int, action: int) -> tuple[Value, ...]:
        self._leds[led] = action if action < 2 else 1 - self._leds[led]
        return ()


def _pulses(way: float) -> int:
    """Whole pulses of a wheel's way in mm."""
    return math.floor(way * ENCODER_PULSES_PER_MM)
