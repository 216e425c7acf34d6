"""What a command line may choose of a program: other data (lesson 2), or a sensor that is not to be had (E5.3)."""

from __future__ import annotations

import argparse

from khepera_hil.commands.parser import number
from khepera_hil.controllers import PROGRAMS, Setting
from khepera_hil.controllers.base import USUAL
from khepera_hil.controllers.watchman_mind import EARLY, LATE
from khepera_hil.errors import UsageError
from khepera_hil.teaching.dataset import taught

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


def _early(text: str) -> tuple[str, ...]:
    """A type for argparse: late, early, or names of internal variables with commas between."""
    if text in ("late", "early"):
        return EARLY if text == "early" else LATE
    names = tuple(text.split(","))
    if any(name not in EARLY for name in names):
        raise argparse.ArgumentTypeError(f"{text!r} is neither late nor early nor some of {','.join(EARLY)}")
    return names


def setting_of(asked: argparse.Namespace) -> Setting:
    """What was chosen for ``asked.program``, or a sentence why it does not fit."""
    program = PROGRAMS[asked.program]
    for name in asked.unknown:
        if name not in program.known:
            knows = ", ".join(program.known) or "no variable that could be unknown"
            raise UsageError(f"--unknown {name}: the question of {asked.program} knows {knows}")
    if len(set(asked.unknown)) == len(program.known) and asked.unknown:
        raise UsageError(f"--unknown leaves {asked.program} with nothing that it knows; leave one variable out")
    if asked.program != "watchman" and (asked.decide or asked.memory != "drawn" or asked.stay != USUAL.stay):
        raise UsageError(f"--decide, --memory and --stay are about --program watchman, not {asked.program}")
    if asked.decide and asked.memory == "whole":
        raise UsageError("--memory whole draws nothing but the motors, so --decide does not go with it")
    if asked.stay != USUAL.stay and asked.memory == "whole":
        raise UsageError("--memory whole goes by the tables as printed, so --stay does not go with it")
    if asked.data is None:
        return Setting(tuple(asked.unknown), early=asked.decide, memory=asked.memory, stay=asked.stay)
    if program.specification is None:
        raise UsageError(f"{asked.program} is not taught, so --data does not go with it")
    return Setting(tuple(asked.unknown), taught(asked.data, program.specification))
