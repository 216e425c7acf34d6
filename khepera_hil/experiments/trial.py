"""One trial: a program on an emulated robot, through the bytes of its serial line, in simulated time.

Nothing is written: who wants a recording runs the program by the command line, with the same seed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial
from itertools import pairwise
from math import hypot
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote, urlencode

import numpy as np
import serial

from khepera_hil import chance
from khepera_hil.controllers import Controller
from khepera_hil.follower import Follower
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import open_port
from khepera_hil.recording import Recording, Tick
from khepera_hil.service import Service
from khepera_hil.viewer import FILE, ROWS_FAST
from khepera_hil.viewer.keeping import Keeping

__all__ = ["BAUD", "PERIOD", "Trial", "drive", "emulator_url"]

BAUD = 38400
PERIOD = 0.1

Make = Callable[[Any], Controller]
Watch = Callable[[Tick, "Trial"], bool]


@dataclass
class Trial:
    """What was seen of a run from outside; metres, radians, seconds."""

    shapes: list[dict[str, Any]]
    ticks: list[Tick] = field(default_factory=list)
    poses: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Where everything that can move is by now, the robot too."""
    score: Mapping[str, Any] = field(default_factory=dict)
    folder: Path | None = None
    """Where it was recorded, if it was."""
    stopped: bool = False
    """Whether ``watch`` had seen enough."""

    @property
    def path(self) -> float:
        """The length of the robot's way by the poses at the ticks, m."""
        poses = [tick.pose for tick in self.ticks if tick.pose is not None]
        return sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(poses))


class _Log:
    """Stands where a recording stands, and keeps the ticks."""

    folder = Path()  # nothing is written, unless there is a recording as well

    def __init__(
        self, trial: Trial, watch: Watch | None, stop: Callable[[str], None], recording: Recording | None = None
    ) -> None:
        self._trial, self._watch, self._stop, self._recording = trial, watch, stop, recording
        if recording is not None:
            self.folder = recording.folder

    def write(self, tick: Tick) -> None:
        trial = self._trial
        if self._recording is not None:
            self._recording.write(tick)
        trial.ticks.append(tick)
        trial.poses.update(tick.moved)
        if tick.pose is not None:
            trial.poses["robot"] = tick.pose
        if self._watch is not None and not trial.stopped and self._watch(tick, trial):
            trial.stopped = True
            self._stop("seen enough")


def _recorded(folder: Path, seed: int, program: str, about: Mapping[str, Any]) -> Recording:
    manifest = {**about, "period_s": PERIOD, "clock": "simulated"}
    recording = Recording.create(folder, program=program, seed=seed, manifest=manifest, started=datetime.now())
    opening = partial(Keeping, recording.folder / FILE, recording.manifest, rows=ROWS_FAST)
    recording.follow(Follower(opening, name=FILE, waits=True))
    return recording


def emulator_url(world: str, seed: int, options: Mapping[str, str] = MappingProxyType({})) -> str:
    """The port's name for a world (a name or a TOML file's path) in simulated time."""
    query = urlencode({"seed": str(seed), "clock": "simulated", **options})
    return f"emulator://{quote(world)}?{query}"


def drive(
    make: Controller | Make,
    *,
    world: str,
    seed: int,
    duration: float,
    watch: Watch | None = None,
    rng: np.random.Generator | None = None,
    record: Path | None = None,
    options: Mapping[str, str] = MappingProxyType({}),
) -> Trial:
    """Run a program for ``duration`` seconds, or until ``watch`` returns true.

    ``make`` is a controller, or makes one from the port's witness (a teacher needs eyes). The draws come from the
    seed's own stream, as in a run from the command line, unless ``rng`` is given.
    ``options`` go into the port's name (``scenario``, ``object``). With ``record`` the run has its
    folder there: the whole log, and of the viewer's file what `Keeping` keeps of a long one.
    """
    if "khepera_hil.ports" not in serial.protocol_handler_packages:
        serial.protocol_handler_packages.append("khepera_hil.ports")
    with closing(open_port(emulator_url(world, seed, options), BAUD)) as port:
        witness, clock = port.witness, port.clock  # type: ignore[attr-defined]  # the emulator's port has both
        controller = make(witness) if callable(make) else make
        service = Service(
            Khepera(Link(port, clock, baud=BAUD)),
            controller,
            clock=clock,
            period=PERIOD,
            rng=rng or chance.generator(seed, "program"),
            witness=witness,
        )
        versions = service.connect()
        trial = Trial(witness.shapes(), poses=dict(witness.poses()))
        recording = None
        if record is not None:
            about = {"robot": {"bios": versions[0], "protocol": versions[1]}, "port": "emulator", "baud": BAUD}
            seen = {"name": Path(world).stem, "size": witness.size(), "shapes": witness.shapes()}
            recording = _recorded(record, seed, controller.name, {**about, **service.program(), "world": seen})
            trial.folder = recording.folder
        try:
            log = _Log(trial, watch, service.stop, recording)
            service.run(log, duration=duration)  # type: ignore[arg-type]  # it only writes
        finally:
            trial.score = witness.score()
            if recording is not None:
                recording.close({"score": dict(trial.score), "stop": service.ended, "ticks": service.ticks})
    return trial
