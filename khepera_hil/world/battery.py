"""The robot's battery: what it gives, and what the base gives it back."""

from __future__ import annotations

__all__ = ["Battery"]

# The manuals give four NiCd cells of 180 mAh and about 45 minutes, which these currents make 47 with the wheels at
# 10 units; the currents themselves, and all that follows, are proposed.
_CAPACITY = 180.0  # mAh
_ELECTRONICS = 90.0  # mA
_CAMERA = 60.0
_TURBINE = 150.0
_WHEEL = 40.0 / (10 * 100 / 12)  # mA for each mm/s of a wheel: 40 at 10 units
_CHARGED_IN = 45 * 60.0  # s
# Voltage of four NiCd cells over their charge: a long plateau with an end at both sides.
_CHARGES = (0.0, 0.1, 0.5, 0.9, 1.0)
_VOLTS = (4.0, 4.7, 4.9, 5.05, 5.4)


class Battery:
    """Its charge, 0 (empty) to 1; ``compression`` makes all of it so many times faster.

    It is charged while the robot's centre is in the base's square, whose floor has the contacts.
    """

    def __init__(self, compression: float = 1.0) -> None:
        self.charge = 1.0
        self.charging = False
        """Whether the base's contacts feed it."""
        self.turbine = False
        self.current_ma = _ELECTRONICS + _CAMERA
        """What is drawn now, whoever pays for it."""
        self.used_mah = 0.0
        """Drawn since power-up, by the same compressed reckoning."""
        self._compression = compression

    def step(self, step: float, rolled: float, charging: bool) -> None:
        """``step`` seconds in which the two wheels turned ``rolled`` mm together."""
        current = _ELECTRONICS + _CAMERA + _WHEEL * rolled / step
        if self.turbine:
            current += _TURBINE
        self.current_ma = current
        self.charging = charging
        compressed = step * self._compression
        drawn = current * compressed / 3600
        self.used_mah += drawn
        change = compressed / _CHARGED_IN if charging else -drawn / _CAPACITY
        self.charge = min(max(self.charge + change, 0.0), 1.0)

    @property
    def volts(self) -> float:
        """Between its poles."""
        for place in range(1, len(_CHARGES)):
            if self.charge <= _CHARGES[place]:
                low, high = _CHARGES[place - 1 : place + 1]
                share = (self.charge - low) / (high - low)
                return _VOLTS[place - 1] + share * (_VOLTS[place] - _VOLTS[place - 1])
        return _VOLTS[-1]
