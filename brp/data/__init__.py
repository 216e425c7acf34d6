"""The data sets that come with brp: half a minute of driving each, as in section 5.5. README.md says how each was
recorded.
"""

from functools import cache
from pathlib import Path

from brp.description import Description, Specification
from brp.store import load_data

__all__ = ["names", "shipped", "shipped_file"]

_HERE = Path(__file__).parent
_SUFFIX = ".json"


def names() -> tuple[str, ...]:
    """The data sets that there are, such as ``delta-push``."""
    return tuple(sorted(path.stem for path in _HERE.glob(f"*{_SUFFIX}")))


def shipped_file(name: str) -> Path:
    """Where a data set lies that comes with brp. Raises KeyError when there is none of that name."""
    if name not in names():
        raise KeyError(name)
    return _HERE / f"{name}{_SUFFIX}"


@cache
def shipped(name: str, specification: Specification) -> Description:
    """The description that a data set that comes with brp makes of ``specification``.

    Raises KeyError when there is no such data set, and `StoreError` when it is not one for the specification.
    """
    needed = {v for term in specification.free for v in term.variables}
    found, columns = load_data(shipped_file(name), [v for v in specification.variables if v in needed])
    return specification.identify(columns, name=found)
