"""A run's ticks as columns, for pandas and the like: parquet, with units in its schema, or CSV.

``tick``, ``t``, ``px1`` .. ``px8``, ``l1`` .. ``l8``, ``left``, ``right``, then the program's variables and its
draws. A reading that was not had is empty, and so are a speed that was not acknowledged, a variable that was not
known and a draw that was not made. A draw of the name of a variable is called ``drawn NAME``.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from pathlib import Path

from khepera_hil import protocol
from khepera_hil.errors import ProtocolError, RecordingError
from khepera_hil.reading import Run
from khepera_hil.recording import Tick, Value

__all__ = ["Column", "columns", "to_csv", "to_parquet"]

BATCH = 10_000
"""Ticks that are in memory at a time."""


@dataclass(frozen=True)
class Column:
    """A column: ``kind`` is ``bool``, ``int``, ``float`` or ``str``; ``unit`` is for people."""

    name: str
    kind: type
    unit: str
    get: Callable[[Tick], Value | None]


def columns(run: Run) -> list[Column]:
    """The run's columns; reads the log once, since only that knows what was known and drawn."""
    evidence: dict[str, type] = {}
    draws: dict[str, type] = {}
    for name, values in (run.manifest.get("evidence") or {}).items():
        for value in values:
            _widen(evidence, name, value)
    for tick in run.ticks():
        for name, value in tick.evidence.items():
            _widen(evidence, name, value)
        for name, value in tick.draws.items():
            _widen(draws, name, value)
    found = [
        Column("tick", int, "ticks since the start", lambda tick: tick.tick),
        Column("t", float, "s of robot time since the start", lambda tick: tick.t),
    ]
    found += [_reading("N", i, f"px{i + 1}", "proximity, 0 far .. 1023 near") for i in range(8)]
    found += [_reading("O", i, f"l{i + 1}", "ambient light, 511 dark .. 0 bright") for i in range(8)]
    found += [_speed(0, "left"), _speed(1, "right")]
    taken = {column.name for column in found}
    for kinds, of, word in ((evidence, _known, "known"), (draws, _drawn, "drawn")):
        for name, kind in kinds.items():
            free = name if name not in taken else f"{word} {name}"
            taken.add(free)
            found.append(Column(free, kind, f"{word}; {_domain(run, name)}", of(name)))
    return found


def to_csv(run: Run, path: Path) -> int:
    """Write ``path`` and return how many ticks there were. Raises RecordingError where that cannot be done."""
    chosen = columns(run)
    count = 0
    with _whole(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow([column.name for column in chosen])
        for tick in run.ticks():
            table.writerow([column.get(tick) for column in chosen])  # None is an empty cell
            count += 1
    return count


def to_parquet(run: Run, path: Path) -> int:
    """Write ``path`` and return how many ticks there were; ``unit`` is in each field's metadata, program, seed and
    run in the schema's. Raises RecordingError where that cannot be done.
    """
    import pyarrow as pa  # type: ignore[import-untyped] # it ships no types; late: it takes 0.2 s
    import pyarrow.parquet as pq  # type: ignore[import-untyped]

    chosen = columns(run)
    kinds = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string()}
    schema = pa.schema(
        [pa.field(column.name, kinds[column.kind], metadata={"unit": column.unit}) for column in chosen],
        metadata={"run": run.name, "program": run.program, "seed": str(run.manifest.get("seed"))},
    )
    count = 0
    with _whole(path) as beside, pq.ParquetWriter(str(beside), schema) as writer:
        ticks = run.ticks()
        while batch := list(islice(ticks, BATCH)):
            arrays = [pa.array([_of(column, tick) for tick in batch], kinds[column.kind]) for column in chosen]
            writer.write_batch(pa.record_batch(arrays, schema=schema))
            count += len(batch)
    return count


def _of(column: Column, tick: Tick) -> Value | None:
    value = column.get(tick)
    return None if value is None else column.kind(value)


class _whole:
    """Write beside the file that is meant, and put it in its place when it is whole."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._beside = path.with_name(f".{path.name}.{os.getpid()}")

    def __enter__(self) -> Path:
        return self._beside

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        try:
            if kind is None:
                os.replace(self._beside, self._path)
            else:
                self._beside.unlink(missing_ok=True)
        except OSError as wrong:
            kind, error = OSError, wrong
        if isinstance(error, OSError):
            raise RecordingError(f"{self._path} cannot be written: {error.strerror or error}") from None


def _reading(letter: str, place: int, name: str, unit: str) -> Column:
    def get(tick: Tick) -> Value | None:
        values = _answer(letter, tick.raw.get(letter, ""))
        return None if values is None else values[place]

    return Column(name, int, unit, get)


@lru_cache(maxsize=4)
def _answer(letter: str, raw: str) -> tuple[int | str, ...] | None:
    """What the robot answered, or None where there was no whole answer; eight columns ask it of each tick."""
    try:
        return protocol.parse_answer(letter, raw.encode("ascii", "replace") + b"\r\n")
    except ProtocolError:
        return None


def _speed(place: int, name: str) -> Column:
    unit = "pulse/10 ms (8 mm/s each), as acknowledged"
    return Column(name, int, unit, lambda tick: None if tick.command is None else tick.command[place])


def _known(name: str) -> Callable[[Tick], Value | None]:
    return lambda tick: tick.evidence.get(name)


def _drawn(name: str) -> Callable[[Tick], Value | None]:
    return lambda tick: tick.draws.get(name)


def _widen(kinds: dict[str, type], name: str, value: Value) -> None:
    """The narrowest kind that holds all values of a column: truths, whole numbers, numbers, text."""
    order: tuple[type, ...] = (bool, int, float, str)
    kind: type = next(k for k in order if isinstance(value, k))
    kinds[name] = max(kinds.get(name, kind), kind, key=order.index)


def _domain(run: Run, name: str) -> str:
    """A variable's values as the manifest has them, in a few words."""
    values = (run.manifest.get("evidence") or {}).get(name)
    for question in run.questions:
        for variable, domain in zip(question["variables"], question["values"], strict=True):
            if variable == name:
                values = domain
    if not values:
        return "a variable"
    shown = ", ".join(map(str, values)) if len(values) <= 6 else f"{values[0]} .. {values[-1]}"
    return f"{shown}, degrees clockwise from ahead" if name.startswith("Theta") else shown
