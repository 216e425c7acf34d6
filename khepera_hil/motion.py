"""The motion controllers in the robot's ROM: from what the host asked for and the encoders to the motors' PWM.

They run every 10 ms whatever the host does, on nothing but the encoders (Khepera User Manual 5.02, section 3.1.5):
a leaf, without bytes and without physics, that the world's wheels call at each period's end. Lengths are pulses
and times periods of 10 ms, so a speed is a pulse/10 ms. Left is always first.

The manuals give the controllers' gains but not what a gain of 1 means, nor the motors' data. The two scales below
are chosen so that the reset values do what :mod:`khepera_hil.world.wheels` aims at, and are the same for all gains.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum

from khepera_hil.units import MAX_SPEED

__all__ = ["FULL_PWM", "POSITION_GAINS", "PROFILE", "SPEED_GAINS", "Mode", "Motion"]

SPEED_GAINS = (3800, 800, 100)
"""Kp, Ki, Kd of the speed controller after a reset (manual, command A)."""

POSITION_GAINS = (3000, 20, 4000)
"""Kp, Ki, Kd of the position controller after a reset (manual, command F)."""

PROFILE = (20, 64)
"""Maximal speed and acceleration of the position profile after a reset (manual, command J): pulse/10 ms, and
pulse/256 in 10 ms for each 10 ms."""

FULL_PWM = 255

_SPEED_SCALE = 2750.0
"""A speed gain of so much is 1 PWM for an error of 1. With the reset values the wheel then follows an order as a
first-order lag of 60 ms, to 1 % (its motor alone has one of 50 ms)."""

_POSITION_SCALE = 4000.0
"""A position gain of so much orders a speed of 1 for an error of 1. With the reset values a motion ends within 2
pulses beyond its target and comes to rest on it."""

_HOLDING = 2.0
"""PWM that holds a speed of 1: what the controller takes for the motor's data."""

_CURRENT = 20.0
"""PWM above or below what holds the measured speed that the controller allows itself: the motor's current would
not follow, and the sum would only wind up."""

_STEEPEST = 1.0
"""Acceleration that the position profile never passes: 10 ms for a speed of 1; the motors give little more."""

_AHEAD = 200.0
"""Pulses that a profile may begin before the wheel when it takes over from a speed."""


class Mode(IntEnum):
    """Which controller drives the motors: the second value of command K."""

    SPEED = 0
    POSITION = 1
    PWM = 2


