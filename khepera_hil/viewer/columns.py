"""Rows kept back for each entity and sent as one chunk: what makes the file small and the recorder cheap.

One rerun call a value costs some ten times as much, in time and in bytes, as fifty values in one call; and
the viewer's own conversion of a bar chart costs more than all the rest of a tick, so its Arrow array is made
here directly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped] # it ships no types
import rerun as rr
from numpy.typing import NDArray

__all__ = ["Columns", "Lane", "Stamp", "bars", "static_bars", "tensors", "vectors"]

Stamp: TypeAlias = tuple[int, float, float]
"""A tick's number, robot time (s since the start), wall clock (s since 1970)."""

Columns: TypeAlias = Iterable[rr.ComponentColumn]

_TENSOR = rr.components.TensorDataBatch._ARROW_DATATYPE
_BUFFERS = _TENSOR.field("buffer").type
_FLOAT32 = next(i for i in range(_BUFFERS.num_fields) if _BUFFERS.field(i).name == "F32")

_NOTHING = [pa.array([], _BUFFERS.field(i).type) for i in range(_BUFFERS.num_fields)]
"""The union's other branches: numbers of the types that we do not write."""


@dataclass
class Lane:
    """The rows of one entity that wait for their chunk; ``encode`` turns them into the chunk's columns."""

    path: str
    encode: Callable[[list[Any]], Columns]
    stamps: list[Stamp] = field(default_factory=list)
    rows: list[Any] = field(default_factory=list)

    def add(self, stamp: Stamp, row: Any) -> None:
        """Keep one row."""
        self.stamps.append(stamp)
        self.rows.append(row)

    def send(self, stream: rr.RecordingStream) -> None:
        """Send what waits as one chunk, if anything does."""
        if not self.rows:
            return
        ticks, times, walls = zip(*self.stamps, strict=True)
        indexes = [
            rr.TimeColumn("tick", sequence=np.array(ticks, np.int64)),
            # Rounded here: from seconds the viewer would cut 4.1 down to 4.099999999.
            rr.TimeColumn("run_time", duration=_nanoseconds(times).astype("timedelta64[ns]")),
            rr.TimeColumn("wall_clock", timestamp=_nanoseconds(walls).astype("datetime64[ns]")),
        ]
        rows, self.rows, self.stamps = self.rows, [], []
        stream.send_columns(self.path, indexes, self.encode(rows), strict=True)


def _nanoseconds(seconds: Sequence[float]) -> NDArray[np.int64]:
    return np.round(np.array(seconds, np.float64) * 1e9).astype(np.int64)


class _Arrow:
    """An Arrow array in the shape that rerun asks of a component batch."""

    def __init__(self, array: pa.Array) -> None:
        self._array = array

    def as_arrow_array(self) -> pa.Array:
        return self._array


def _tensor_array(rows: Sequence[NDArray[np.float32]]) -> pa.Array:
    """Tensors of one shape each as the array of structs and unions that the viewer stores them in."""
    shapes = [row.shape for row in rows]
    lengths = pa.array(np.cumsum([0, *map(len, shapes)]), pa.int32())
    shape = pa.ListArray.from_arrays(
        lengths, pa.array([n for s in shapes for n in s], pa.uint64()), type=_TENSOR.field("shape").type
    )
    names = pa.ListArray.from_arrays(
        pa.array(np.zeros(len(rows) + 1, np.int32)), pa.array([], pa.string()), type=_TENSOR.field("names").type
    )
    flat = np.concatenate([row.ravel() for row in rows]) if rows else np.zeros(0, np.float32)
    numbers = pa.ListArray.from_arrays(
        pa.array(np.cumsum([0, *(row.size for row in rows)]), pa.int32()),
        pa.array(flat, pa.float32()),
        type=_BUFFERS.field(_FLOAT32).type,
    )
    children = [*_NOTHING[:_FLOAT32], numbers, *_NOTHING[_FLOAT32 + 1 :]]
    # Not UnionArray.from_dense: its type would differ from the viewer's in what may be null.
    buffer = pa.Array.from_buffers(
        type=_BUFFERS,
        length=len(rows),
        buffers=[
            None,
            pa.py_buffer(np.full(len(rows), _FLOAT32, np.int8)),
            pa.py_buffer(np.arange(len(rows), dtype=np.int32)),
        ],
        children=children,
    )
    return pa.StructArray.from_arrays(
        [shape, names, buffer],
        fields=[_TENSOR.field(i) for i in range(_TENSOR.num_fields)],
    )


def _column(descriptor: rr.ComponentDescriptor, rows: Sequence[NDArray[np.floating[Any]] | None]) -> Columns:
    present = [np.asarray(row, np.float32) for row in rows if row is not None]
    lengths = [0 if row is None else 1 for row in rows]  # an empty row clears what was shown before
    return [rr.ComponentColumn(descriptor, _Arrow(_tensor_array(present)), lengths=lengths)]


def bars(rows: Sequence[NDArray[np.floating[Any]] | None]) -> Columns:
    """One bar chart a row (its heights), or None for a tick without."""
    return _column(rr.BarChart.descriptor_values(), rows)


def vectors(width: int) -> Callable[[list[NDArray[np.float64]]], Columns]:
    """For a lane whose rows are ``width`` numbers each."""
    return lambda rows: rr.Scalars.columns(scalars=np.concatenate(rows)).partition([width] * len(rows))


def tensors(rows: Sequence[NDArray[np.floating[Any]] | None]) -> Columns:
    """One array of any shape a row, or None for a tick without."""
    return _column(rr.Tensor.descriptor_data(), rows)


def static_bars(stream: rr.RecordingStream, path: str, at: NDArray[np.float64], width: float, colour: int) -> None:
    """What never changes of a bar chart: where its bars stand (their centres), how wide they are, their colour."""
    left = np.asarray(at - width / 2, np.float32)  # the viewer's bar begins at its abscissa
    stream.log(
        path,
        [
            rr.components.ColorBatch(np.array([colour], np.uint32)).described(rr.BarChart.descriptor_color()),
            rr.components.TensorDataBatch(rr.encodings.TensorData(array=left)).described(
                rr.BarChart.descriptor_abscissa()
            ),
            rr.components.LengthBatch(np.full(len(left), width, np.float32)).described(
                rr.BarChart.descriptor_widths()
            ),
        ],
        static=True,
        strict=True,
    )
