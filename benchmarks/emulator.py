"""How fast the emulated robot is, and how near to the measured one: ``python -m benchmarks.emulator``.

``physics_x_realtime``: simulated seconds for each second of one core, the world stepped and both kinds of
sensors read at 10 Hz while the robot wanders through the furnished arena. ``port_x_realtime``: the same with
N, O and D asked through the in-process port at 38400 baud. ``proximity_rms`` and ``light_rms`` are counts of
1023 and of 511, against the tables in ``benchmarks.measured``.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import serial

from benchmarks.measured import light_rms, proximity_rms
from khepera_hil.protocol import SPEED_UNIT_MM_S
from khepera_hil.world import World

_PERIOD = 0.1


def wander(proximity: list[int]) -> tuple[int, int]:
    """Speeds that keep a robot going: turn right on the spot before things, else go straight on."""
    return (8, -8) if max(proximity[:6]) > 200 else (4, 4)


def physics(seconds: float, seed: int) -> float:
    """World and sensors alone."""
    world = World("furnished", seed)
    start = time.process_time()
    for tick in range(round(seconds / _PERIOD)):
        world.advance(tick * _PERIOD)
        world.light()
        left, right = wander(world.proximity())
        world.set_speed(left * SPEED_UNIT_MM_S, right * SPEED_UNIT_MM_S)
    return seconds / (time.process_time() - start)


def port(seconds: float, seed: int) -> float:
    """With the bytes, through pyserial's door."""
    if "khepera_hil.ports" not in serial.protocol_handler_packages:
        serial.protocol_handler_packages.append("khepera_hil.ports")
    line: Any = serial.serial_for_url(f"emulator://furnished?seed={seed}&clock=simulated", baudrate=38400)
    line.timeout = 0.1
    line.read(200)

    def ask(request: bytes) -> bytes:
        line.write(request)
        answer = b""
        while not answer.endswith(b"\n"):
            answer += line.read(max(1, line.in_waiting))
        return answer

    start, zero = time.process_time(), line.clock.now()
    for tick in range(round(seconds / _PERIOD)):
        line.clock.sleep_until(zero + tick * _PERIOD)
        proximity = [int(word) for word in ask(b"N\n").split(b",")[1:]]
        ask(b"O\n")
        ask(b"D,%d,%d\n" % wander(proximity))
    return seconds / (time.process_time() - start)


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.emulator")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--seconds", type=float, default=60.0, help="simulated seconds of each run (60)")
    options = parser.parse_args()
    seeds = range(3)
    figures = {
        "physics_x_realtime": round(sum(physics(options.seconds, seed) for seed in seeds) / len(seeds), 1),
        "port_x_realtime": round(sum(port(options.seconds, seed) for seed in seeds) / len(seeds), 1),
        "proximity_rms": round(proximity_rms(), 2),
        "light_rms": round(light_rms(), 2),
    }
    for name, value in figures.items():
        print(f"{name:>20} {value}")
    if options.json is not None:
        options.json.write_text(json.dumps(figures) + "\n", "utf-8")


if __name__ == "__main__":
    main()