class _Axis:
    """One wheel: profile, position PID, speed PID, each feeding the next (manual, figure 6)."""

    __slots__ = (
        "_aim",
        "_error",
        "_integral",
        "_offset",
        "_offsets",
        "_place",
        "_ramp",
        "acceleration",
        "fastest",
        "order",
        "position_gains",
        "pwm",
        "speed",
        "speed_gains",
        "way",
    )

    def __init__(self) -> None:
        self.way = 0.0
        """Pulses at the last period's end."""
        self.speed = 0.0
        """Measured over the last period."""
        self.reset()

    def reset(self) -> None:
        """As after power-up; the wheel itself may still turn."""
        self.pwm = 0.0
        self.order = 0.0
        """What the speed controller is to hold."""
        self.set_speed_gains(*SPEED_GAINS)
        self.set_position_gains(*POSITION_GAINS)
        self.set_profile(*PROFILE)
        self._aim = self.way
        self._rest()

    def _rest(self) -> None:
        self._integral = self._error = 0.0
        self._start_profile()

    def _start_profile(self) -> None:
        """From where the wheel is and as fast as it turns, so that taking over is smooth."""
        gain = self.position_gains[0]
        ahead = self.speed / gain if gain else 0.0
        self._place = self.way + min(max(ahead, -_AHEAD), _AHEAD)
        self._ramp = self.speed
        self._offset = self._place - self.way
        self._offsets = 0.0

    def set_speed_gains(self, proportional: float, integral: float, derivative: float) -> None:
        self.speed_gains = (
            proportional / _SPEED_SCALE,
            integral / _SPEED_SCALE,
            derivative / _SPEED_SCALE,
        )

    def set_position_gains(self, proportional: float, integral: float, derivative: float) -> None:
        self.position_gains = (
            proportional / _POSITION_SCALE,
            integral / _POSITION_SCALE,
            derivative / _POSITION_SCALE,
        )

    def set_profile(self, fastest: float, acceleration: float) -> None:
        self.fastest = fastest
        self.acceleration = min(acceleration / 256, _STEEPEST)

    def aim(self, way: float, *, anew: bool) -> None:
        """Go to ``way``; ``anew``: from where the wheel is, not from where the profile was."""
        self._aim = way
        if anew:
            self._start_profile()

    @property
    def arrived(self) -> bool:
        """Whether the profile has come to its end."""
        return self._place == self._aim and self._ramp == 0

    @property
    def place(self) -> float:
        """Where the profile wants the wheel now, pulses."""
        return self._place

    def measure(self, way: float) -> None:
        """The encoder at a period's end."""
        self.speed = way - self.way
        self.way = way

    def hold_pwm(self, pwm: float) -> None:
        """No controller; the speed controller may take over from here."""
        self.pwm = self._integral = pwm
        self._error = 0.0

    def hold_position(self) -> None:
        """One period of the profile and its controller, and of the speed controller below it."""
        self._advance_profile()
        proportional, integral, derivative = self.position_gains
        offset = self._place - self.way
        if self._ramp == 0:  # on its way a wheel lags; summed up, that would carry it beyond
            self._offsets += offset
        order = proportional * offset + integral * self._offsets + derivative * (offset - self._offset)
        self._offset = offset
        self.order = MAX_SPEED if order > MAX_SPEED else -MAX_SPEED if order < -MAX_SPEED else order
        self.hold_speed()

    def hold_speed(self) -> None:
        """One period of the speed controller."""
        proportional, integral, derivative = self.speed_gains
        error = self.order - self.speed
        rest = proportional * error + derivative * (error - self._error)
        self._error = error
        total = self._integral + integral * error if integral else 0.0
        pwm = rest + total
        # What the motor will not follow must not be summed up.
        middle = _HOLDING * self.speed
        low, high = max(-FULL_PWM, middle - _CURRENT), min(FULL_PWM, middle + _CURRENT)
        if not low <= pwm <= high:
            pwm = low if pwm < low else high
            total = pwm - rest
        self._integral = total
        self.pwm = pwm

    def _advance_profile(self) -> None:
        """Accelerate, keep the speed, brake while v^2 / 2a is left of the way (manual, section 3.1.5)."""
        most = self.acceleration
        left = self._aim - self._place
        if not most or not self.fastest:
            self._ramp = 0.0
            return
        # The greatest speed from which, one period at a time, braking ends at the target.
        wanted = min(self.fastest, most * (math.sqrt(0.25 + 2 * abs(left) / most) - 0.5))
        change = math.copysign(wanted, left) - self._ramp
        self._ramp += most if change > most else -most if change < -most else change
        if abs(left) <= abs(self._ramp) <= most:
            self._place, self._ramp = self._aim, 0.0
        else:
            self._place += self._ramp


