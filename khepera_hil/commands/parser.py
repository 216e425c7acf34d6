"""What the commands' arguments have in common: every mistake is one sentence, and numbers have ranges."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from math import isfinite
from typing import NoReturn, Protocol

from khepera_hil.errors import UsageError

__all__ = ["Command", "Parser", "baud", "existing_name", "number", "seed"]


class Command(Protocol):
    """What a command's module offers."""

    def main(self, arguments: Sequence[str]) -> int:
        """Do it; the exit code."""


class Parser(argparse.ArgumentParser):
    """argparse, but a mistake is a UsageError of one sentence and no word may be shortened."""

    def __init__(self, prog: str, description: str, epilog: str = "") -> None:
        super().__init__(
            prog,
            description=description,
            epilog=epilog,
            allow_abbrev=False,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )

    def error(self, message: str) -> NoReturn:
        """Raise instead of printing the usage."""
        raise UsageError(f"{message} (see {self.prog} --help)")


def number(low: float, high: float, unit: str) -> Callable[[str], float]:
    """A type for argparse: a finite number in a range, both ends included."""

    def convert(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not isfinite(value) or not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is no number of {unit} from {low:g} to {high:g}")
        return value

    return convert


def seed(text: str) -> int:
    """A type for argparse: a seed."""
    if not text.isascii() or not text.isdigit() or len(text) > 20:
        raise argparse.ArgumentTypeError(f"{text!r} is no seed: a whole number, 0 or more, of at most 20 digits")
    return int(text)


def baud(text: str) -> int:
    """A type for argparse: a rate of the line."""
    if not text.isascii() or not text.isdigit() or not 300 <= int(text) <= 921600:
        raise argparse.ArgumentTypeError(f"{text!r} is no baud rate; a Khepera speaks at 9600, 19200 or 38400")
    return int(text)


def existing_name(kind: str, name: str, names: Sequence[str]) -> str:
    """``name`` if there is one; a sentence that lists what there is otherwise."""
    if name not in names:
        raise UsageError(f"there is no {kind} {name!r}; there are {', '.join(sorted(names))}")
    return name
