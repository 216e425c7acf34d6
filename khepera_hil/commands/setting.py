"""What a command line may choose of a program: other data (lesson 2), or a sensor that is not to be had (E5.3)."""

from __future__ import annotations

import argparse
from pathlib import Path

from khepera_hil.controllers import PROGRAMS, Setting
from khepera_hil.errors import UsageError
from khepera_hil.teaching.calibration import read_calibration
from khepera_hil.teaching.dataset import taught
from khepera_hil.teaching.knowledge import read_knowledge

__all__ = ["add_setting", "setting_of"]


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
    """What was chosen for ``asked.program``, or a sentence why it does not fit."""
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
    sensors = None if asked.calibration is None else read_calibration(asked.calibration)
    met = () if asked.knowledge is None else read_knowledge(asked.knowledge)
    if asked.data is None:
        return Setting(tuple(asked.unknown), None, sensors, met)
    if program.specification is None:
        raise UsageError(f"{asked.program} is not taught, so --data does not go with it")
    return Setting(tuple(asked.unknown), taught(asked.data, program.specification), sensors, met)
