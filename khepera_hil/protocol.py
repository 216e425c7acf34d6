"""The Khepera's serial commands as one table, and both directions of both ends: values to bytes, bytes to values.

A request is a capital letter and its parameters, separated by commas, ended by CR or LF; the answer is the
same letter in lower case with its own parameters, ended by CR LF (Khepera User Manual 5.02, section 6.2 and
appendix A). Where the manuals are silent, what we do is said beside it.

No port, no time: the client's link and the emulator both look things up here, so neither end has a private
notion of the protocol. Every function raises :class:`~khepera_hil.errors.ProtocolError` and nothing else.
"""

from __future__ import annotations

import re

from khepera_hil.errors import ProtocolError
from khepera_hil.fields import PROTOCOL_ERROR, Command, Field, RequestRefused, in_range, read_answer, read_request
from khepera_hil.units import ENCODER_PULSES_PER_MM, MAX_SPEED, SPEED_UNIT_MM_S

__all__ = [
    "BAUD_RATES",
    "BITS_PER_CHARACTER",
    "COMMANDS",
    "COMMAND_NOT_FOUND",
    "ENCODER_PULSES_PER_MM",
    "LED_ABSENT",
    "LED_ACTION",
    "LONGEST_LINE",
    "MAX_SPEED",
    "PROTOCOL_ERROR",
    "SPEED_UNIT_MM_S",
    "Command",
    "Field",
    "RequestLines",
    "RequestRefused",
    "encode_answer",
    "encode_request",
    "is_refusal",
    "parse_answer",
    "parse_request",
    "wire_seconds",
]

BAUD_RATES = (9600, 19200, 38400, 57600, 115200)
"""The rates of the mode jumpers (section 3.1.3); the last two on a Khepera II only."""

BITS_PER_CHARACTER = 11
"""1 start, 8 data, 2 stop bits, no parity (section 3.1.3)."""

LONGEST_LINE = 128
"""Characters of a request that the robot takes in; the manual names none, its descendant's console has 128."""

# What the robot says when it does not understand. "Command not found" was seen from a real robot; the others
# come from simulators and descendants of its ROM: the manuals print none.
COMMAND_NOT_FOUND = b"Command not found\r\n"
LED_ABSENT = b"z,This LED does not exist.\r\n"
LED_ACTION = b"z,This LED action is not possible.\r\n"

_INT32 = 2**31


def _wheels(kind: str, low: int, high: int, unit: str) -> tuple[Field, Field]:
    """Left is always first (appendix A)."""
    return Field(f"left {kind}", low, high, unit), Field(f"right {kind}", low, high, unit)


# Clockwise from the left, the order of N and O (appendix A) and of the paper's Px1..Px8, L1..L8.
_PLACES = ("left 90", "left 45", "left 10", "right 10", "right 45", "right 90", "back right", "back left")
_GAINS = tuple(Field(name, 0, 32767) for name in ("Kp", "Ki", "Kd"))
_POSITION = 2**23 - 2
_STATUS = (Field("on target", 0, 1), Field("mode", 0, 2), Field("error", -_INT32, _INT32 - 1, "pulse"))

