"""The two wheels: how fast they turn, what the encoders see, and what reaches the floor."""

from __future__ import annotations

import math

import numpy as np

__all__ = ["WHEEL_BASE", "Wheels"]

WHEEL_BASE = 53.0
"""mm between the wheels (KiKS; clients' own turns give 51.6 to 52.7)."""

_LAG = 0.060  # s, first order; proposed, nothing measured was found
_ACCELERATION = 1000.0  # mm/s2
_SLIP = 0.03  # standard deviation of a wheel's grip on the floor, drawn every 10 ms
_PERIOD = 0.010  # s, of the speed controller: encoders are counted over it
_DRAWN_AT_ONCE = 128


class Wheels:
    """Left and right, in mm and seconds; ``bias`` is each wheel's own error of diameter (a share).

    The encoders see the wheels turn, whether or not the body follows: way and speed here are before slip.
    """

    def __init__(self, bias: tuple[float, float], slip: np.random.Generator, step: float) -> None:
        self.asked = (0.0, 0.0)
        """Speeds asked for, mm/s."""
        self.travel = (0.0, 0.0)
        """What each wheel has rolled, mm."""
        self.window = ((0.0, 0.0), (0.0, 0.0))
        """:attr:`travel` at the last two ends of a controller's period of 10 ms."""
        self._speed = (0.0, 0.0)
        self._grip: list[float] = []
        self._bias = bias
        self._slip = slip
        self._drawn: list[list[float]] = []
        self._step = step
        self._share = 1 - math.exp(-step / _LAG)
        self._most = _ACCELERATION * step
        self._steps_to_go = 0
        self._steps_a_period = round(_PERIOD / step)

    def advance(self) -> tuple[float, float]:
        """One step; the speeds at which the two wheels push the floor, mm/s."""
        step, share, most = self._step, self._share, self._most
        left, right = self._speed
        gain = (self.asked[0] - left) * share
        left += gain if -most < gain < most else math.copysign(most, gain)
        gain = (self.asked[1] - right) * share
        right += gain if -most < gain < most else math.copysign(most, gain)
        self._speed = left, right
        self.travel = self.travel[0] + left * step, self.travel[1] + right * step
        if self._steps_to_go == 0:
            self._new_period()
        self._steps_to_go -= 1
        if self._steps_to_go == 0:
            self.window = self.window[1], self.travel
        return left * self._grip[0], right * self._grip[1]

    def _new_period(self) -> None:
        if not self._drawn:
            self._drawn = (1 + self._slip.normal(self._bias, _SLIP, (_DRAWN_AT_ONCE, 2))).tolist()
        self._grip = self._drawn.pop()
        self._steps_to_go = self._steps_a_period
