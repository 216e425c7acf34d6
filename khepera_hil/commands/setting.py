"""What a command line may choose of a program: other data (lesson 2), or a sensor that is not to be had (E5.3)."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from khepera_hil.commands.parser import number
from khepera_hil.controllers import PROGRAMS, Program, Setting
from khepera_hil.controllers.base import USUAL
from khepera_hil.controllers.watchman_mind import EARLY, LATE
from khepera_hil.errors import UsageError
from khepera_hil.teaching.calibration import read_calibration
from khepera_hil.teaching.dataset import taught
from khepera_hil.teaching.knowledge import known, read_knowledge

__all__ = ["add_setting", "setting_in", "setting_of", "told"]


def add_setting(parser: argparse.ArgumentParser) -> None:
    """The options ``--unknown``, ``--data`` and those of single programs."""
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
    parser.add_argument(
        "--decide",
        type=_early,
        default=LATE,
        metavar="WHEN",
        help="watchman: late (all but the motors summed out), early (all drawn), or names of what is to be drawn "
        "before the motors, such as Behavior,Move (default: late)",
    )
    parser.add_argument(
        "--memory",
        choices=("drawn", "whole"),
        default="drawn",
        help="watchman: what it carries from tick to tick (default: %(default)s)",
    )
    parser.add_argument(
        "--stay",
        type=number(0.5, 0.9999, "a probability"),
        default=0.9,
        metavar="P",
        help="watchman: the diagonal of table 2 where the paper prints .90; .999 swaps behaviors less often",
    )
    parser.add_argument(
        "--labels",
        action="store_true",
        help="watchman: take the operator's word for Behavior, by the keys 1 to 6 (0: none) or by orders",
    )


def _early(text: str) -> tuple[str, ...]:
    """A type for argparse: late, early, or names of internal variables with commas between."""
    if text in ("late", "early"):
        return EARLY if text == "early" else LATE
    names = tuple(text.split(","))
    if any(name not in EARLY for name in names):
        raise argparse.ArgumentTypeError(f"{text!r} is neither late nor early nor some of {','.join(EARLY)}")
    return names


def setting_of(asked: argparse.Namespace) -> Setting:
    """What was chosen for ``asked.program``, or a sentence why it does not fit. Raises UsageError."""
    program = PROGRAMS[asked.program]
    for name in asked.unknown:
        if name not in program.known:
            knows = ", ".join(program.known) or "no variable that could be unknown"
            raise UsageError(f"--unknown {name}: the question of {asked.program} knows {knows}")
    if len(set(asked.unknown)) == len(program.known) and asked.unknown:
        raise UsageError(f"--unknown leaves {asked.program} with nothing that it knows; leave one variable out")
    own = asked.decide or asked.memory != "drawn" or asked.stay != USUAL.stay or asked.labels
    if asked.program != "watchman" and own:
        raise UsageError(
            f"--decide, --memory, --stay and --labels are about --program watchman, not {asked.program}"
        )
    if asked.program == "watchman" and asked.data is not None:
        if asked.memory == "whole":
            raise UsageError("--memory whole goes by the tables as printed, so --data does not go with it")
        if asked.stay != USUAL.stay:
            raise UsageError(
                "--stay changes the tables as printed, so it does not go with --data, which replaces them"
            )
    if asked.labels and asked.memory == "whole":
        raise UsageError("--memory whole remembers no single Behavior, so --labels does not go with it")
    if asked.decide and asked.memory == "whole":
        raise UsageError("--memory whole draws nothing but the motors, so --decide does not go with it")
    if asked.stay != USUAL.stay and asked.memory == "whole":
        raise UsageError("--memory whole goes by the tables as printed, so --stay does not go with it")
    for option, owner in (("calibration", "fusion"), ("knowledge", "object")):
        if getattr(asked, option) is not None and asked.program != owner:
            raise UsageError(f"--{option} is for the program {owner}, not for {asked.program}")
    if asked.data is not None and program.specification is None:
        raise UsageError(f"{asked.program} is not taught, so --data does not go with it")
    met = () if asked.knowledge is None else read_knowledge(asked.knowledge)
    calibration = None if asked.calibration is None else str(asked.calibration)
    made = _made(program, asked.unknown, asked.data, calibration)
    return replace(made, met=met, early=asked.decide, memory=asked.memory, stay=asked.stay, labels=asked.labels)


def told(asked: argparse.Namespace, setting: Setting) -> dict[str, Any]:
    """The same for a run's manifest, so that the run can be asked again; what was known of objects is in it whole,
    since the file that it came from goes on.
    """
    calibration = None if asked.calibration is None else str(asked.calibration)
    told: dict[str, Any] = {"unknown": asked.unknown, "data": asked.data, "calibration": calibration}
    if setting.met:
        told["met"] = [dict(row) for row in setting.met]
    if asked.program == "watchman":
        told |= {"decide": list(asked.decide), "memory": asked.memory, "stay": asked.stay}
        if asked.labels:
            told["labels"] = True
    return told


def setting_in(manifest: Mapping[str, Any], program: Program) -> Setting:
    """What a recorded run was set to; the data are read again from where they were. Raises UsageError."""
    told = manifest.get("setting")
    if not isinstance(told, dict):
        return USUAL
    unknown, data, calibration = told.get("unknown", []), told.get("data"), told.get("calibration")
    met = told.get("met", [])
    early, memory, stay = told.get("decide", []), told.get("memory", USUAL.memory), told.get("stay", USUAL.stay)
    labels = told.get("labels", False)
    if (
        not isinstance(unknown, list)
        or not all(name in program.known for name in unknown)
        or not all(one is None or isinstance(one, str) for one in (data, calibration))
        or (data is not None and program.specification is None)
        or not isinstance(met, list)
        or not all(known(row) for row in met)
        or not isinstance(early, list)
        or not all(name in EARLY for name in early)
        or memory not in ("drawn", "whole")
        or not isinstance(stay, float)
        or not 0.5 <= stay < 1
        or not isinstance(labels, bool)
    ):
        raise UsageError(f"the run's setting is damaged: {told!r:.100}")
    made = _made(program, unknown, data, calibration)
    return replace(made, met=tuple(met), early=tuple(early), memory=str(memory), stay=stay, labels=labels)


def _made(program: Program, unknown: Sequence[str], data: str | None, calibration: str | None) -> Setting:
    description = None
    if data is not None and program.specification is not None:
        description = taught(data, program.specification)
    sensors = None if calibration is None else read_calibration(Path(calibration))
    return Setting(tuple(unknown), description, sensors)
