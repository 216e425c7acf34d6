"""A serial line as its two ends see it: when each byte arrives, and what arrives when their rates differ.

A leaf without I/O and without a clock of its own: times are seconds and come in as arguments.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from itertools import accumulate, repeat

from khepera_hil.protocol import BITS_PER_CHARACTER

__all__ = ["FIFO_16550", "Fifo", "Line", "resample"]

FIFO_16550 = 14
"""Characters at which the host's usual UART calls its driver (16550, highest trigger level)."""

_QUIET_CHARACTERS = 4
"""Character times without a new one after which a 16550 calls its driver for what it holds."""

_SAMPLE = 9 / 16
"""Where in a bit it is read: on the tick after its middle, of the sixteen that a UART cuts a bit into. It never
falls on an edge of a sender at another of the usual rates."""

_ROUNDING = 1e-9
"""Seconds by which moments that were reckoned in two ways may differ."""

_STOP = 9
"""Bits before the stop bits: 1 start, 8 data."""


class Line:
    """One direction of the cable: bytes leave one after the other, 11 bit times each, and arrive.

    ``sender`` and ``receiver`` are the baud rates of the two ends and may be changed at any time; what was
    sent before keeps its own rate. Where they differ, the receiver samples the sender's waveform at its own
    pace, so bytes are garbled, split or swallowed as on a real line, and the same way every time.
    """

    def __init__(self, sender: int, receiver: int) -> None:
        self.sender = sender
        self.receiver = receiver
        self.free = 0.0
        """When the last bit that was sent will have left."""
        self._ready: deque[tuple[float, int]] = deque()
        # The waveform that a receiver of another rate has still to sample: start and byte and bit time.
        self._frames: deque[tuple[float, int, float]] = deque()
        self._deaf_until = 0.0

    @property
    def pending(self) -> bool:
        """Whether anything is on the line, or has arrived and was not taken out."""
        return bool(self._ready or self._frames)

    def send(self, data: bytes, now: float) -> None:
        """Put ``data`` on the line behind what is already there."""
        start = max(now, self.free)
        character = BITS_PER_CHARACTER / self.sender
        if self.sender == self.receiver and not self._frames and self._deaf_until <= start:
            arrivals = accumulate(repeat(character, len(data)), initial=start)
            next(arrivals)
            self._ready.extend(zip(arrivals, data, strict=True))
            start = self._ready[-1][0] if data else start
        else:
            for byte in data:
                self._frames.append((start, byte, 1 / self.sender))
                start += character
        self.free = start

    def listen(self, receiver: int, moment: float) -> None:
        """From ``moment`` on the receiver takes what is on the line at another rate; until then at its old one."""
        if self._frames:
            self._sample(moment)
        bit = 1 / self.receiver  # the sender's too, of what was to arrive without sampling
        edge = moment + _ROUNDING
        late = [(arrival, byte) for arrival, byte in self._ready if arrival > edge]
        if late:
            self._ready = deque(entry for entry in self._ready if entry[0] <= edge)
            self._frames.extendleft(
                (arrival - BITS_PER_CHARACTER * bit, byte, bit) for arrival, byte in reversed(late)
            )
            self._deaf_until = max(self._deaf_until, moment - _ROUNDING)
        self.receiver = receiver

    def arrived(self, now: float, until: bytes = b"") -> list[tuple[float, int]]:
        """Take out each byte whose stop bits are over by ``now``, with the moment when they were.

        With ``until``, not more than up to the first of these bytes.
        """
        if self._frames:
            self._sample(now)
        ready = self._ready
        if not until and ready and ready[-1][0] <= now:
            taken = list(ready)
            ready.clear()
            return taken
        taken = []
        while ready and ready[0][0] <= now:
            entry = ready.popleft()
            taken.append(entry)
            if entry[1] in until:
                break
        return taken

    def certain(self, now: float, before: float = math.inf) -> list[tuple[float, int]]:
        """Take out each byte that nothing can change any more, also those that arrive later than ``now``.

        ``before``: a moment at which the sender may be cut off, so that nothing later is certain.
        """
        return self.arrived(now if self._frames else before)

    def clear(self, now: float) -> None:
        """Forget what has not left yet; a character that is half out goes with it."""
        self._ready = deque(entry for entry in self._ready if entry[0] <= now)
        self._frames = deque(
            (start, byte, bit)
            for start, byte, bit in self._frames
            if start + BITS_PER_CHARACTER * bit <= now + _ROUNDING
        )
        self.free = min(self.free, now)

    def next_arrival(self, wanted: bytes | None = None) -> float | None:
        """A moment not after the next byte's arrival (None: nothing is under way).

        With ``wanted``, bytes that are none of these may be passed over.
        """
        for moment, byte in self._ready:
            if wanted is None or byte in wanted:
                return moment
        if self._frames:
            # Nothing can come out before one whole character of the receiver's has passed.
            edge = self._next_edge()
            return edge + BITS_PER_CHARACTER / self.receiver if edge is not None else None
        return None

    def _sample(self, now: float) -> None:
        bit = 1 / self.receiver
        while (edge := self._next_edge()) is not None and edge + BITS_PER_CHARACTER * bit <= now:
            if self._level(edge + _SAMPLE * bit):  # a glitch: shorter than half of the receiver's start bit
                self._deaf_until = edge + _SAMPLE * bit
                continue
            byte = sum(self._level(edge + (1 + _SAMPLE + place) * bit) << place for place in range(8))
            self._ready.append((edge + BITS_PER_CHARACTER * bit, byte))
            # A stop bit that reads low is a framing error: drivers hand the byte over all the same, and the
            # receiver waits for the next falling edge.
            self._deaf_until = edge + (_STOP + _SAMPLE) * bit

    def _next_edge(self) -> float | None:
        """When the line next falls for a receiver that listens again; drops the waveform before."""
        while self._frames:
            start, byte, bit = self._frames[0]
            before = 1
            for place in range(_STOP):
                level = 0 if place == 0 else byte >> (place - 1) & 1
                if before and not level and start + place * bit >= self._deaf_until:
                    return start + place * bit
                before = level
            self._frames.popleft()
        return None

    def _level(self, moment: float) -> int:
        for start, byte, bit in self._frames:
            place = int((moment - start) / bit)
            if moment < start:
                break
            if place < _STOP:
                return 0 if place == 0 else byte >> (place - 1) & 1
        return 1


