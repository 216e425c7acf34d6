"""The robot as a program sees it: one method a capability, in the manual's units.

Every method may raise what :meth:`Link.ask <khepera_hil.link.Link.ask>` raises. Left is always first.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from khepera_hil.errors import BadAnswer, NoAnswer, ProtocolError, RobotError, RobotReset
from khepera_hil.link import Link
from khepera_hil.plausible import Motion
from khepera_hil.protocol import MAX_SPEED

__all__ = ["Khepera"]

HANDSHAKE = 1.0
"""Seconds for which a silent robot is spoken to."""

BOOT_TEXT = 3.0
"""Seconds for a robot that says something else first: a Khepera II's boot text takes 1.5 at 9600 baud."""

STOPPING = 0.8
"""Seconds after which a stop that nobody confirms is not repeated."""

_TRIES = 50  # for a clock that does not move while the line talks


class Khepera:
    """A Khepera, or an emulator of one, at the other end of ``link``."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.motion = Motion()
        """What the wheels were told."""

    def handshake(self, stopped: Callable[[], bool] = lambda: False) -> tuple[str, str]:
        """Find the robot on a line that was just opened, whatever is still in it; as :meth:`version`.

        It is given up when it was ``stopped``. Raises NoAnswer on a silent port and BadAnswer when what comes is
        not the protocol, each with what to do.
        """
        started = self.link.clock.now()
        failure: RobotError | None = None
        for _ in range(_TRIES):
            try:
                self.link.begin()
                return self.version()
            except RobotError as error:
                if failure is None or not isinstance(error, NoAnswer):
                    failure = error
            if stopped() or self.link.clock.now() - started >= (
                HANDSHAKE if isinstance(failure, NoAnswer) else BOOT_TEXT
            ):
                break
        where = f"{self.link.name} at {self.link.baud} baud"
        if isinstance(failure, NoAnswer):
            raise NoAnswer(
                f"no Khepera answers on {where}: is it switched on, {_mode(self.link.baud)}, "
                "and is the rate right (--baud)?"
            ) from failure
        raise BadAnswer(
            f"what answers on {where} does not speak the Khepera's protocol: "
            f"try another rate (--baud), and see that the robot is {_mode(self.link.baud)} ({failure})"
        ) from failure

    def proximity(self) -> tuple[int, ...]:
        """The 8 proximity sensors, 0..1023, higher is nearer; clockwise from the left. Command N."""
        return _integers(self.link.ask("N"))

    def light(self) -> tuple[int, ...]:
        """The 8 ambient light sensors, 0..1023, lower is brighter; clockwise from the left. Command O."""
        return _integers(self.link.ask("O"))

    def set_speed(self, left: float, right: float) -> tuple[int, int]:
        """Set the wheels' speeds in pulse/10 ms; returns what was really sent. Command D.

        Speeds are rounded and clipped to -127..127. Raises ProtocolError, and sends nothing, for one that is
        not finite.
        """
        speeds = _speed(left), _speed(right)
        self.motion.told(*speeds, self.link.clock.now())
        self.link.ask("D", *speeds)
        return speeds

    def halt(self) -> bool:
        """Order the wheels to stand still, at once: whether the robot confirmed it. Command D.

        One attempt, for the middle of a run. On a line that is out of step the order goes out blind, since
        getting into step first takes its time and may fail. Raises LinkLost only.
        """
        if self.link.synchronised:
            try:
                self.set_speed(0, 0)
            except RobotError:
                pass
            else:
                return True
        self._stop_blindly()
        return False

    def stop(self) -> bool:
        """Set both speeds to zero, and try hard; whether the robot said that it did. Command D.

        Where no answer comes, a line end and the command are sent blindly, and all is tried again for about
        0.8 s. Raises LinkLost only.
        """
        give_up = self.link.clock.now() + STOPPING
        reset = False
        for _ in range(_TRIES):
            if not self.link.synchronised:
                # Resynchronising takes its time; the wheels should not turn that long.
                self._stop_blindly()
            try:
                if reset:
                    self.link.begin()
                self.set_speed(0, 0)
            except RobotError as error:
                reset = isinstance(error, RobotReset)  # it stands still, but shall confirm it
                if self.link.clock.now() >= give_up:
                    break
            else:
                return True
        self._stop_blindly()
        return False

    def _stop_blindly(self) -> None:
        self.motion.told(0, 0, self.link.clock.now())
        self.link.send_unanswered("D", 0, 0)

    def speeds(self) -> tuple[int, int]:
        """The wheels' measured speeds, pulse/10 ms. Command E."""
        return _pair(self.link.ask("E"))

    def positions(self) -> tuple[int, int]:
        """The wheels' position counters, pulses. Command H."""
        return _pair(self.link.ask("H"))

    def set_positions(self, left: int, right: int) -> None:
        """Set the wheels' position counters, pulses, 32 bits with sign. Command G."""
        self.link.ask("G", left, right)

    def status(self) -> tuple[int, ...]:
        """Left wheel, then right: on target (0, 1), mode (0 speed, 1 position, 2 PWM), error. Command K."""
        return _integers(self.link.ask("K"))

    def led(self, led: int, action: int) -> None:
        """Switch LED 0 (lateral) or 1 (front): action 0 off, 1 on, 2 the other way. Command L."""
        self.link.ask("L", led, action)

    def command(self, letter: str, *values: int | str) -> tuple[int | str, ...]:
        """Any other command of the manual, by its letter; the values of the answer."""
        return self.link.ask(letter, *values)

    def version(self) -> tuple[str, str]:
        """The versions of BIOS and protocol, such as ("5.01", "5.00"). Command B."""
        bios, protocol = self.link.ask("B")
        return str(bios), str(protocol)


def _speed(wanted: float) -> int:
    if not math.isfinite(wanted):
        raise ProtocolError(f"a wheel's speed must be a finite number, not {wanted!r}")
    return round(min(max(float(wanted), -MAX_SPEED), MAX_SPEED))


def _mode(baud: int) -> str:
    """The setting of the jumpers, or of the Khepera II's wheel, for a rate (manual, section 3.1.3)."""
    modes = {9600: 1, 19200: 2, 38400: 3, 57600: 8, 115200: 9}
    return f"in mode {modes[baud]}" if baud in modes else "in a mode of the serial protocol"


def _integers(values: tuple[int | str, ...]) -> tuple[int, ...]:
    return tuple(int(value) for value in values)


def _pair(values: tuple[int | str, ...]) -> tuple[int, int]:
    left, right = values
    return int(left), int(right)
