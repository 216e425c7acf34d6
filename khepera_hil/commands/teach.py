"""``khepera-hil teach``: drive the robot, and keep what was seen and done as a data set (section 5.3)."""

from __future__ import annotations

import argparse
import secrets
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from brp import BrpError
from brp.programs.base import Px
from brp.programs.fusion import L
from brp.programs.obstacle import Dir, Prox, Vrot
from brp.programs.phototaxy import Theta1
from khepera_hil import chance
from khepera_hil.commands.address import port_url
from khepera_hil.commands.parser import Parser, baud, existing_name, number, seed
from khepera_hil.commands.run import parser_of_run
from khepera_hil.commands.session import LOCAL, run_on_robot
from khepera_hil.errors import RecordingError, UsageError
from khepera_hil.recording import Tick as Turn
from khepera_hil.service import Service
from khepera_hil.teaching.dataset import TICK, DataSet
from khepera_hil.teaching.hand import Hand
from khepera_hil.teaching.joystick import open_joystick
from khepera_hil.teaching.keyboard import HELP, Keyboard
from khepera_hil.teaching.lesson import BEHAVIORS, WORLDS, Lesson, Tick
from khepera_hil.teaching.scripted import LATE, SHAKE, STEADY, Scripted

__all__ = ["main"]

TEACHERS = ("joystick", "keyboard", "scripted")

EPILOG = """\
examples:
  khepera-hil teach push --port /dev/ttyS0 --teacher joystick --out delta-push.json
  khepera-hil teach push --teacher keyboard --view --out delta-push.json      on the emulator, looking on
  khepera-hil teach avoid --teacher scripted --fast --seed 3 --out delta-avoid.json
  khepera-hil --program avoid --data delta-avoid.json         what was taught, on the robot

The lesson is a recorded run too: should it be cut short, `khepera-hil identify` takes the data out of its folder.
"""


class _Listening:
    """Writes down when each datum was taken, and ends the lesson when the teacher asks for it."""

    def __init__(self, lesson: Lesson, service: Service) -> None:
        self._lesson, self._service = lesson, service

    def offer(self, tick: Turn) -> None:
        if tick.draws:
            self._lesson.rows[-1][Tick.name] = round(tick.t / TICK)
        if self._lesson.hand.done:
            self._service.stop("teacher")

    def close(self) -> list[str]:
        return []


class _NoHand:
    """Nobody holds the stick yet."""

    done = False

    def vrot(self) -> int:
        return 0

    def close(self) -> None:
        pass


def main(arguments: Sequence[str]) -> int:
    """Drive, and write the data set however the lesson ended."""
    asked = _parser().parse_args(arguments)
    existing_name("behavior to teach", asked.behavior, list(BEHAVIORS))
    emulated = asked.port.partition(":")[0].lower() == "emulator"
    if asked.teacher == "scripted" and not emulated:
        raise UsageError("--teacher scripted sees the arena from above, which only --port emulator can show it")
    if asked.fast and asked.teacher != "scripted":
        raise UsageError("--fast is too quick for a hand: leave it out, or take --teacher scripted")
    if asked.out.exists() and not asked.force:
        raise UsageError(f"{asked.out} is there already: choose another name, or say --force")
    if not asked.out.resolve().parent.is_dir():
        raise UsageError(f"there is no folder for {asked.out}: make it first")
    chosen = secrets.randbits(32) if asked.seed is None else asked.seed
    world = asked.world or (WORLDS[asked.behavior] if asked.port.lower() == "emulator" else None)
    words = ["--port", asked.port, "--baud", str(asked.baud), "--period", str(asked.period), "--seed", str(chosen)]
    run = parser_of_run().parse_args([*words, "--duration", str(asked.duration), "--runs", str(asked.runs)])
    run.fast, run.json, run.world, run.program = asked.fast, asked.json, world, f"teach-{asked.behavior}"
    run.view, run.serve = asked.view, asked.serve
    url = port_url(run.port, run.world, run.scenario, fast=run.fast, seed=chosen, faults=None)
    lesson = Lesson(asked.behavior, _NoHand())
    hand = _hand(asked.teacher)

    def on_open(witness: Any, service: Service) -> _Listening:
        lesson.hand = hand or Scripted(
            asked.behavior, witness, chance.generator(chosen, "teacher"), late=asked.late, shake=asked.shake
        )
        return _Listening(lesson, service)

    try:
        run_on_robot(
            run,
            chosen,
            url,
            lesson,
            {"teacher": asked.teacher},
            on_open=on_open,
            note=lambda: f"{len(lesson.cells)} of {lesson.possible} cells",
        )
    finally:
        if hand is not None:
            hand.close()
        _save(lesson, asked.out, sys.stderr if asked.json else sys.stdout)
    return 0


