"""A campaign's results in its folder, as parquet: written as they come, put together into one table.

``results-CODE.parquet`` has a row for each result of that code (`khepera_hil.experiments.fingerprint`): what was
tried and what came of it, a column for each value, and as JSON in ``case_json`` and ``result_json``, which alone
are read again. Results that came since the table was last put together are parts, files of the same columns, in
``results-CODE.parts``. A file gets its name when it is whole and on the disk, so a process that is killed loses
what it had not yet handed over, and no more. One campaign at a time writes into a folder.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any

from khepera_hil.errors import RecordingError

if TYPE_CHECKING:
    import pyarrow as pa  # type: ignore[import-untyped]  # it ships no types

__all__ = ["Results", "forget", "kept", "parts", "table_of"]

_CASE, _RESULT = "case_json", "result_json"
_PARTS = 256
"""So many at least are put together at a time, and so many that the table grows by an eighth."""


def table_of(folder: Path, code: str) -> Path:
    """Where the table of a code is."""
    return folder / f"results-{code}.parquet"


def parts(folder: Path, code: str) -> list[Path]:
    """What has come since the table was put together, the oldest first."""
    return sorted(_beside(folder, code).glob("part-*.parquet"))


def _beside(folder: Path, code: str) -> Path:
    return folder / f"results-{code}.parts"


def kept(folder: Path, code: str) -> dict[str, str]:
    """The results of this code, by their cases, both as JSON; a part that is damaged has none.

    Raises RecordingError where the table is damaged.
    """
    found = _read(table_of(folder, code))
    for part in parts(folder, code):
        with suppress(RecordingError):
            found |= _read(part)
    return found


def forget(folder: Path, code: str) -> None:
    """Remove the results of this code, damaged ones too. Raises RecordingError where that cannot be done."""
    if parts(folder, code) or table_of(folder, code).exists():
        with _locked(folder):
            try:
                table_of(folder, code).unlink(missing_ok=True)
                _remove(folder, code)
            except OSError as error:
                raise _cannot(folder, error) from None


class Results:
    """Keeps the results of one code in a folder, in which nobody else writes meanwhile.

    Raises RecordingError where another campaign does, or where the folder cannot be written.
    """

    def __init__(self, folder: Path, code: str) -> None:
        self._folder, self._code = folder, code
        self._lock = _locked(folder)
        try:
            for left in (*folder.glob(".results-*"), *_beside(folder, code).glob(".*")):
                left.unlink()  # half written by a process that was killed
            self._known = kept(folder, code)
            self._rows = len(self._known)
            self._parts = _last(folder, code)
        except OSError as error:
            self._lock.close()
            raise _cannot(folder, error) from None
        except RecordingError:
            self._lock.close()
            raise

    @property
    def known(self) -> Mapping[str, str]:
        """By their cases, what was here and what has been kept since, as JSON."""
        return self._known

    def keep(self, rows: Sequence[tuple[str, str]]) -> None:
        """Cases and their results, as JSON; they are on the disk when this returns."""
        if not rows:
            return
        folder = _beside(self._folder, self._code)
        try:
            folder.mkdir(exist_ok=True)
            self._parts += 1
            _write(folder / f"part-{self._parts:06}.parquet", rows, self._code)
        except OSError as error:
            raise _cannot(self._folder, error) from None
        self._known |= rows
        if self._parts >= _PARTS and 8 * (len(self._known) - self._rows) >= self._rows:
            self.together(())

    def together(self, order: Iterable[str]) -> None:
        """Put the parts into the table: first these cases, in their order, then what there is besides."""
        ordered = {case: self._known[case] for case in order if case in self._known} | self._known
        if not self._parts and list(ordered) == list(self._known):
            return
        try:
            _write(table_of(self._folder, self._code), list(ordered.items()), self._code)
            self._known = {case: ordered[case] for case in ordered}
            _remove(self._folder, self._code)
            self._rows, self._parts = len(self._known), 0
        except OSError as error:
            raise _cannot(self._folder, error) from None

    def __enter__(self) -> Results:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.close()


def _last(folder: Path, code: str) -> int:
    """The number of the last part that there is; what is damaged is set aside, its case is tried again."""
    for part in parts(folder, code):
        try:
            _read(part)
        except RecordingError:
            part.rename(part.with_suffix(".damaged"))
    return max((int(part.stem.rpartition("-")[2]) for part in _beside(folder, code).glob("part-*")), default=0)


def _remove(folder: Path, code: str) -> None:
    for part in parts(folder, code):
        part.unlink()
    with suppress(OSError):  # there is none, or something damaged is in it
        _beside(folder, code).rmdir()


def _locked(folder: Path) -> IO[bytes]:
    """The file by which a campaign has the folder; the system gives it back when the process ends, in any way."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / ".campaign").open("ab")
    except OSError as error:
        raise _cannot(folder, error) from None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        raise RecordingError(f"another campaign is writing its results into {folder}; wait for its end") from None
    except OSError:
        pass  # a file system without locks
    return file


