"""The turrets' own commands as tables, and both directions of both ends: what stands behind ``T,id,``.

A turret's command is again a capital letter and its parameters; its answer comes behind ``t,id,`` and begins with
the small letter. No turret's manual was found: numbers, commands and answers are those of programs that drove real
turrets (sources in the docstrings of each table), and what they leave open is decided here.

Like :mod:`khepera_hil.protocol`, which carries these texts, a leaf without port or time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from khepera_hil.errors import ProtocolError
from khepera_hil.fields import Command, Field, RequestRefused, in_range, read_answer, read_request

__all__ = [
    "CAMERA",
    "GRIPPER",
    "PIXELS",
    "SCAN_PERIODS",
    "TURRETS",
    "TURRET_ABSENT",
    "Turret",
    "encode_turret_answer",
    "encode_turret_request",
    "longest_turret_answer",
    "parse_turret_answer",
    "parse_turret_request",
]

TURRET_ABSENT = b"z,Turret order not supported\r\n"
"""What the robot says for a turret that is not fitted, or that has no such command (KiKS)."""

PIXELS = 64
"""Of the K213's line, over 36 degrees; the first is at the left edge."""

SCAN_PERIODS = (0.0, 0.05, 0.1, 0.15, 0.25, 0.5, 1.0, 5.0)
"""Seconds that the K213 holds a frame, by the code of its command U; 0: it chooses itself, by the light."""


@dataclass(frozen=True)
class Turret:
    """A turret with a processor of its own: its number on the local network, and what ``net`` tells of it."""

    number: int
    name: str
    title: str
    commands: Mapping[str, Command]


def _turret(number: int, name: str, title: str, *commands: Command) -> Turret:
    return Turret(number, name, title, {command.letter: command for command in commands})


_VERSION = (Field("version", 0, 255), Field("revision", 0, 255))
_BYTE = (0, 255)


def _bytes(name: str, count: int) -> tuple[Field, ...]:
    return tuple(Field(f"{name} {place}", *_BYTE) for place in range(count))


GRIPPER = _turret(
    1,
    "gripper",
    "Gripper",
    Command("B", "read the gripper's software version", answer=_VERSION),
    Command("D", "open (0) or close (1) the gripper", (Field("action", 0, 1),)),
    Command("E", "move the arm; 255 is down before the robot, lower is higher", (Field("position", *_BYTE),)),
    Command("F", "read the resistivity of what the gripper holds", answer=(Field("resistivity", *_BYTE),)),
    Command("G", "read the optical barrier between the fingers", answer=(Field("barrier", *_BYTE),)),
    Command("H", "read the position of gripper (0) or arm (1)", (Field("which", 0, 1),), (Field("place", *_BYTE),)),
    Command("J", "read the jumpers", answer=(Field("jumpers", *_BYTE),)),
)
"""Numbers as KheperaInterface, K-Team's MATLAB toolbox and P. Stoehr's tools use them."""

CAMERA = _turret(
    2,
    "k213",
    "K213 linear vision",
    Command("B", "read the camera's software version", answer=_VERSION),
    Command("N", "read all pixels", answer=_bytes("pixel", PIXELS)),
    Command("M", "read all pixels, two of four bits in a byte, the even one high", answer=_bytes("pair", 32)),
    Command("S", "read every second pixel", answer=_bytes("pixel", 32)),
    Command("T", "read every fourth pixel", answer=_bytes("pixel", 16)),
    Command("Q", "read 8 pixels", (Field("first pixel", 0, PIXELS - 8),), _bytes("pixel", 8)),
    Command("R", "read 16 pixels", (Field("first pixel", 0, PIXELS - 16),), _bytes("pixel", 16)),
    Command("O", "read which pixel is brightest", answer=(Field("pixel", 0, PIXELS - 1),)),
    Command("P", "read which pixel is darkest", answer=(Field("pixel", 0, PIXELS - 1),)),
    Command("L", "read the light's intensity, high byte and low byte", answer=_bytes("byte", 2)),
    Command("U", "set how long a frame is held", (Field("code", 0, len(SCAN_PERIODS) - 1),)),
)
"""Commands as in KiKS and P. Stoehr's tools. O and P count from 0 (Stoehr; KiKS counts from 1), since pixel 0 is
the left edge for Q and R too; of several equal pixels the leftmost is told."""

TURRETS: dict[int, Turret] = {turret.number: turret for turret in (GRIPPER, CAMERA)}


def encode_turret_request(turret: int, letter: str, *values: int) -> str:
    """A turret's command as T's last value (``("T", 2, encode_turret_request(2, "Q", 8))``).

    Raises ProtocolError for a turret or a command that there is not, and outside the ranges.
    """
    return _text(letter, in_range(letter, _command(turret, letter).request, values))


def parse_turret_request(turret: int, text: str) -> tuple[str, list[int]]:
    """A turret's command as the turret reads it: letter and values. Raises RequestRefused."""
    letter, *words = text.split(",")
    command = TURRETS[turret].commands.get(letter)
    if command is None:
        raise RequestRefused(TURRET_ABSENT, f"the {TURRETS[turret].name} has no command {letter[:20]!r}")
    return letter, read_request(letter, command.request, words)


def encode_turret_answer(turret: int, letter: str, *values: int) -> str:
    """What a turret answers, as T's last value. Raises ProtocolError as :func:`encode_turret_request`."""
    return _text(letter.lower(), in_range(letter, _command(turret, letter).answer, values))


def parse_turret_answer(turret: int, letter: str, text: str) -> tuple[int, ...]:
    """The values of a turret's answer to ``letter``, strictly. Raises ProtocolError."""
    command = _command(turret, letter)
    head, *words = text.split(",")
    if head != letter.lower():
        raise ProtocolError(f"asked the {TURRETS[turret].name} for {letter}, got {text[:60]!r}")
    return tuple(read_answer(letter, command.answer, words, text[:60]))


def longest_turret_answer(turret: int, text: str) -> int | None:
    """Characters of the longest answer to ``T,turret,text``, CR LF included; None for a command nobody knows."""
    try:
        return len(f"t,{turret},") + _command(turret, text[:1]).longest_answer
    except ProtocolError:
        return None


def _command(turret: int, letter: str) -> Command:
    try:
        return TURRETS[turret].commands[letter]
    except (KeyError, TypeError):
        raise ProtocolError(f"no turret {turret!r} has a command {letter!r}") from None


def _text(letter: str, values: list[int]) -> str:
    return ",".join([letter, *map(str, values)])
