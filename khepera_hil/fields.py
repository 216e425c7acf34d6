"""What both the robot's commands and its turrets' are made of: integers in ranges, read and written strictly.

A leaf of :mod:`khepera_hil.protocol` and :mod:`khepera_hil.turrets`; the functions are for those two.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from khepera_hil.errors import ProtocolError

__all__ = ["PROTOCOL_ERROR", "Command", "Field", "RequestRefused", "in_range", "read_answer", "read_request"]

PROTOCOL_ERROR = b"z,Protocol error\r\n"
"""What the robot says to a command that it knows with parameters that it does not take."""

_REQUEST_NUMBER = re.compile(r"-?[0-9]{1,12}\Z")
_ANSWER_NUMBER = re.compile(r"(0|-?[1-9][0-9]{0,10})\Z")  # no plus, no padding, no minus zero


class RequestRefused(ProtocolError):
    """What the robot's end cannot take; ``reply`` is what it answers."""

    def __init__(self, reply: bytes, why: str) -> None:
        super().__init__(why)
        self.reply = reply


@dataclass(frozen=True)
class Field:
    """One integer parameter: its name, its range (both ends included), its unit, and who complains about it."""

    name: str
    low: int
    high: int
    unit: str = ""
    refusal: bytes = PROTOCOL_ERROR

    @property
    def widest(self) -> int:
        """Characters of the longest number in the range."""
        return max(len(str(self.low)), len(str(self.high)))


@dataclass(frozen=True)
class Command:
    """One line of the manual's appendix A, or of a turret's own list.

    ``form`` is ``"numbers"``, or the one way in which a command departs from lists of integers: ``"versions"``
    (B answers two texts such as 5.01) or ``"turret"`` (T's parameters belong to the turret).
    """

    letter: str
    title: str
    request: tuple[Field, ...] = ()
    answer: tuple[Field, ...] = ()
    form: str = "numbers"

    @cached_property
    def longest_answer(self) -> int:
        """Characters of the longest answer, CR LF included: what a deadline must allow for."""
        if self.form == "versions":
            return 1 + 2 * len(",99.99 beta") + 2
        if self.form == "turret":
            return 1 + len(",31,n") + 64 * len(",255") + 2  # the longest known: 64 pixels of the K213
        return 1 + sum(1 + field.widest for field in self.answer) + 2

    @cached_property
    def longest_request(self) -> int:
        """Characters of the longest request, its terminator included."""
        if self.form == "turret":
            return len("T,31,E,255\n")  # the longest that a known turret takes; its grammar would allow 128
        return 1 + sum(1 + field.widest for field in self.request) + 1


def in_range(letter: str, fields: tuple[Field, ...], values: Sequence[object]) -> list[int]:
    """``values`` as the integers that they are. Raises ProtocolError for another number or another kind of them."""
    if len(values) != len(fields):
        raise ProtocolError(f"{letter} takes {len(fields)} values, not {len(values)}")
    numbers: list[int] = []
    for value, field in zip(values, fields, strict=True):
        if isinstance(value, bool):
            raise ProtocolError(f"{letter}'s {field.name} must be an integer, not {value!r}")
        try:
            number = operator.index(value)  # type: ignore[arg-type]  # a text ends in the TypeError
        except TypeError:
            raise ProtocolError(f"{letter}'s {field.name} must be an integer, not {value!r}") from None
        if not field.low <= number <= field.high:
            raise ProtocolError(f"{letter}'s {field.name} is {number}, outside {field.low}..{field.high}")
        numbers.append(number)
    return numbers


def read_request(letter: str, fields: tuple[Field, ...], words: Sequence[str]) -> list[int]:
    """Parameters as the robot reads them. Raises RequestRefused."""
    if len(words) != len(fields):
        raise RequestRefused(PROTOCOL_ERROR, f"{letter} takes {len(fields)} parameters, not {len(words)}")
    values: list[int] = []
    for word, field in zip(words, fields, strict=True):
        if not _REQUEST_NUMBER.match(word):
            raise RequestRefused(PROTOCOL_ERROR, f"{letter}'s {field.name} is no integer")
        value = int(word)
        if not field.low <= value <= field.high:
            raise RequestRefused(
                field.refusal, f"{letter}'s {field.name} is {value}, outside {field.low}..{field.high}"
            )
        values.append(value)
    return values


def read_answer(letter: str, fields: tuple[Field, ...], words: Sequence[str], whole: object) -> list[int]:
    """Values as the client reads them: plain decimal without padding; ``whole`` is what is shown in a complaint.

    Raises ProtocolError.
    """
    if len(words) != len(fields):
        raise ProtocolError(f"{letter} answers {len(fields)} values, got {len(words)}: {whole!r}")
    values: list[int] = []
    for word, field in zip(words, fields, strict=True):
        if not _ANSWER_NUMBER.match(word):
            raise ProtocolError(f"{letter}'s {field.name} is no plain integer: {whole!r}")
        value = int(word)
        if not field.low <= value <= field.high:
            raise ProtocolError(f"{letter}'s {field.name} is {value}, outside {field.low}..{field.high}")
        values.append(value)
    return values