def _read(path: Path) -> dict[str, str]:
    import pyarrow as pa
    import pyarrow.parquet as pq  # type: ignore[import-untyped]

    try:
        with path.open("rb") as file, pq.ParquetFile(file) as parquet:
            columns = parquet.read(columns=[_CASE, _RESULT]).to_pydict()
        rows = list(zip(columns[_CASE], columns[_RESULT], strict=True))
        for case, result in rows:
            if not isinstance(json.loads(case), dict) or not isinstance(json.loads(result), dict):
                raise ValueError("a row is no case with its result")
    except (FileNotFoundError, NotADirectoryError):
        return {}
    except PermissionError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from None
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        said = str(error).partition("\n")[0]
        raise RecordingError(f"{path} is no whole table of results ({said}); remove it to measure anew") from None
    return dict(rows)


def _write(path: Path, rows: Sequence[tuple[str, str]], code: str) -> None:
    """Write a file that is there whole, or not at all. Raises OSError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    sink = pa.BufferOutputStream()
    pq.write_table(_columns(rows, code), sink, compression="zstd")
    aside = path.with_name(f".{path.name}")
    try:
        with aside.open("wb") as file:
            file.write(sink.getvalue())
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, path)
    except OSError:
        aside.unlink(missing_ok=True)
        raise
    directory = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)


def _columns(rows: Sequence[tuple[str, str]], code: str) -> pa.Table:
    """The rows' values as columns; of two of the same name the result's is called ``result_NAME``."""
    import pyarrow as pa

    cases = [json.loads(case) for case, _ in rows]
    results = [json.loads(result) for _, result in rows]
    columns = {name: _array(name, cases) for name in _names(cases)}
    for name in _names(results):
        columns[f"result_{name}" if name in columns else name] = _array(name, results)
    columns[_CASE] = pa.array([case for case, _ in rows], pa.string())
    columns[_RESULT] = pa.array([result for _, result in rows], pa.string())
    return pa.table(columns, metadata={"code": code})


def _names(values: Sequence[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(name for one in values for name in one))


def _array(name: str, rows: Sequence[Mapping[str, Any]]) -> pa.Array:
    """Of the narrowest kind that holds all; what is no plain value is JSON, and so is what is of several kinds."""
    import pyarrow as pa

    values = [row.get(name) for row in rows]
    kinds = {type(value) for value in values if value is not None}
    for held, kind in (
        ({bool}, pa.bool_()),
        ({int}, pa.int64()),
        ({int, float}, pa.float64()),
        ({str}, pa.string()),
    ):
        if kinds <= held:
            try:
                return pa.array(values, kind)
            except (OverflowError, pa.ArrowInvalid):
                break  # a whole number that needs more than 64 bits, or than a float holds
    return pa.array([None if value is None else json.dumps(value) for value in values], pa.string())


def _cannot(folder: Path, error: OSError) -> RecordingError:
    return RecordingError(f"results cannot be kept in {folder}: {error.strerror or error}")
