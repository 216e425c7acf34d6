"""How a run went: said to a person, to a program (``--json``), and to the recording's manifest."""

from __future__ import annotations

import json
import os
import shutil
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from khepera_hil.commands.scored import scored
from khepera_hil.errors import RecordingError
from khepera_hil.quantiles import Quantiles
from khepera_hil.recording import Recording
from khepera_hil.service import Service

__all__ = ["TERMINAL", "called", "finish"]

TERMINAL = "the terminal"
"""The name of the follower that shows a run there."""


def finish(recording: Recording, service: Service, witness: Any, *, as_json: bool) -> RecordingError | None:
    """Close the recording and say how the run went; what could not be written is returned, not raised."""
    ending: dict[str, Any] = {
        "ticks": service.ticks,
        "missed": service.missed,
        "without_data": service.blind,
        "lines_lost": service.losses,
        "robot_resets": service.resets,
        "checks": asdict(service.checks),
        "faults": {} if witness is None else witness.faults(),
        "work_ms": _percentiles(service.work),
        "late_ms": _percentiles(service.late),
        "stop": service.ended,
        "state": service.state,
        "rested": service.rested,
        "error": service.error,
        "score": {} if witness is None else witness.score(),
    }
    failure = None
    try:
        losses = recording.close(ending)
    except RecordingError as error:
        losses, failure = [], error
    for loss in losses:
        if not loss.startswith(TERMINAL):  # who closed it knows that
            print(f"khepera-hil: {loss}", file=sys.stderr)
    print(f"stopped ({ending['stop']}) after {ending['ticks']} ticks, {ending['missed']} deadlines missed")
    if ending["checks"]["verified"]:
        print(
            "verified: {verified} answers, {third} read a third time, {refused} ticks refused".format_map(
                ending["checks"]
            )
        )
    if ending["faults"]:
        print("faults: " + ", ".join(f"{kind} {number}" for kind, number in sorted(ending["faults"].items())))
    if ending["score"]:
        print(f"score: {scored(ending['score'])}")
    print(f"recorded in {recording.folder}; to look at it: {called('khepera-hil')} review {recording.folder}")
    if as_json:
        about = {name: recording.manifest[name] for name in ("program", "seed")}
        print(json.dumps({"run": str(recording.folder), **about, **ending}))
    return failure


def called(name: str) -> str:
    """How a program is called here: it is installed beside the interpreter, which may not be on the PATH."""
    beside = Path(sys.executable).with_name(name)
    if shutil.which(name) is None and beside.exists():
        return os.path.relpath(beside) if beside.is_relative_to(Path.cwd()) else str(beside)
    return name


def _percentiles(seconds: Quantiles) -> dict[str, float | None]:
    """In milliseconds; null where there was no tick."""
    found = {"p50": seconds.at(0.5), "p99": seconds.at(0.99)}
    return {name: None if value is None else round(1e3 * value, 3) for name, value in found.items()}
