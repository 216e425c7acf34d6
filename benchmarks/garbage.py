"""A robot that is talked nonsense to: ``python -m benchmarks.garbage --lines 1000000``.

Random and mutated lines go to an emulated robot through its line, in lumps of any size. Nothing may raise, every
answer must be a line of printable characters, and after each batch the robot must still know its version.
"""

from __future__ import annotations

import argparse
import re
import time

import numpy as np

from khepera_hil.emulator import Emulator
from khepera_hil.rom import FITTINGS, MODELS
from khepera_hil.world import World

__all__ = ["Nonsense", "talk"]

_BATCH = 30
_VALID = [
    *("A,3800,800,100", "B", "C,1000,-1000", "D,10,-10", "E", "F,3000,20,4000", "G,-5,2147483647", "H", "I,3"),
    *("J,20,64,20,64", "K", "L,0,2", "N", "O", "P,99,-99", "R,32", "W,1,32", "T,1,E,200", "T,2,N", "T,2,U,1"),
    *("T,2,Q,8", "list", "memory", "net", "process", "k-team", "help", "help D", "restart", "sfill", "run demo"),
    *("S9030000FC", "run sloader", "serial 9600", "serial 115200", "flash E"),
]
_ENDS = (b"\n", b"\r", b"\r\n")
_ANSWER = re.compile(rb"([ -~]*\r\n)*\Z")


class Nonsense:
    """Lines without end: valid ones, valid ones with some bytes changed, lost, doubled or moved, and noise."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def line(self) -> bytes:
        """One more, with its end."""
        rng = self._rng
        kind = rng.random()
        if kind < 0.15:
            body = rng.bytes(int(rng.integers(0, 200 if kind < 0.01 else 20)))
        else:
            body = _VALID[rng.integers(len(_VALID))].encode()
            while kind > 0.3 and body:
                body = self._changed(body)
                kind *= rng.random()
        return body + _ENDS[rng.integers(3)]

    def _changed(self, body: bytes) -> bytes:
        rng = self._rng
        place = int(rng.integers(len(body)))
        other = b"0123456789,-- \tDTHNZz\x00\xff"
        byte = other[rng.integers(len(other))] if rng.random() < 0.8 else int(rng.integers(256))
        parts = {
            0: body[:place] + bytes((byte,)) + body[place + 1 :],
            1: body[:place] + bytes((byte,)) + body[place:],
            2: body[:place] + body[place + 1 :],
            3: body[:place] + body[place : place + 1] * 2 + body[place + 1 :],
            4: body[place:] + body[:place],
        }
        return parts[int(rng.integers(5))]

    def lumps(self, data: bytes) -> list[bytes]:
        """``data`` cut anywhere."""
        cuts = np.sort(self._rng.integers(0, len(data) + 1, self._rng.integers(0, 6)))
        return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


def talk(lines: int, seed: int, arena: str = "furnished") -> int:
    """Let a robot of each model take up so many lines; how many bytes it answered. Raises AssertionError."""
    answered = taken = 0

    def take(moment: float, line: bytes) -> None:
        nonlocal taken
        taken += 1

    for share, robot in enumerate(MODELS, 1):
        nonsense = Nonsense(seed)
        emulator = Emulator(
            World(arena, seed), 38400, host_follows=True, robot=robot, turrets=FITTINGS, on_request=take
        )
        now = 1.0
        emulator.transmitted(now)
        while taken < lines * share // len(MODELS):
            batch = b"".join(nonsense.line() for _ in range(_BATCH))
            told = b""
            for lump in nonsense.lumps(batch):
                emulator.receive(lump, now)
                now += 0.01
                told += emulator.transmitted(now)
            for last in (b"", b"\nend\n", b"B\n"):  # a restart takes what is behind it, a loader a line to leave
                emulator.receive(last, now)
                while emulator.talking:
                    now += 0.05
                    told += emulator.transmitted(now)
            assert _ANSWER.match(told), told[-300:]
            versions = ",".join(("b", *emulator.model.versions)).encode() + b"\r\n"
            assert told.endswith(versions), (batch, told[-300:])
            answered += len(told)
    return answered


def main() -> None:
    """Talk, count, print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.garbage")
    parser.add_argument("--lines", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    start = time.process_time()
    answered = talk(options.lines, options.seed)
    spent = time.process_time() - start
    print(f"{options.lines} lines taken up, {answered} bytes of answers, nothing raised; {spent:.0f} s")


if __name__ == "__main__":
    main()
