"""The two wheels: motors under the robot's own control, what the encoders see, and what reaches the floor."""

from __future__ import annotations

import math

import numpy as np

from khepera_hil.motion import Motion
from khepera_hil.units import ENCODER_PULSES_PER_MM, SPEED_UNIT_MM_S

__all__ = ["WHEEL_BASE", "Wheels"]

WHEEL_BASE = 53.0
"""mm between the wheels (KiKS; clients' own turns give 51.6 to 52.7)."""

_SPEED_A_PWM = 0.5 * SPEED_UNIT_MM_S
"""mm/s at which a motor runs for each PWM: at the full 255 about the manual's 1 m/s (proposed)."""

_LAG = 0.050
"""s, a motor's own; under the speed controller with its reset values the wheel has one of 60 ms (proposed, nothing
measured was found)."""

_ACCELERATION = 1000.0  # mm/s2, what the motors' current allows (proposed)
_SLIP = 0.03  # standard deviation of a wheel's grip on the floor, drawn every 10 ms
_PERIOD = 0.010  # s, of the controllers: encoders are counted over it
_DRAWN_AT_ONCE = 128


class Wheels:
    """Left and right, in mm and seconds; ``bias`` is each wheel's own error of diameter (a share).

    The encoders see the wheels turn, whether or not the body follows: way and speed here are before slip.
    :attr:`motion` is the robot's own control, run every 10 ms: what the host asks for goes to it.
    """

    def __init__(self, bias: tuple[float, float], slip: np.random.Generator, step: float) -> None:
        self.motion = Motion()
        self.travel = (0.0, 0.0)
        """What each wheel has rolled, mm."""
        self.window = ((0.0, 0.0), (0.0, 0.0))
        """:attr:`travel` at the last two ends of a controller's period of 10 ms."""
        self._speed = (0.0, 0.0)
        self._driven = (0.0, 0.0)  # the speeds that the motors' PWM would hold
        self._grip: list[float] = []
        self._bias = bias
        self._slip = slip
        self._drawn: list[list[float]] = []
        self._step = step
        self._share = 1 - math.exp(-step / _LAG)
        self._most = _ACCELERATION * step
        self._steps_to_go = 0
        self._steps_a_period = round(_PERIOD / step)

    @property
    def asked(self) -> tuple[float, float]:
        """Speeds asked for, mm/s; setting them puts the controllers into speed mode."""
        left, right = self.motion.orders
        return left * SPEED_UNIT_MM_S, right * SPEED_UNIT_MM_S

    @asked.setter
    def asked(self, speeds: tuple[float, float]) -> None:
        self.motion.set_speed(speeds[0] / SPEED_UNIT_MM_S, speeds[1] / SPEED_UNIT_MM_S)

    def advance(self) -> tuple[float, float]:
        """One step; the speeds at which the two wheels push the floor, mm/s."""
        if self._steps_to_go == 0:
            self._new_period()
        step, share, most = self._step, self._share, self._most
        left, right = self._speed
        gain = (self._driven[0] - left) * share
        left += gain if -most < gain < most else math.copysign(most, gain)
        gain = (self._driven[1] - right) * share
        right += gain if -most < gain < most else math.copysign(most, gain)
        self._speed = left, right
        self.travel = self.travel[0] + left * step, self.travel[1] + right * step
        self._steps_to_go -= 1
        if self._steps_to_go == 0:
            self.window = self.window[1], self.travel
        return left * self._grip[0], right * self._grip[1]

    def _new_period(self) -> None:
        left, right = self.travel
        pwm = self.motion.control(left * ENCODER_PULSES_PER_MM, right * ENCODER_PULSES_PER_MM)
        self._driven = pwm[0] * _SPEED_A_PWM, pwm[1] * _SPEED_A_PWM
        if not self._drawn:
            self._drawn = (1 + self._slip.normal(self._bias, _SLIP, (_DRAWN_AT_ONCE, 2))).tolist()
        self._grip = self._drawn.pop()
        self._steps_to_go = self._steps_a_period
