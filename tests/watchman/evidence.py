"""Sensory variables as a run meets them."""

from __future__ import annotations

from brp import Value
from brp.programs.watchman import Sensory_variables

__all__ = ["AT_BASE", "OUTSIDE", "sensed"]

OUTSIDE = {f"Px{i}": 0 for i in range(1, 9)} | dict(
    zip((f"L{i}" for i in range(1, 9)), (492, 470, 430, 428, 455, 490, 496, 497), strict=True)
)
"""In the open, the lamp ahead."""

AT_BASE = dict(zip((f"Px{i}" for i in range(1, 9)), (700, 400, 200, 200, 400, 700, 60, 60), strict=True)) | {
    f"L{i}": 210 for i in range(1, 9)
}
"""In the recess."""


def sensed(around: dict[str, int] = OUTSIDE, **known: Value) -> dict[str, Value]:
    """The 33 sensory variables: a watchman on patrol, but for what is told otherwise."""
    usual: dict[str, Value] = {
        **around,
        "Vigil": True,
        "Energy": "high",
        "Fire": False,
        "Identify": False,
        "Behavior_t-1": "patrol",
        "Move_t-1": "wander",
        "Tempo": "running",
        "Tour": "undone",
        "Dir": 0,
        "Prox": 0,
        "DirL": 0,
        "ProxL": 1,
        "Vtrans_c": 5,
        **dict.fromkeys(("Nlt", "Nrt", "Per", "Lrl"), 0),
    }
    found = usual | {name.replace("_t_1", "_t-1"): value for name, value in known.items()}
    assert set(found) == {v.name for v in Sensory_variables}
    return found
