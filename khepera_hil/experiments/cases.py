"""What a campaign tries and what comes of it: plain values, as JSON has them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["Case", "Result"]

Case = Mapping[str, Any]
"""What is to be tried, the seed among it."""

Result = dict[str, Any]
