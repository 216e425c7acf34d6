"""The command line's commands, a module each. The main job, ``run``, needs no word."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import cast

from khepera_hil.commands.parser import Command

__all__ = ["COMMANDS", "command"]

COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "run": "run a program (what happens without a word)",
        "check": "look at a robot, its line and this computer; nothing moves",
        "emulate": "an emulated Khepera behind a pseudo-terminal, for any program",
        "meet": "several programs at once, each on its own robot in one simulated world",
        "order": "an order to a run that is going on: stop, resume, vigil on ...",
        "runs": "list recorded runs",
        "review": "open a recorded run in the viewer, or make a picture of it",
        "replay": "ask a recorded run's questions again, or ask another program",
        "compare": "tell two recorded runs apart",
        "explain": "what spoke for and against a drawn value",
        "teach": "drive by joystick, keyboard or script, and keep what was done as a data set",
        "identify": "what a specification learns from data sets",
        "calibrate": "the light sensors, by turning before a lamp",
        "paper": "the paper's experiments of sections 5 to 8, with their figures",
        "export": "a run's ticks as columns (parquet, csv)",
    }
)
"""What each does, in a line."""


def command(name: str) -> Command:
    """The module of a command; each is imported when it is asked for, since some need what takes long to import."""
    return cast(Command, importlib.import_module(f"khepera_hil.commands.{name}"))