class Motion:
    """Both wheels' controllers, their counters, and which of the three modes rules: the last order's."""

    def __init__(self) -> None:
        self._axes = _Axis(), _Axis()
        self._zeros = [0, 0]
        self._targets = [0, 0]
        self.mode = Mode.SPEED

    def reset(self) -> None:
        """As after power-up: speed mode, nothing asked for, counters and gains at their reset values.

        The motors get nothing; wheels that turn run out.
        """
        self.mode = Mode.SPEED
        for side, axis in enumerate(self._axes):
            axis.reset()
            self._zeros[side] = math.floor(axis.way)
            self._targets[side] = 0

    def set_speed(self, left: float, right: float) -> None:
        """Hold these speeds, pulse/10 ms, at once: the speed controller knows no acceleration (command D)."""
        self.mode = Mode.SPEED
        self._axes[0].order, self._axes[1].order = left, right

    def set_pwm(self, left: float, right: float) -> None:
        """Give the motors so much PWM, -255..255, and control nothing (command P)."""
        self.mode = Mode.PWM
        self._axes[0].hold_pwm(left)
        self._axes[1].hold_pwm(right)

    def set_position(self, left: int, right: int) -> None:
        """Bring the counters to these values along the profile, starting at once (command C)."""
        anew = self.mode is not Mode.POSITION
        self.mode = Mode.POSITION
        self._targets[:] = left, right
        self._aim(anew=anew)

    def _aim(self, *, anew: bool) -> None:
        ways = [axis.way for axis in self._axes]
        for axis, target, counter in zip(self._axes, self._targets, self.counters(ways), strict=True):
            # At rest in the middle of the pulse, which then is counted.
            axis.aim(math.floor(axis.way) + target - counter + 0.5, anew=anew)

    def set_speed_gains(self, *gains: int) -> None:
        """Kp, Ki, Kd of the speed controllers (command A)."""
        for axis in self._axes:
            axis.set_speed_gains(*gains)

    def set_position_gains(self, *gains: int) -> None:
        """Kp, Ki, Kd of the position controllers (command F)."""
        for axis in self._axes:
            axis.set_position_gains(*gains)

    def set_profile(
        self, left_speed: int, left_acceleration: int, right_speed: int, right_acceleration: int
    ) -> None:
        """Maximal speeds, pulse/10 ms, and accelerations, pulse/256/(10 ms)^2, of positioning (command J)."""
        self._axes[0].set_profile(left_speed, left_acceleration)
        self._axes[1].set_profile(right_speed, right_acceleration)

    def set_counters(self, values: Sequence[int], ways: Sequence[float]) -> None:
        """Let the counters show ``values`` where the encoders have gone ``ways`` pulses (command G).

        A position that is being sought is sought by the new count.
        """
        self._zeros[:] = [math.floor(way) - value for way, value in zip(ways, values, strict=True)]
        if self.mode is Mode.POSITION:
            self._aim(anew=True)

    def counters(self, ways: Sequence[float]) -> list[int]:
        """The 32-bit counters, which wrap around, where the encoders have gone ``ways`` pulses (command H)."""
        return [
            (math.floor(way) - zero + 2**31) % 2**32 - 2**31 for way, zero in zip(ways, self._zeros, strict=True)
        ]

    def status(self, speeds: Sequence[int], ways: Sequence[float]) -> list[int]:
        """For each wheel: on target (0, 1), mode, error of the controller that rules (command K).

        ``speeds`` are measured, whole pulses in 10 ms. On target is, in speed mode, a wheel that turns as it was
        told; in position mode one that stands at its profile's end; with PWM alone there is no target, and a wheel
        that stands still does not move.
        """
        told: list[int] = []
        for axis, speed, way in zip(self._axes, speeds, ways, strict=True):
            if self.mode is Mode.SPEED:
                error = round(axis.order) - speed
                reached = error == 0
            elif self.mode is Mode.POSITION:
                error = math.floor(axis.place) - math.floor(way)
                reached = axis.arrived and error == 0 and speed == 0
            else:
                error, reached = 0, speed == 0
            told += [int(reached), int(self.mode), error]
        return told

    @property
    def orders(self) -> tuple[float, float]:
        """What the speed controllers are to hold now, pulse/10 ms."""
        return self._axes[0].order, self._axes[1].order

    def control(self, left: float, right: float) -> tuple[float, float]:
        """One period's end: where the encoders are, in pulses; what the motors get until the next, PWM."""
        one, other = self._axes
        one.measure(left)
        other.measure(right)
        if self.mode is Mode.SPEED:
            one.hold_speed()
            other.hold_speed()
        elif self.mode is Mode.POSITION:
            one.hold_position()
            other.hold_position()
        return one.pwm, other.pwm
