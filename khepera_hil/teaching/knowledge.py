"""What the robot knows of objects, kept from one run to the next: a data set with a row for each tour."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from brp import BrpError
from brp.programs.object import Lrl, Nlt, Nrt, O, Per
from brp.store import load_data, save_data
from khepera_hil.errors import RecordingError, UsageError

__all__ = ["known", "read_knowledge", "write_knowledge"]

_VARIABLES = (O, Nlt, Nrt, Per, Lrl)


def known(row: Any) -> bool:
    """Whether this is one tour: O, Nlt, Nrt, Per and Lrl, each one of its variable's values."""
    names = {v.name for v in _VARIABLES}
    return isinstance(row, dict) and set(row) == names and all(row[v.name] in v.values for v in _VARIABLES)


def read_knowledge(path: Path) -> tuple[dict[str, int], ...]:
    """The tours so far, in their order; none when there is no such file yet. Raises UsageError."""
    if not path.exists():
        return ()
    try:
        _, columns = load_data(path, _VARIABLES)
    except (BrpError, OSError) as error:
        raise UsageError(f"{path} cannot be used: {error}") from None
    names = [v.name for v in _VARIABLES]
    return tuple(dict(zip(names, row, strict=True)) for row in zip(*(columns[name] for name in names), strict=True))


def write_knowledge(met: Sequence[Mapping[str, int]], path: Path) -> None:
    """Write them, in one step. Raises RecordingError."""
    try:
        save_data({v.name: [row[v.name] for row in met] for v in _VARIABLES}, _VARIABLES, path, name="delta-object")
    except OSError as error:
        raise RecordingError(f"the knowledge {path} cannot be written: {error.strerror or error}") from None
