"""What there is to look at: a recorded run, and its picture from above."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from datetime import datetime
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import serial

from khepera_hil import chance
from khepera_hil.controllers import Controller
from khepera_hil.experiments.experiment import Shown
from khepera_hil.experiments.picture import FromAbove, superposed
from khepera_hil.experiments.trial import BAUD, PERIOD, emulator_url
from khepera_hil.follower import Follower
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import open_port
from khepera_hil.recording import Recording, Tick
from khepera_hil.service import Service
from khepera_hil.viewer import FILE, ROWS_FAST, open_file

__all__ = ["run_shown"]


class _Poses:
    """Where everything was, tick by tick."""

    def __init__(self, poses: Mapping[str, tuple[float, float, float]]) -> None:
        self.now = dict(poses)
        self.robot: list[tuple[float, float, float]] = []

    def offer(self, tick: Tick) -> None:
        self.now.update(tick.moved)
        if tick.pose is not None:
            self.robot.append(tick.pose)

    def close(self) -> list[str]:
        return []


def run_shown(
    folder: Path,
    controller: Controller,
    *,
    world: str,
    seed: int,
    seconds: float,
    every: int = 15,
    options: Mapping[str, str] = MappingProxyType({}),
) -> Shown:
    """Record a run with its viewer's file, and draw it from above as superposed images."""
    if "khepera_hil.ports" not in serial.protocol_handler_packages:
        serial.protocol_handler_packages.append("khepera_hil.ports")
    with closing(open_port(emulator_url(world, seed, options), BAUD)) as port:
        witness, clock = port.witness, port.clock  # type: ignore[attr-defined]  # the emulator's port has both
        rng = chance.generator(seed, "program")
        khepera = Khepera(Link(port, clock, baud=BAUD))
        service = Service(khepera, controller, clock=clock, period=PERIOD, rng=rng, witness=witness)
        versions = service.connect()
        manifest: dict[str, Any] = {
            "port": "emulator",
            "baud": BAUD,
            "period_s": PERIOD,
            "clock": "simulated",
            "robot": {"bios": versions[0], "protocol": versions[1]},
            **service.program(),
            "world": {"name": Path(world).stem, "size": witness.size(), "shapes": witness.shapes()},
        }
        recording = Recording.create(
            folder, program=controller.name, seed=seed, manifest=manifest, started=datetime.now()
        )
        opening = partial(open_file, recording.folder / FILE, recording.manifest, rows=ROWS_FAST)
        recording.follow(Follower(opening, name=FILE, waits=True))
        poses = _Poses(witness.poses())
        recording.follow(poses)
        try:
            service.run(recording, duration=seconds)
        finally:
            recording.close({"ticks": service.ticks, "stop": service.ended, "score": witness.score()})
        title = f"{controller.name}, seed {seed}: {every * PERIOD:g} s from image to image"
        picture = FromAbove(title, witness.size(), witness.shapes(), poses.now, poses.robot, every)
        drawing = recording.folder / "above.svg"
        drawing.write_text(superposed(picture), "utf-8")
    return Shown([recording.folder / FILE, drawing], [picture])
