"""How many examples a law of the engine is tried on: some dozens as a test, thousands in a campaign."""

from __future__ import annotations

import os
from typing import Any

from hypothesis import settings

__all__ = ["TIMES", "examples"]

TIMES = int(os.environ.get("BRP_LAWS_TIMES", "1"))
"""So many times more examples than a test run has; `benchmarks.laws` sets it."""


def examples(count: int, **options: Any) -> settings:
    """The settings of a law that a test run tries on ``count`` examples."""
    return settings(max_examples=count * TIMES, **options)
