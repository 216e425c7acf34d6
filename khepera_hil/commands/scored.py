"""The score as a line for a person."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["scored"]

_ALWAYS = ("contact_longest_s", "contacts_over_half_second", "distance_m")


def scored(score: Mapping[str, Any]) -> str:
    """The figures, those of which nothing has come left out but for the three that every run is asked about."""
    told = {name: value for name, value in score.items() if value or name in _ALWAYS}
    return ", ".join(f"{name} {value}" for name, value in told.items())
