"""Quantiles of a long run in bounded memory."""

from __future__ import annotations

from math import floor, log

__all__ = ["Quantiles"]


class Quantiles:
    """Counts of non-negative numbers in bins one per cent wide, from 1e-6 upwards; below that is nought."""

    _WIDTH = log(1.01)

    def __init__(self) -> None:
        self._bins: dict[int, int] = {}
        self.count = 0

    def add(self, value: float) -> None:
        """Count one value."""
        number = floor(log(value * 1e6) / self._WIDTH) if value >= 1e-6 else -1
        self._bins[number] = self._bins.get(number, 0) + 1
        self.count += 1

    def at(self, share: float) -> float | None:
        """The value that ``share`` (0..1) of all values do not pass, within one per cent; None without values."""
        if not self.count:
            return None
        left = max(1, share * self.count)
        for number in sorted(self._bins):
            left -= self._bins[number]
            if left <= 0:
                return 0.0 if number < 0 else 1e-6 * 1.01 ** (number + 0.5)
        raise AssertionError("a share above 1")
