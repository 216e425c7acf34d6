"""What the commands on recorded runs have in common."""

from __future__ import annotations

import argparse
from pathlib import Path

from khepera_hil.commands.parser import Parser, existing_name
from khepera_hil.commands.setting import setting_in
from khepera_hil.controllers import PROGRAMS, Controller, Learner
from khepera_hil.errors import UsageError
from khepera_hil.reading import Run, find
from khepera_hil.replay import Learning

__all__ = ["add_run", "add_runs", "controller_of", "learning_of", "opened"]


def add_runs(parser: Parser) -> None:
    """``--runs``."""
    parser.add_argument(
        "--runs", type=Path, default=Path("runs"), metavar="DIR", help="where recordings are (default: %(default)s)"
    )


def add_run(parser: Parser, name: str = "run") -> None:
    """One run by path, name or ``last``."""
    parser.add_argument(name, metavar=name.upper(), help="a run's folder, its name in --runs, or last")


def opened(asked: argparse.Namespace, name: str = "run") -> Run:
    """The run that was asked for."""
    return find(getattr(asked, name), asked.runs)


def controller_of(run: Run) -> Controller:
    """The program that was recorded, as it is now. Raises UsageError when there is none of its name any more."""
    if run.program not in PROGRAMS:
        raise UsageError(
            f"{run.name} is a run of {run.program!r}, which this version does not have; "
            f"there are {', '.join(sorted(PROGRAMS))}"
        )
    program = PROGRAMS[run.program]
    return program.make(setting_in(run.manifest, program))


def learning_of(controller: Controller) -> Learning:
    """Which of its questions change on the way."""
    return controller.learning if isinstance(controller, Learner) else {}


def make(program: str) -> Controller:
    """A program by name. Raises UsageError when there is none."""
    return PROGRAMS[existing_name("program", program, list(PROGRAMS))].make()
