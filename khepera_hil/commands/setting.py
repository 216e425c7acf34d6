"""What a command line may choose of a program: other data (lesson 2), or a sensor that is not to be had (E5.3)."""

from __future__ import annotations

import argparse

from khepera_hil.controllers import PROGRAMS, Setting
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


def setting_of(asked: argparse.Namespace) -> Setting:
    """What was chosen for ``asked.program``, or a sentence why it does not fit."""
    program = PROGRAMS[asked.program]
    for name in asked.unknown:
        if name not in program.known:
            knows = ", ".join(program.known) or "no variable that could be unknown"
            raise UsageError(f"--unknown {name}: the question of {asked.program} knows {knows}")
    if len(set(asked.unknown)) == len(program.known) and asked.unknown:
        raise UsageError(f"--unknown leaves {asked.program} with nothing that it knows; leave one variable out")
    if asked.data is None:
        return Setting(tuple(asked.unknown))
    if program.specification is None:
        raise UsageError(f"{asked.program} is not taught, so --data does not go with it")
    return Setting(tuple(asked.unknown), taught(asked.data, program.specification))
