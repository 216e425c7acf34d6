"""Reading a .rrd back with the viewer's own reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

Rows = dict[int, tuple[float, Any]]
"""Tick -> (run_time in s, value); a cleared value is None."""


def entities(path: Path) -> set[str]:
    """The paths of all entities in the file."""
    return {str(chunk.entity_path) for chunk in rr.chunk.RrdReader(str(path)).stream()}


def rows(path: Path, entity: str, component: str) -> Rows:
    """The rows of one component of one entity, by tick; works on a file without footer too."""
    found: Rows = {}
    for chunk in rr.chunk.RrdReader(str(path)).stream().filter(content=entity, is_static=False):
        batch = chunk.to_record_batch()
        if component not in batch.schema.names:
            continue
        ticks = batch["tick"].to_pylist()
        times = batch["run_time"].cast("int64").to_pylist()
        for tick, nanoseconds, value in zip(ticks, times, batch[component].to_pylist(), strict=True):
            assert tick not in found, f"tick {tick} twice"
            found[tick] = (nanoseconds / 1e9, value or None)
    return found


def heights(value: Any) -> NDArray[np.float32]:
    """A bar chart's value as numbers."""
    (tensor,) = value
    return np.array(tensor["buffer"], np.float32).reshape(tensor["shape"])