def _hand(teacher: str) -> Hand | None:
    """Before the port is opened, so that a missing joystick moves nothing."""
    if teacher == "joystick":
        return open_joystick()
    if teacher == "keyboard":
        if sys.stdin is None:
            raise UsageError("--teacher keyboard needs a terminal to read keys from, and standard input is closed")
        keyboard = Keyboard(sys.stdin.fileno())
        print(HELP)
        return keyboard
    return None


def _save(lesson: Lesson, path: Path, out: TextIO | None) -> None:
    rows = [row for row in lesson.rows if Tick.name in row]
    if not rows:
        return  # nothing was driven, and the reason has been told
    variables = [Tick, Vrot, Dir, Prox, Theta1, *Px, *L]
    columns = {v.name: [row[v.name] for row in rows] for v in variables}
    try:
        DataSet(f"delta-{lesson.name}", columns).save(variables, path)
    except BrpError as error:
        raise RecordingError(f"the data set {path} was not written: {error}") from None
    print(
        f"{len(rows)} data in {path}, {len(lesson.cells)} of {lesson.possible} situations visited; "
        f"what was learnt: khepera-hil identify {_specification(lesson)} --data {path}",
        file=out,
    )


def _specification(lesson: Lesson) -> str:
    return lesson.behavior.specification.name.removeprefix("pi-").rstrip("12")


def _parser() -> Parser:
    parser = Parser("khepera-hil teach", "Drive the robot, and keep what was seen and done as a data set.", EPILOG)
    add = parser.add_argument
    add("behavior", metavar="BEHAVIOR", help=", ".join(BEHAVIORS))
    add("--port", default="emulator", help="as of khepera-hil (default: %(default)s)")
    add("--teacher", choices=TEACHERS, default="scripted", help="who drives (default: %(default)s)")
    add("--out", type=Path, required=True, metavar="FILE", help="the data set")
    add("--force", action="store_true", help="write it also where a file is already")
    add("--duration", type=number(0.1, 36000, "seconds"), default=30.0, metavar="SECONDS", help="(default: 30)")
    add("--baud", type=baud, default=38400, help="the rate of the robot's mode (default: %(default)s)")
    add("--period", type=number(0.01, 2.0, "seconds"), default=0.1, help="of a tick (default: %(default)s)")
    add("--seed", type=seed, help="of all chance, the teacher's hand too (default: a new one)")
    add("--world", metavar="ARENA", help="of the emulator (default: one that suits the behavior)")
    add("--fast", action="store_true", help="simulated time; scripted teacher only")
    add("--late", type=_late, default=LATE, metavar="TICKS", help="the script's reaction (default: %(default)s)")
    add(
        "--shake",
        type=number(0, 10, "units of Vrot"),
        metavar="VROT",
        help=f"deviation of the script's hand (default: {STEADY:g}, {SHAKE['push']:g} to push or for phototaxy)",
    )
    add("--runs", type=Path, default=Path("runs"), metavar="DIR", help="where the recording goes")
    add("--view", action="store_true", help="open the viewer on the lesson: who teaches an emulated robot sees it")
    add(
        "--serve",
        nargs="?",
        const=LOCAL,
        metavar="ADDRESS",
        help="serve the lesson to browsers and viewers, at HOST or HOST:PORT (default: %(const)s)",
    )
    add("--json", action="store_true", help="the run's result as one JSON object")
    return parser


def _late(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) > 20:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of ticks from 0 to 20")
    return int(text)
