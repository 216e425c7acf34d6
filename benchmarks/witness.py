"""Witnesses of what a robot really said, for judging what a client believes of a faulty line.

:class:`CountingRobot` makes each reading unmistakable: its answers carry the number of the request that they
answer, so that an old one is known as old whatever the scene. :func:`overhear` listens at the other end of a faulty
line to what any emulated robot sends, before the faults.
"""

from __future__ import annotations

import errno
from collections.abc import Callable

import serial

from khepera_hil.clock import SimulatedClock
from khepera_hil.faults import Faults
from khepera_hil.protocol import RequestLines, RequestRefused, encode_answer, parse_answer, parse_request
from khepera_hil.uart import Line

__all__ = ["CountingRobot", "overhear"]

_REST = (7,) * 6


class CountingRobot:
    """A robot that counts, at the far end of a line with faults, as a port on a simulated clock.

    N and O answer the number of times that this was asked, in two values, and six sevens.
    """

    def __init__(self, clock: SimulatedClock, faults: Faults, baud: int = 38400, turn: float = 0.003) -> None:
        self.clock, self.faults, self.baud = clock, faults, baud
        self.port = "counting://robot"
        self.timeout: float | None = None
        self.counts = {"N": 0, "O": 0}
        self.speeds = (0, 0)
        self._turn = turn  # seconds that the robot thinks
        self._to_robot, self._to_host = Line(baud, baud), Line(baud, baud)
        self._editor = RequestLines()
        self._input = bytearray()
        self._unpluggings = 0

    def open(self) -> None:
        """Plug the line in again. Raises SerialException while it is unplugged."""
        if not self.faults.connected(self.clock.now()):
            raise serial.SerialException(errno.ENOENT, "unplugged")
        self._unpluggings = self.faults.unpluggings
        self._to_host.arrived(float("inf"))
        self._input.clear()

    @property
    def in_waiting(self) -> int:
        """Bytes that a read would give at once."""
        self._pump()
        return len(self._input)

    def read(self, size: int = 1, /) -> bytes:
        """``size`` bytes, or what came within ``timeout`` seconds."""
        assert self.timeout is not None
        deadline = self.clock.now() + self.timeout
        self._pump()
        while len(self._input) < size and self.clock.now() < deadline:
            self.clock.sleep_until(min(deadline, self._next_event()))
            self._pump()
        data = bytes(self._input[:size])
        del self._input[:size]
        return data

    def write(self, data: bytes, /) -> int:
        """Hand bytes to the line."""
        self._pump()
        now = self.clock.now()
        self._to_robot.send(self.faults.to_robot(data, now), now)
        return len(data)

    def close(self) -> None:
        """The robot stays where it is."""

    @staticmethod
    def number(values: tuple[int, ...]) -> int | None:
        """The number of the request that these readings answer; None where no robot said them."""
        high, low, *rest = values
        return 1000 * high + low if tuple(rest) == _REST and low < 1000 else None

    def _pump(self) -> None:
        now = self.clock.now()
        if not self.faults.connected(now) or self.faults.unpluggings != self._unpluggings:
            raise serial.SerialException(errno.EIO, "unplugged")
        if held_back := self.faults.to_robot(b"", now):
            self._to_robot.send(held_back, now)
        for moment, byte in self._to_robot.arrived(now):
            for line in self._editor.feed(bytes((byte,))):
                if line:
                    self._to_host.send(self._answer(line), max(moment, self._to_host.free) + self._turn)
        come = bytes(byte for _, byte in self._to_host.arrived(now))
        self._input += self.faults.to_host(come, now)

    def _next_event(self) -> float:
        moments = (self._to_robot.next_arrival(), self._to_host.next_arrival(), self.faults.next_event())
        return min((moment for moment in moments if moment is not None), default=float("inf"))

    def _answer(self, line: bytes) -> bytes:
        try:
            request = parse_request(line)
        except RequestRefused as refused:
            return refused.reply
        if request is None:
            return b""
        letter, values = request
        if letter in self.counts:
            self.counts[letter] += 1
            return encode_answer(letter, *divmod(self.counts[letter], 1000), *_REST)
        if letter == "D":
            self.speeds = int(values[0]), int(values[1])
        answers: dict[str, tuple[int | str, ...]] = {
            "B": ("5.01", "5.00"),
            "D": (),
            "E": self.speeds,
            "K": (1, 0, 0, 1, 0, 0),
        }
        return encode_answer(letter, *answers[letter]) if letter in answers else b"Command not found\r\n"


def overhear(faults: Faults, hear: Callable[[str, tuple[int | str, ...]], None]) -> None:
    """Call ``hear`` with each whole answer to N and O that the robot sends into these faults."""
    through = faults.to_host
    held = bytearray()

    def to_host(data: bytes, now: float) -> bytes:
        held.extend(data)
        while (end := held.find(b"\n")) >= 0:
            line = bytes(held[: end + 1])
            del held[: end + 1]
            if line[:2] in (b"n,", b"o,"):
                letter = chr(line[0]).upper()
                hear(letter, parse_answer(letter, line))
        return through(data, now)

    faults.to_host = to_host  # type: ignore[method-assign]  # to listen is what this is for