COMMANDS: dict[str, Command] = {
    command.letter: command
    for command in (
        Command("A", "configure the speed controller", _GAINS),
        Command("B", "read software version", form="versions"),
        Command("C", "set a position to be reached", _wheels("position", -_POSITION, _POSITION, "pulse")),
        Command("D", "set speed", _wheels("speed", -MAX_SPEED, MAX_SPEED, "pulse/10 ms")),
        # An instantaneous speed may pass the one asked for, hence the wider range.
        Command("E", "read speed", answer=_wheels("speed", -255, 255, "pulse/10 ms")),
        Command("F", "configure the position controller", _GAINS),
        Command("G", "set position counters", _wheels("counter", -_INT32, _INT32 - 1, "pulse")),
        Command("H", "read position counters", answer=_wheels("counter", -_INT32, _INT32 - 1, "pulse")),
        Command("I", "read an A/D input", (Field("channel", 0, 7),), (Field("value", 0, 1023, "4 mV"),)),
        Command(
            "J",
            "configure the speed profile",
            (
                Field("left max speed", 0, MAX_SPEED, "pulse/10 ms"),
                Field("left acceleration", 0, 32767, "pulse/256/(10 ms)^2"),
                Field("right max speed", 0, MAX_SPEED, "pulse/10 ms"),
                Field("right acceleration", 0, 32767, "pulse/256/(10 ms)^2"),
            ),
        ),
        Command("K", "read the motion controllers' status", answer=_STATUS + _STATUS),
        Command(
            "L",
            "change a LED",
            (Field("led", 0, 1, refusal=LED_ABSENT), Field("action", 0, 2, refusal=LED_ACTION)),
        ),
        Command("N", "read proximity sensors", answer=tuple(Field(p, 0, 1023) for p in _PLACES)),
        Command("O", "read ambient light sensors", answer=tuple(Field(p, 0, 1023) for p in _PLACES)),
        Command("P", "set PWM", _wheels("PWM", -255, 255, "1/255")),
        Command("R", "read a byte of the extension bus", (Field("address", 0, 63),), (Field("data", 0, 255),)),
        Command("T", "send a command to a turret", (Field("turret", 0, 31),), (Field("turret", 0, 31),), "turret"),
        Command("W", "write a byte of the extension bus", (Field("data", 0, 255), Field("address", 0, 63))),
    )
}

# A Khepera answers 5.02; what a Khepera II answers is printed nowhere, its boot text says "6.01 beta".
_VERSION = re.compile(r"[0-9]{1,2}\.[0-9]{1,2}( [a-z]{1,4})?\Z")
_TURRET_REQUEST = re.compile(r"[A-Z](,[!-+\--~]+)*\Z")  # a letter, then printable parameters
_TURRET_ANSWER = re.compile(r"[a-z](,[!-+\--~]+)*\Z")


def wire_seconds(characters: int, baud: int) -> float:
    """How long so many characters take on the line."""
    return characters * BITS_PER_CHARACTER / baud


def encode_request(letter: str, *values: int | str) -> bytes:
    """A request as the client sends it, ended by LF. Raises ProtocolError outside the table's ranges.

    For T the values are the turret's number and the turret's own command as one text (``"T", 2, "N"``).
    """
    command = _command(letter)
    if command.form == "turret":
        if len(values) != 2 or not isinstance(values[1], str) or not _TURRET_REQUEST.match(values[1]):
            raise ProtocolError("T takes a turret's number and that turret's command, such as 2 and 'N'")
        line = f"T,{in_range(letter, command.request, values[:1])[0]},{values[1]}\n".encode("ascii")
        if len(line) > LONGEST_LINE + 1:
            raise ProtocolError(f"the robot takes no line of more than {LONGEST_LINE} characters")
        return line
    return ",".join([letter, *map(str, in_range(letter, command.request, values))]).encode("ascii") + b"\n"


def parse_request(line: bytes) -> tuple[str, tuple[int | str, ...]] | None:
    """A request as the robot reads it: letter and values, or None for an empty line, which is silent.

    ``line`` comes without its terminator. Blanks around a command are ignored. Raises
    :class:`RequestRefused`, which carries the robot's reply.
    """
    if not line:
        return None
    if len(line) > LONGEST_LINE:
        raise RequestRefused(PROTOCOL_ERROR, f"a line of more than {LONGEST_LINE} characters")
    try:
        text = line.decode("ascii").strip(" \t")
    except UnicodeDecodeError:
        raise RequestRefused(COMMAND_NOT_FOUND, "bytes that are not ASCII") from None
    letter, *words = text.split(",")
    command = COMMANDS.get(letter)
    if command is None:
        raise RequestRefused(COMMAND_NOT_FOUND, f"no command is named {letter[:20]!r}")
    tail: tuple[str, ...] = ()
    if command.form == "turret":
        tail = (",".join(words[1:]),)
        words = words[:1]
        if not _TURRET_REQUEST.match(tail[0]):
            raise RequestRefused(PROTOCOL_ERROR, "T without a turret's command")
    values = read_request(letter, command.request, words)
    return letter, (*values, *tail)


