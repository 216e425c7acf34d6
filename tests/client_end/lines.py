"""Ports for the tests: bytes that come at a time of a simulated clock, by a script or from a faulty robot."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np

from khepera_hil.clock import SimulatedClock
from khepera_hil.protocol import RequestLines, RequestRefused, encode_answer, parse_request, wire_seconds

BAUD = 38400
CHARACTER = wire_seconds(1, BAUD)

BOOT_TEXT = (
    b"\r\nROM of minirobot KHEPERA, Edoardo Franzi K-Team S.A. October 22, 1998 Rev. 5.01\r\n"
    b"Serial Communication Protocol\r\n"
)


class SimulatedPort:
    """A port whose ``read`` moves the clock; bytes come in the order in which they were sent, as on a wire."""

    port = "/dev/scripted"

    def __init__(self, clock: SimulatedClock) -> None:
        self.clock = clock
        self.timeout: float | None = None
        self.written = bytearray()
        self.open = True
        self._coming: deque[tuple[float, int]] = deque()

    @property
    def in_waiting(self) -> int:
        now = self.clock.now()
        return sum(1 for _ in takewhile(lambda byte: byte[0] <= now, self._coming))

    def read(self, size: int = 1, /) -> bytes:
        assert self.timeout is not None, "a read without a deadline"
        give_up = self.clock.now() + self.timeout
        data = bytearray()
        while len(data) < size:
            if not self._coming or self._coming[0][0] > give_up:
                self.clock.sleep_until(give_up)
                break
            moment, byte = self._coming.popleft()
            self.clock.sleep_until(moment)
            data.append(byte)
        return bytes(data)

    def write(self, data: bytes, /) -> int:
        self.written += data
        self.respond(data)
        return len(data)

    def close(self) -> None:
        self.open = False

    def respond(self, data: bytes) -> None:
        """What the other end does with what it is sent."""

    def come(self, data: bytes, after: float = 0.0, each: float = CHARACTER) -> None:
        """Let bytes come, ``each`` seconds apart, ``after`` seconds from now but never before older ones."""
        moment = self.clock.now() + after
        for byte in data:
            moment = max(moment, self._coming[-1][0] if self._coming else 0.0) + each
            self._coming.append((moment, byte))


@dataclass
class Turn:
    """What the client must send next, to the last byte, and what comes for it."""

    sent: bytes
    answer: bytes = b""
    after: float = 0.001
    each: float = CHARACTER


class ScriptedPort(SimulatedPort):
    """A line that knows one conversation."""

    def __init__(self, clock: SimulatedClock, *script: Turn) -> None:
        super().__init__(clock)
        self._script = deque(script)
        self._pending = b""

    def respond(self, data: bytes) -> None:
        self._pending += data
        while self._pending:
            assert self._script, f"{self._pending!r} was sent after the end of the script"
            turn = self._script[0]
            assert turn.sent.startswith(self._pending[: len(turn.sent)]), f"{self._pending!r}, not {turn.sent!r}"
            if len(self._pending) < len(turn.sent):
                return
            self._pending = self._pending[len(turn.sent) :]
            self._script.popleft()
            self.come(turn.answer, turn.after, turn.each)

    @property
    def finished(self) -> bool:
        return not self._script and not self._pending


SYNCHRONISED = (Turn(b"\n"), Turn(b"B\n", b"b,5.01,5.00\r\n"))
"""How every conversation begins."""


@dataclass
class FaultyRobot(SimulatedPort):
    """A robot that counts its readings and tells the count, on a line with structural faults.

    Every fault but byte changes inside a number: lines lost, cut, doubled, late (and all after them later
    still), CR or LF lost, boot text in mid-session; requests lost, cut or doubled.
    """

    clock: SimulatedClock
    rng: np.random.Generator
    rate: float
    readings: dict[str, int] = field(default_factory=lambda: {"N": 0, "O": 0})
    faults: int = 0

    def __post_init__(self) -> None:
        super().__init__(self.clock)
        self._editor = RequestLines()

    def respond(self, data: bytes) -> None:
        if self.rng.random() < self.rate / 3:
            self.faults += 1
            data = (b"", data[:-1], data + data)[self.rng.integers(3)]
        for line in self._editor.feed(data):
            if line:
                self._transmit(self._answer(line))

    def _answer(self, line: bytes) -> bytes:
        try:
            request = parse_request(line)
        except RequestRefused as refused:
            return refused.reply
        assert request is not None
        letter, _ = request
        if letter in self.readings:
            self.readings[letter] += 1
            count = self.readings[letter]
            high, low = divmod(count, 1000)
            return encode_answer(letter, high, low, *[7] * 6)
        if letter == "B":
            return encode_answer("B", "5.01", "5.00")
        return encode_answer(letter, *[0] * {"K": 6, "E": 2, "D": 0}[letter])

    def _transmit(self, answer: bytes) -> None:
        after = 0.001
        if self.rng.random() < self.rate:
            self.faults += 1
            fault = self.rng.integers(8)
            if fault == 0:
                answer = b""
            elif fault == 1:
                answer = answer[: self.rng.integers(len(answer))]
            elif fault == 2:
                answer = answer + answer
            elif fault == 3:
                after = float(self.rng.uniform(0.01, 0.25))
            elif fault == 4:
                answer = answer.replace(b"\n", b"")
            elif fault == 5:
                answer = answer.replace(b"\r", b"")
            elif fault == 6:
                answer = BOOT_TEXT + answer
            else:
                answer = answer + BOOT_TEXT
        self.come(answer, after)
