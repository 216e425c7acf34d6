"""Tell two recorded runs apart: what was set up otherwise, how they ended, and the first tick that differs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any

from khepera_hil.reading import Run, tick_of
from khepera_hil.recording import HOST_COLUMNS

__all__ = ["Comparison", "compare"]

_OWN = {"run", "started", "ending", "host_columns"}
"""What two manifests always differ in, and what is compared by itself."""


@dataclass
class Comparison:
    """Two runs beside each other. ``None`` stands for what one of them does not have."""

    set_up: dict[str, tuple[Any, Any]] = field(default_factory=dict)
    """Entries of the manifests that differ, by their path (``versions.numpy``)."""
    ended: dict[str, tuple[Any, Any]] = field(default_factory=dict)
    """How they ended and what they scored, where that differs."""
    ticks: tuple[int, int] = (0, 0)
    columns: dict[str, tuple[int, int, float, Any, Any]] = field(default_factory=dict)
    """For each column of the log that differs: in how many of the ticks that both have; and of the first of them
    tick, time (s) and both values."""

    @property
    def same(self) -> bool:
        """Whether the logs are the same but for the host's own columns."""
        return not self.columns and self.ticks[0] == self.ticks[1]


def compare(one: Run, other: Run) -> Comparison:
    """Compare them. Raises RecordingError when a log is damaged."""
    found = Comparison()
    for path, values in _differences(one.manifest, other.manifest, ""):
        if path.split(".")[0] not in _OWN:
            found.set_up[path] = values
    for path, values in _differences(one.manifest.get("ending") or {}, other.manifest.get("ending") or {}, ""):
        if not path.endswith(("_ms", ".p50", ".p99")):  # the host's
            found.ended[path] = values
    host = set(HOST_COLUMNS)
    for run in (one, other):
        host |= set(map(str, run.manifest.get("host_columns") or []))
    counts = [0, 0]
    for left, right in _aligned(_sound(one), _sound(other)):
        counts[0] += left is not None
        counts[1] += right is not None
        if left is not None and right is not None:
            _columns(found, left, right, host)
    found.ticks = (counts[0], counts[1])
    return found


def _sound(run: Run) -> Iterator[dict[str, Any]]:
    """The log's rows. Raises RecordingError for one that is no tick."""
    for row in run.rows():
        tick_of(row)
        yield row


def _columns(found: Comparison, left: Mapping[str, Any], right: Mapping[str, Any], host: set[str]) -> None:
    for name in {**left, **right}:
        a, b = left.get(name), right.get(name)
        if a == b or name in host:
            continue
        count, *first = found.columns.get(name, (0, left["tick"], left.get("t", 0.0), a, b))
        found.columns[name] = (count + 1, *first)


def _aligned(
    one: Iterator[dict[str, Any]], other: Iterator[dict[str, Any]]
) -> Iterator[tuple[dict[str, Any] | None, dict[str, Any] | None]]:
    """Rows of the same tick together; a tick that one of them missed stands alone."""
    left, right = next(one, None), next(other, None)
    while left is not None and right is not None:
        if left["tick"] == right["tick"]:
            yield left, right
            left, right = next(one, None), next(other, None)
        elif left["tick"] < right["tick"]:
            yield left, None
            left = next(one, None)
        else:
            yield None, right
            right = next(other, None)
    while left is not None:
        yield left, None
        left = next(one, None)
    while right is not None:
        yield None, right
        right = next(other, None)


def _differences(one: Any, other: Any, path: str) -> Iterator[tuple[str, tuple[Any, Any]]]:
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for name in {**one, **other}:
            yield from _differences(one.get(name), other.get(name), f"{path}.{name}" if path else str(name))
    elif isinstance(one, list) and isinstance(other, list) and any(isinstance(v, dict) for v in one + other):
        for place, (a, b) in enumerate(zip_longest(one, other)):
            named = next((v["name"] for v in (a, b) if isinstance(v, dict) and "name" in v), place)
            yield from _differences(a, b, f"{path}.{named}")
    elif one != other:
        yield path, (one, other)