def encode_answer(letter: str, *values: int | str) -> bytes:
    """An answer as the robot sends it, ended by CR LF. Raises ProtocolError outside the table's ranges.

    For B the values are two texts such as ``"5.01"``; for T the turret's number and its answer as one text
    (``"T", 2, "o,31"``).
    """
    command = _command(letter)
    if command.form == "numbers":
        words = [str(value) for value in in_range(letter, command.answer, values)]
    elif command.form == "versions":
        words = [value for value in values if isinstance(value, str) and _VERSION.match(value)]
        if len(words) != len(values) or len(words) != 2:
            raise ProtocolError("B answers two versions such as '5.01'")
    else:
        if len(values) != 2 or not isinstance(values[1], str) or not _TURRET_ANSWER.match(values[1]):
            raise ProtocolError("T answers the turret's number and what the turret says, such as 2 and 'o,31'")
        words = [str(*in_range(letter, command.answer, values[:1])), values[1]]
    return ",".join([letter.lower(), *words]).encode("ascii") + b"\r\n"


def parse_answer(letter: str, line: bytes) -> tuple[int | str, ...]:
    """The values of an answer to the request ``letter``; ``line`` is whole, CR LF included.

    Strict, since the protocol has no checksum: the right letter, the right number of values, plain decimal
    without padding, each in its range, nothing before or after.
    """
    command = _command(letter)
    if not line.endswith(b"\r\n"):
        raise ProtocolError(f"the answer to {letter} does not end with CR LF: {line[:60]!r}")
    try:
        head, *words = line[:-2].decode("ascii").split(",")
    except UnicodeDecodeError:
        raise ProtocolError(f"the answer to {letter} is not ASCII: {line[:60]!r}") from None
    if head != letter.lower():
        raise ProtocolError(f"asked {letter}, got {line[:60]!r}")
    if command.form == "versions":
        if len(words) != 2 or not all(map(_VERSION.match, words)):
            raise ProtocolError(f"B answers two versions, got {line[:60]!r}")
        return tuple(words)
    tail: tuple[str, ...] = ()
    if command.form == "turret":
        tail = (",".join(words[1:]),)
        words = words[:1]
        if not _TURRET_ANSWER.match(tail[0]):
            raise ProtocolError(f"T answers the turret's number and what it says, got {line[:60]!r}")
    values = read_answer(letter, command.answer, words, line[:60])
    return (*values, *tail)


def is_refusal(line: bytes) -> bool:
    """Whether the robot said that it did not understand."""
    return line.startswith(b"z,") or line == COMMAND_NOT_FOUND


class RequestLines:
    """The robot's line editor: bytes in, whole requests out, however the bytes were chopped.

    CR, LF or CR LF end a request (the second of CR LF ends an empty line, which is silent). Of a line that is
    too long, just enough is kept for :func:`parse_request` to refuse it, once.
    """

    def __init__(self) -> None:
        self._line = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """The lines that ``data`` completes, without their terminators."""
        lines: list[bytes] = []
        for byte in data:
            if byte in b"\r\n":
                lines.append(bytes(self._line))
                self._line.clear()
            elif len(self._line) <= LONGEST_LINE:
                self._line.append(byte)
        return lines


def _command(letter: str) -> Command:
    try:
        return COMMANDS[letter]
    except (KeyError, TypeError):
        raise ProtocolError(f"no command is named {letter!r}; there are {' '.join(COMMANDS)}") from None
