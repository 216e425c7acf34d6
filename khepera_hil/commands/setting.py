"""What a command line may choose of a program: other data (lesson 2), or a sensor that is not to be had (E5.3)."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from khepera_hil.controllers import PROGRAMS, Program, Setting
from khepera_hil.controllers.base import USUAL
from khepera_hil.errors import UsageError
from khepera_hil.teaching.calibration import read_calibration
from khepera_hil.teaching.dataset import taught
from khepera_hil.teaching.knowledge import read_knowledge

__all__ = ["add_setting", "setting_in", "setting_of", "told"]


def add_setting(parser: argparse.ArgumentParser) -> None:
    """The options ``--unknown`` and ``--data``."""
    parser.add_argument(
        "--unknown",
        action="append",
        default=[],
        metavar="VARIABLE",
        help="do not tell this variable to the program's question, as if its sensor had failed (again: more)",
    )
    parser.add_argument(
        "--data",
        metavar="DATA",
        help="go by what was taught: a data set's name or file, an identified description, or a run's folder",
    )
    parser.add_argument(
        "--calibration", type=Path, metavar="FILE", help="the light sensors, as khepera-hil calibrate found them"
    )
    parser.add_argument(
        "--knowledge",
        type=Path,
        metavar="FILE",
        help="the objects met so far, for the program object: read at the start, written at the end",
    )


def setting_of(asked: argparse.Namespace) -> Setting:
    """What was chosen for ``asked.program``, or a sentence why it does not fit. Raises UsageError."""
    program = PROGRAMS[asked.program]
    for name in asked.unknown:
        if name not in program.known:
            knows = ", ".join(program.known) or "no variable that could be unknown"
            raise UsageError(f"--unknown {name}: the question of {asked.program} knows {knows}")
    if len(set(asked.unknown)) == len(program.known) and asked.unknown:
        raise UsageError(f"--unknown leaves {asked.program} with nothing that it knows; leave one variable out")
    for option, owner in (("calibration", "fusion"), ("knowledge", "object")):
        if getattr(asked, option) is not None and asked.program != owner:
            raise UsageError(f"--{option} is for the program {owner}, not for {asked.program}")
    if asked.data is not None and program.specification is None:
        raise UsageError(f"{asked.program} is not taught, so --data does not go with it")
    met = () if asked.knowledge is None else read_knowledge(asked.knowledge)
    calibration = None if asked.calibration is None else str(asked.calibration)
    return replace(_made(program, asked.unknown, asked.data, calibration), met=met)


def told(asked: argparse.Namespace) -> dict[str, Any]:
    """The same for a run's manifest, so that the run can be asked again."""
    calibration = None if asked.calibration is None else str(asked.calibration)
    return {"unknown": asked.unknown, "data": asked.data, "calibration": calibration}


def setting_in(manifest: Mapping[str, Any], program: Program) -> Setting:
    """What a recorded run was set to; the data are read again from where they were. Raises UsageError."""
    told = manifest.get("setting")
    if not isinstance(told, dict):
        return USUAL
    unknown, data, calibration = told.get("unknown", []), told.get("data"), told.get("calibration")
    if (
        not isinstance(unknown, list)
        or not all(name in program.known for name in unknown)
        or not all(one is None or isinstance(one, str) for one in (data, calibration))
        or (data is not None and program.specification is None)
    ):
        raise UsageError(f"the run's setting is damaged: {told!r:.100}")
    return _made(program, unknown, data, calibration)


def _made(program: Program, unknown: Sequence[str], data: str | None, calibration: str | None) -> Setting:
    description = None
    if data is not None and program.specification is not None:
        description = taught(data, program.specification)
    sensors = None if calibration is None else read_calibration(Path(calibration))
    return Setting(tuple(unknown), description, sensors)
