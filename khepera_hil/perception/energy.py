"""Energy: how much the battery has left, in the four words of section 9, from its voltage."""

from __future__ import annotations

from bisect import bisect_right

__all__ = ["LEVELS", "VOLTAGE", "Energy", "charge"]

VOLTAGE = 3
"""The A/D input (command I) that has half of the battery's voltage. The paper does not say how its robot told its
energy; a Khepera has no command for it."""

LEVELS = ("very-low", "low", "high", "very-high")

_BORDERS = (0.2, 0.5, 0.85)
_HYSTERESIS = 0.02
_VOLTS_A_STEP = 4.09 / 1024
_CONNECTED = 3.0  # V; a battery that has less could not have answered
_CHARGES = (0.0, 0.1, 0.5, 0.9, 1.0)
_VOLTS = (4.0, 4.7, 4.9, 5.05, 5.4)
"""Four NiCd cells over their charge, a plateau that is steep at both ends (proposed: nothing measured was
found)."""


def charge(reading: int) -> float:
    """The charge, 0 to 1, by a reading of the A/D input, 0..1023."""
    volts = 2 * reading * _VOLTS_A_STEP
    place = bisect_right(_VOLTS, volts)
    if place == 0:
        return 0.0
    if place == len(_VOLTS):
        return 1.0
    share = (volts - _VOLTS[place - 1]) / (_VOLTS[place] - _VOLTS[place - 1])
    return _CHARGES[place - 1] + share * (_CHARGES[place] - _CHARGES[place - 1])


class Energy:
    """The level, which changes only when the charge is 2 % beyond a border, so that it does not flicker on one."""

    def __init__(self) -> None:
        self.charge: float | None = None
        """By the last reading; None before the first."""
        self.measured = True
        """Whether the last reading was one of a battery, and not of an input to which nothing is connected."""
        self._level: int | None = None

    def step(self, reading: int | None) -> str:
        """The level at this tick; ``reading`` is that of the A/D input, or None when it was not asked.

        Before the first reading it is ``high``: the robot neither hurries home nor waits for more. Readings that
        no battery could give change nothing.
        """
        if reading is not None:
            self.measured = 2 * reading * _VOLTS_A_STEP >= _CONNECTED
            if self.measured:
                self.charge = charge(reading)
                self._level = self._told(self.charge)
        return LEVELS[2 if self._level is None else self._level]

    def _told(self, charge: float) -> int:
        level = bisect_right(_BORDERS, charge)
        if self._level is None or level == self._level:
            return level
        # From below the border counts as higher, from above as lower, than it is.
        slack = -_HYSTERESIS if level > self._level else _HYSTERESIS
        firm = bisect_right(_BORDERS, charge + slack)
        return max(firm, self._level) if level > self._level else min(firm, self._level)
