"""What there is to look at: a recorded run with its picture from above, and distributions as charts."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import closing
from datetime import datetime
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import serial

from khepera_hil import chance
from khepera_hil.controllers import Controller
from khepera_hil.experiments.picture import Chart, superposed, written_charts
from khepera_hil.experiments.trial import BAUD, PERIOD, emulator_url
from khepera_hil.follower import Follower
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import open_port
from khepera_hil.recording import Recording, Tick
from khepera_hil.service import Service
from khepera_hil.viewer import FILE, ROWS_FAST, open_file

__all__ = ["charts_shown", "run_shown"]


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
) -> list[Path]:
    """Record a run with its viewer's file, and draw it from above as superposed images; where both are."""
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
        picture = recording.folder / "above.svg"
        picture.write_text(superposed(witness.size(), witness.shapes(), poses.now, poses.robot, every), "utf-8")
    return [recording.folder / FILE, picture]


def charts_shown(folder: Path, name: str, title: str, charts: Sequence[Chart], *, columns: int = 2) -> list[Path]:
    """Distributions as a picture, and as a recording of one moment with a layout of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    picture = folder / f"{name}.svg"
    picture.write_text(written_charts(title, charts, columns=columns), "utf-8")
    path = folder / f"{name}.rrd"
    os.environ.setdefault("RUST_LOG", "off")
    import rerun as rr
    import rerun.blueprint as rrb

    stream = rr.RecordingStream("khepera-hil paper", recording_id=name)
    views = [rrb.BarChartView(origin=f"/{place}", name=chart.title) for place, chart in enumerate(charts)]
    note = rrb.TextDocumentView(origin="/about", name="about")
    layout = rrb.Blueprint(rrb.Vertical(rrb.Grid(*views, grid_columns=columns), note, row_shares=[5, 1]))
    stream.save(path, default_blueprint=layout)
    text = "\n".join([f"# {title}", *(f"- {chart.title}: {chart.axis}" for chart in charts)])
    stream.log("/about", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
    for place, chart in enumerate(charts):
        at = np.array(chart.at if chart.at is not None else range(len(chart.p)), np.float64)
        stream.log(f"/{place}", rr.BarChart(np.array(chart.p, np.float64), abscissa=at), static=True)
    stream.flush()
    stream.disconnect()
    return [path, picture]
