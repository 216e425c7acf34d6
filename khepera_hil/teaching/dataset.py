"""Data sets by their name, their file, or out of a recorded run; whole, cut and joined."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brp import BrpError, Description, Specification, Variable
from brp.data import names, shipped_file
from brp.programs.behavior import Base, pi_behavior_taught
from brp.store import load, load_data, save_data
from khepera_hil.errors import RecordingError, UsageError
from khepera_hil.reading import read_manifest, read_ticks
from khepera_hil.recording import LOG
from khepera_hil.teaching.behaviors import based, enough, said
from khepera_hil.teaching.lesson import Tick

__all__ = ["TICK", "DataSet", "data_set", "joined", "learnt", "taught"]

_CUT = re.compile(r"(?P<source>.+)@(?P<first>\d+(\.\d+)?)?-(?P<last>\d+(\.\d+)?)?")
TICK = 0.1
"""Seconds that a tick of a data set's file lasts."""


@dataclass(frozen=True)
class DataSet:
    """Columns of a data set: a value of every variable for each datum."""

    name: str
    columns: Mapping[str, Sequence[Any]]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def save(self, variables: Iterable[Variable], path: Path) -> None:
        """Write the file. Raises RecordingError when it cannot be written."""
        try:
            save_data(dict(self.columns), variables, path, name=self.name)
        except OSError as error:
            raise RecordingError(f"the data set {path} cannot be written: {error.strerror or error}") from None


def learnt(specification: Specification) -> list[Variable]:
    """The variables that a specification learns from."""
    needed = {variable for term in specification.free for variable in term.variables}
    return [variable for variable in specification.variables if variable in needed]


def data_set(source: str, variables: Sequence[Variable], *, labelled: bool = False) -> DataSet:
    """The data of these variables in ``source``.

    That is the name of a data set that comes with brp (``delta-push``), a data set's file, or the folder of a
    recorded run: each of its ticks in which all of the variables were sensed or drawn is a datum (of Base, which
    the watchman sums out, what its readings make more probable). Behind it ``@5-20`` takes the seconds 5 to 20
    only, ``@5-`` all from 5 on. With ``labelled`` a run's ticks count only if an operator said what Behavior is.
    Raises UsageError.
    """
    cut = None if Path(source).exists() else _CUT.fullmatch(source)
    if cut is None or cut["first"] is cut["last"] is None:
        whole, first, last = source, None, None
    else:
        whole, first, last = (
            cut["source"],
            None if cut["first"] is None else float(cut["first"]),
            None if cut["last"] is None else float(cut["last"]),
        )
    path = Path(whole)
    if path.is_dir():
        name, columns, times = _of_run(path, variables, labelled)
    elif labelled:
        raise UsageError(f"{whole} is a data set, which does not tell what was labelled; leave --labelled out")
    else:
        name, columns, times = _of_file(whole, variables, timed=first is not None or last is not None)
    if first is None and last is None:
        kept = list(range(len(times)))
    else:
        low, high = first or 0.0, float("inf") if last is None else last
        kept = [place for place, t in enumerate(times) if low - 1e-9 <= t < high - 1e-9]
        if not kept:
            raise UsageError(f"{source}: no datum of {whole} lies in these seconds")
    return DataSet(name, {v.name: [columns[v.name][place] for place in kept] for v in variables})


def joined(sets: Sequence[DataSet], name: str | None = None) -> DataSet:
    """One after the other; the name is the first one's unless another is given."""
    columns = {key: [value for one in sets for value in one.columns[key]] for key in sets[0].columns}
    return DataSet(name or sets[0].name, columns)


def taught(source: str, specification: Specification) -> Description:
    """The description that ``source`` makes of a specification: data as above, or a file of `identify`'s.

    Raises UsageError.
    """
    if _is_description(Path(source)):
        try:
            return load(source, specification)
        except (BrpError, OSError) as error:
            raise UsageError(f"{source} cannot be used: {error}") from None
    data = data_set(source, learnt(specification))
    if specification is pi_behavior_taught:
        enough(data.columns)
    try:
        return specification.identify(dict(data.columns), name=data.name)
    except BrpError as error:
        raise UsageError(f"nothing can be learnt from {source}: {error}") from None


def _is_description(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return b'"brp description"' in file.read(200)
    except OSError:
        return False


def _of_file(source: str, variables: Sequence[Variable], *, timed: bool) -> tuple[str, dict[str, Any], list[float]]:
    path = shipped_file(source) if source in names() else Path(source)
    wanted = [*variables, *([Tick] if timed else [])]
    try:
        name, columns = load_data(path, wanted)
    except FileNotFoundError:
        raise UsageError(
            f"there is no data set {source!r}: give a file, a run's folder, or one of {', '.join(names())}"
        ) from None
    except (BrpError, OSError) as error:
        raise UsageError(f"{source} cannot be used: {error}") from None
    count = len(columns[variables[0].name])
    ticks: Sequence[int] = columns[Tick.name] if timed else range(count)
    return name, columns, [tick * TICK for tick in ticks]


def _of_run(folder: Path, variables: Sequence[Variable], labelled: bool) -> tuple[str, dict[str, Any], list[float]]:
    if not (folder / LOG).exists():
        raise UsageError(f"{folder} is no recorded run: there is no {LOG} in it")
    manifest = read_manifest(folder)
    columns: dict[str, list[Any]] = {v.name: [] for v in variables}
    times: list[float] = []
    kept = 0
    for row in read_ticks(folder):
        values = {**_object(row.get("evidence")), **_object(row.get("draws"))}
        if Base in variables and Base.name not in values:
            values |= based(values)
        if not all(v.name in values for v in variables):
            continue
        kept += 1
        if labelled and not said(_object(row.get("evidence"))):
            continue
        for v in variables:
            try:
                v.place(values[v.name])
            except BrpError as error:
                raise UsageError(f"{folder}, tick {row['tick']}: {error}") from None
            columns[v.name].append(values[v.name])
        times.append(float(row.get("t", 0.0)))
    if not times and kept:
        raise UsageError(
            f"no tick of {folder} was labelled: run the watchman with --labels, and say by the keys 1 to 6 what "
            "Behavior it is"
        )
    if not times:
        wanted = ", ".join(v.name for v in variables)
        raise UsageError(f"no tick of {folder} has all of {wanted}: it is a run of another kind of program")
    return f"run {manifest.get('run', folder.name)}", dict(columns), times


def _object(found: Any) -> dict[str, Any]:
    return found if isinstance(found, dict) else {}