def resample(data: bytes, sent_at: int, read_at: int) -> bytes:
    """What an end that is set to ``read_at`` baud takes in when ``data`` comes back to back at ``sent_at``."""
    line = Line(sent_at, read_at)
    line.send(data, 0.0)
    end = line.free + BITS_PER_CHARACTER / read_at
    return bytes(byte for _, byte in line.arrived(end))


class Fifo:
    """The host's UART between the line and its driver: bytes show in lumps.

    A lump is handed over when it has ``size`` bytes, or when no byte has come for four character times.
    ``size`` 1 hands each byte over at once.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._lumps: deque[tuple[float, bytes]] = deque()
        self._held = bytearray()
        self._due = 0.0

    def put(self, entries: Iterable[tuple[float, int]], baud: int) -> None:
        """Bytes with the moments at which they arrived, or certainly will; they come in their order."""
        held, size, rest = self._held, self.size, _QUIET_CHARACTERS * BITS_PER_CHARACTER / baud
        for moment, byte in entries:
            if held and moment >= self._due:
                self._hand_over(self._due)
            held.append(byte)
            if len(held) >= size:
                self._hand_over(moment)
            else:
                self._due = moment + rest

    def shown(self, now: float) -> bytes:
        """Take out what the driver has been handed by ``now``."""
        if self._held and self._due <= now:
            self._hand_over(self._due)
        if not self._lumps or self._lumps[0][0] > now:
            return b""
        shown = bytearray()
        while self._lumps and self._lumps[0][0] <= now:
            shown += self._lumps.popleft()[1]
        return bytes(shown)

    def next_show(self) -> float | None:
        """When the next lump is handed over, as far as is known."""
        if self._lumps:
            return self._lumps[0][0]
        return self._due if self._held else None

    def _hand_over(self, moment: float) -> None:
        self._lumps.append((moment, bytes(self._held)))
        self._held.clear()
