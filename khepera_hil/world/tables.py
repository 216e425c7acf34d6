"""Tables of a TOML file, read key by key: every mistake is named by file, key and what was expected."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from khepera_hil.errors import WorldError

__all__ = ["Range", "Table", "number_in", "read_table", "shipped"]

Range = tuple[float, float]


def shipped(folder: str) -> list[str]:
    """Names of the TOML files that come with the package in ``folder``."""
    entries = files(__package__).joinpath(folder).iterdir()
    return sorted(entry.name.removesuffix(".toml") for entry in entries if entry.name.endswith(".toml"))


def read_table(what: str, folder: str, name: str) -> tuple[str, Table]:
    """A file's label and its table: one of ``folder`` by its name, or any by its path (with a slash or .toml).

    ``what`` is the word for it in sentences. Raises :class:`~khepera_hil.errors.WorldError`.
    """
    if "/" in name or name.endswith(".toml"):
        where, label = Path(name), Path(name).stem
        try:
            text = where.read_text("utf-8")
        except (OSError, UnicodeDecodeError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "it is no UTF-8 text"
            raise WorldError(f"the {what} {name} cannot be read: {reason}") from None
    else:
        source, label = files(__package__).joinpath(folder, f"{name}.toml"), name
        if not name.replace("-", "").replace("_", "").isalnum() or not source.is_file():
            there = ", ".join(shipped(folder))
            raise WorldError(f"there is no {what} {name!r}; there are {there}, or give the path of a TOML file")
        text = source.read_text("utf-8")
        name = f"{name}.toml"
    try:
        table = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise WorldError(f"{name} is no TOML: {error}") from None
    return label, Table(name, "", table)


class Table:
    """One table of a file: every key is asked for once, and what nobody asked for is a mistake."""

    def __init__(self, file: str, path: str, values: dict[str, Any]) -> None:
        self._file = file
        self._path = path
        self._values = dict(values)
        self._known: list[str] = []

    def take(self, key: str, expected: str, accept: Callable[[Any], Any], default: Any = ...) -> Any:
        """The value of ``key`` as ``accept`` makes it; it raises ValueError or TypeError for what is wrong."""
        self._known.append(key)
        if key not in self._values:
            if default is ...:
                raise self.wrong(key, f"is missing; expected {expected}")
            return default
        value = self._values.pop(key)
        try:
            return accept(value)
        except (TypeError, ValueError, KeyError):
            raise self.wrong(key, f"must be {expected}, not {value!r}") from None

    def wrong(self, key: str, what: str) -> WorldError:
        """What is to be raised for ``key``."""
        return WorldError(f"{self.where}{key} {what}")

    @property
    def where(self) -> str:
        """File and table, to be put before a key."""
        return f"{self._file}: {self._path}"

    def number(self, key: str, low: float, high: float, default: Any = ...) -> float:
        """A number in a range, both ends included."""
        return float(
            self.take(key, f"a number from {low:g} to {high:g}", lambda v: number_in(v, low, high), default)
        )

    def numbers(self, key: str, count: int | None, low: float, high: float, default: Any = ...) -> Any:
        """A list of so many numbers (None: at least one) in a range."""
        many = "a list of" if count is None else f"a list of {count}"
        expected = f"{many} numbers from {low:g} to {high:g}"

        def accept(value: Any) -> tuple[float, ...]:
            if not isinstance(value, list) or not value or (count is not None and len(value) != count):
                raise ValueError
            return tuple(number_in(item, low, high) for item in value)

        return self.take(key, expected, accept, default)

    def points(self, key: str, least: int, high: float) -> Any:
        """At least so many points [x, y], each number from 0 to ``high``."""

        def accept(value: Any) -> tuple[tuple[float, float], ...]:
            if not isinstance(value, list) or len(value) < least:
                raise ValueError
            return tuple((number_in(x, 0, high), number_in(y, 0, high)) for x, y in value)

        return self.take(key, f"a list of at least {least} points [x, y] from 0 to {high:g}", accept)

    def has(self, key: str) -> bool:
        """Whether the file gives this key."""
        return key in self._values

    def range(self, key: str, low: float, high: float, default: Any = ...) -> Any:
        """A number, or two of which the first is not greater."""

        def accept(value: Any) -> Range:
            if not isinstance(value, list):
                value = [value, value]
            first, last = (number_in(item, low, high) for item in value)
            if first > last:
                raise ValueError
            return first, last

        return self.take(key, f"a number or [least, most] from {low:g} to {high:g}", accept, default)

    def count(self, key: str, high: int, default: Any = ...) -> Any:
        """A range of whole numbers."""
        least, most = self.range(key, 0, high, default)
        if least != int(least) or most != int(most):
            raise self.wrong(key, f"must be whole numbers, not {[least, most]}")
        return int(least), int(most)

    def word(self, key: str, words: Sequence[str], default: Any = ...) -> str:
        """One of ``words``."""

        def accept(value: Any) -> str:
            if value not in words or not isinstance(value, str):
                raise ValueError
            return value

        return str(self.take(key, "one of " + ", ".join(words), accept, default))

    def flag(self, key: str, default: Any = ...) -> bool:
        """true or false."""

        def accept(value: Any) -> bool:
            if not isinstance(value, bool):
                raise TypeError
            return value

        return bool(self.take(key, "true or false", accept, default))

    def whole(self, key: str, low: int, high: int, default: Any = ...) -> Any:
        """A whole number."""

        def accept(value: Any) -> int:
            if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
                raise ValueError
            return value

        return self.take(key, f"a whole number from {low} to {high}", accept, default)

    def text(self, key: str, default: Any = ...) -> str:
        """One line of text."""

        def accept(value: Any) -> str:
            if not isinstance(value, str) or not value.strip() or "\n" in value:
                raise ValueError
            return value.strip()

        return str(self.take(key, "one line of text", accept, default))

    def table(self, key: str) -> Table | None:
        """A table of its own, if there is one."""

        def accept(value: Any) -> Table:
            if not isinstance(value, dict):
                raise TypeError
            return Table(self._file, f"{self._path}{key}.", value)

        table: Table | None = self.take(key, "a table", accept, None)
        return table

    def tables(self, key: str) -> list[Table]:
        """A list of tables."""

        def accept(value: Any) -> list[Table]:
            if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
                raise TypeError
            return [Table(self._file, f"{key}[{place}].", item) for place, item in enumerate(value)]

        found: list[Table] = self.take(key, f"tables, each written [[{key}]]", accept, [])
        return found

    def end(self) -> None:
        """Raises when something is left."""
        for key in self._values:
            raise self.wrong(key, f"is not known here; expected one of {', '.join(self._known)}")


def number_in(value: Any, low: float, high: float) -> float:
    """``value`` as a float; raises ValueError when it is no number of the range."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise ValueError
    return float(value)
