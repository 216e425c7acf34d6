"""The robot's own units in the world's (a leaf that anyone may import)."""

from __future__ import annotations

__all__ = ["ENCODER_PULSES_PER_MM", "MAX_SPEED", "SPEED_UNIT_MM_S"]

ENCODER_PULSES_PER_MM = 12.0
"""600 pulses and 50 mm a wheel's turn. The manual also says 0.08 mm a pulse, which is 12.5: it contradicts
itself by 4 % (appendix A, command H, against chapter 3)."""

SPEED_UNIT_MM_S = 100.0 / ENCODER_PULSES_PER_MM
"""One unit of command D: 1 pulse in 10 ms (the manual's "8 mm/s")."""

MAX_SPEED = 127
"""Command D's limit, pulse/10 ms, "about 1 m/s"."""
