"""How fast the emulated robot is, and how near to the measured one: ``python -m benchmarks.emulator``.

``physics_x_realtime``: simulated seconds for each second of one core, the world stepped and both kinds of
sensors read at 10 Hz while the robot wanders through the furnished arena. ``chain_x_realtime``: the same for the
whole chain in simulated time: program ``home`` with its inference, N, O and D as bytes each tick and a whole
picture of the camera every second tick, at 115200 baud, the log written, no viewer's file. ``proximity_rms`` and
``light_rms`` are counts of 1023 and of 511, against ``benchmarks.measured`` (``--cells`` prints every cell).
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import serial

from benchmarks import measured
from brp import Question
from khepera_hil import chance
from khepera_hil.controllers import PROGRAMS, Controller, Decision
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import open_port
from khepera_hil.perception import Readings
from khepera_hil.recording import Recording
from khepera_hil.service import Service
from khepera_hil.units import SPEED_UNIT_MM_S
from khepera_hil.world import World
from khepera_hil.world.camera import PIXELS

_PERIOD = 0.1
_BAUD = 115200
_CAMERA = 2  # its turret


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


class _Looking:
    """A program that also takes a picture every second tick, as the watchman's will."""

    def __init__(self, program: Controller, khepera: Khepera) -> None:
        self._program, self._khepera = program, khepera
        self.name, self.needs, self.decides = program.name, program.needs, program.decides
        self.questions: Mapping[str, Question] = program.questions
        self.pictures = 0
        self._ticks = 0

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        self._ticks += 1
        if self._ticks % 2:
            _, picture = self._khepera.link.ask("T", _CAMERA, "N")
            self.pictures += str(picture).count(",") == PIXELS
        return self._program.step(readings, rng)


def chain(seconds: float, seed: int) -> float:
    """From the world to the log's line and back, every byte on the wire."""
    if "khepera_hil.ports" not in serial.protocol_handler_packages:
        serial.protocol_handler_packages.append("khepera_hil.ports")
    with tempfile.TemporaryDirectory() as runs:
        port: Any = open_port(f"emulator://furnished?seed={seed}&clock=simulated", _BAUD)
        khepera = Khepera(Link(port, port.clock, baud=_BAUD))
        program = _Looking(PROGRAMS["home"][1](), khepera)
        rng = chance.generator(seed, "program")
        service = Service(khepera, program, clock=port.clock, period=_PERIOD, rng=rng, witness=port.witness)
        service.connect()
        manifest = {"period_s": _PERIOD, **service.program()}
        recording = Recording.create(runs, program="home", seed=seed, manifest=manifest, started=datetime.now())
        start = time.process_time()
        service.run(recording, duration=seconds)
        took = time.process_time() - start
        recording.close({"ticks": service.ticks})
        port.close()
    ticks = round(seconds / _PERIOD)
    done = service.ticks, service.missed, service.blind, program.pictures
    if done != (ticks, 0, 0, (ticks + 1) // 2):
        raise SystemExit(f"the chain was not whole: {done} (ticks, missed, without data, pictures)")
    return seconds / took


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.emulator")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--seconds", type=float, default=60.0, help="simulated seconds of each run (60)")
    parser.add_argument("--seeds", type=int, default=5, help="runs, each with its own seed (5); the median counts")
    parser.add_argument("--cells", action="store_true", help="print each cell of the measured tables")
    options = parser.parse_args()
    near, bright = measured.proximity(), measured.light()
    if options.cells:
        print(measured.printed(near), measured.printed(bright), sep="\n")
    figures: dict[str, float] = {}
    for name, run in (("physics", physics), ("chain", chain)):
        speeds = [run(options.seconds, seed) for seed in range(options.seeds)]
        figures[f"{name}_x_realtime"] = round(statistics.median(speeds), 1)
        print(f"{name}, seed by seed: " + " ".join(f"{speed:.0f}" for speed in speeds))
    figures |= {"proximity_rms": round(measured.rms(near), 2), "light_rms": round(measured.rms(bright), 2)}
    for name, value in figures.items():
        print(f"{name:>20} {value}")
    if options.json is not None:
        options.json.write_text(json.dumps(figures) + "\n", "utf-8")


if __name__ == "__main__":
    main()
