"""What several robots in one arena cost: ``python -m benchmarks.robots``.

For each number of robots, milliseconds of one core for a second of their time: the world stepped, and each robot
asked N, O and D ten times a second over the bytes of its own line, while all wander about. It is what ``khepera-hil
emulate --robots`` takes of a core at the wall's pace, but for the operating system's part.
"""

from __future__ import annotations

import argparse
import json
import time

from khepera_hil.emulator import Company, Emulator
from khepera_hil.uart import FIFO_16550
from khepera_hil.world import World
from khepera_hil.world.arena import Arena

_PERIOD = 0.1
_BAUD = 38400
_FLOOR = 700.0
"""mm of a side of the floor for each robot's square root: all have as much room, however many they are."""


def company(robots: int, seconds: float, seed: int) -> float:
    """Milliseconds of a core for a second of ``robots`` robots."""
    side = _FLOOR * robots**0.5
    world = World(Arena("floor", "", size=(side, side)), seed, robots=robots)
    emulators = [Emulator(world, _BAUD, fifo=FIFO_16550, number=number) for number in range(1, robots + 1)]
    if robots > 1:
        Company(emulators)
    start = time.process_time()
    for tick in range(round(seconds / _PERIOD)):
        now = _PERIOD * tick
        for emulator in emulators:
            heard = emulator.transmitted(now)
            near = max((int(word) for word in _answer(heard)[1:7]), default=0)
            emulator.receive(b"D,8,-8\nN\nO\n" if near > 200 else b"D,4,4\nN\nO\n", now)
    return 1e3 * (time.process_time() - start) / seconds


def _answer(heard: bytes) -> list[bytes]:
    return next((line.split(b",") for line in heard.splitlines() if line.startswith(b"n,")), [])


def main() -> None:
    """Print the figures, one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--repeat", type=int, default=3)
    asked = parser.parse_args()
    found = {}
    for robots in (1, 2, 3, 4, 8, 16, 32):
        costs = sorted(company(robots, asked.seconds, seed) for seed in range(1, asked.repeat + 1))
        middle = costs[len(costs) // 2]
        found[robots] = {"ms": round(middle, 2), "from": round(costs[0], 2), "to": round(costs[-1], 2)}
        print(
            f"{robots:3} robots: {middle:7.1f} ms of a core a second ({costs[0]:.1f} to {costs[-1]:.1f})",
            flush=True,
        )
    print(json.dumps({"ms_a_second": found, "seconds": asked.seconds, "repeat": asked.repeat}))


if __name__ == "__main__":
    main()
