"""The main job: ``khepera-hil --port PORT --program NAME``."""

from __future__ import annotations

import secrets
import sys
from collections.abc import Sequence
from pathlib import Path

from khepera_hil.commands import COMMANDS
from khepera_hil.commands.address import DEFAULT_WORLD, port_url
from khepera_hil.commands.parser import Parser, baud, existing_name, number, seed
from khepera_hil.commands.session import LOCAL, run_on_robot
from khepera_hil.commands.setting import add_setting, setting_of, told
from khepera_hil.controllers import PROGRAMS
from khepera_hil.controllers.object import Recogniser
from khepera_hil.service import PATIENCE
from khepera_hil.teaching.knowledge import write_knowledge
from khepera_hil.world import arenas, scenarios

__all__ = ["main", "parser_of_run"]

_COMMANDS = "\n".join(f"  khepera-hil {name:9} {does}" for name, does in COMMANDS.items() if name != "run")

EPILOG = f"""\
commands (each has its --help):
{_COMMANDS}

examples:
  khepera-hil --program home --duration 60                    on the emulated robot
  khepera-hil --port /dev/ttyS0 --program avoid               on a robot, until Ctrl-C
  khepera-hil --program home --fast --duration 120 --seed 3   simulated time, repeatable
  khepera-hil --program avoid --serve                         with a page for browsers to look on

exit codes: 0 ended well (duration, Ctrl-C, SIGTERM, order)  2 wrong arguments  3 port  4 robot
            5 wire too slow  6 recording  7 guard  1 anything else
"""


def main(arguments: Sequence[str]) -> int:
    """Run a program on a robot, record it, and say how it went."""
    asked = parser_of_run().parse_args(arguments)
    if asked.list:
        _list()
        return 0
    existing_name("program", asked.program, list(PROGRAMS))
    chosen_seed = secrets.randbits(32) if asked.seed is None else asked.seed
    url = port_url(asked.port, asked.world, asked.scenario, fast=asked.fast, seed=chosen_seed, faults=asked.faults)
    setting = setting_of(asked)
    controller = PROGRAMS[asked.program].make(setting)
    try:
        run_on_robot(asked, chosen_seed, url, controller, {"setting": told(asked, setting)})
    finally:
        if (
            asked.knowledge is not None
            and isinstance(controller, Recogniser)
            and len(controller.objects.met) > len(setting.met)
        ):
            write_knowledge(controller.objects.met, asked.knowledge)
            print(f"{len(controller.objects.met)} tours known in {asked.knowledge}", file=sys.stderr)
    return 0


def _list() -> None:
    print("programs (--program):")
    for name, one in PROGRAMS.items():
        print(f"  {name:13} {one.about}")
    print("arenas of the emulator (--world):")
    for name, looks in arenas().items():
        print(f"  {name:13} {looks}")
    print("scenarios of the emulator (--scenario):")
    for name, happens in scenarios().items():
        print(f"  {name:13} {happens}")


def parser_of_run() -> Parser:
    """The options of a run."""
    parser = Parser(
        "khepera-hil", "Run a Bayesian robot program on a Khepera and record every distribution.", EPILOG
    )
    add = parser.add_argument
    add("--port", default="emulator", help="a device, a URL of pyserial's, or emulator (default: %(default)s)")
    add("--program", default="home", metavar="NAME", help="what to run, see --list (default: %(default)s)")
    add_setting(parser)
    add("--baud", type=baud, default=38400, help="the rate of the robot's mode (default: %(default)s)")
    add(
        "--period",
        type=number(0.01, 2.0, "seconds"),
        default=0.1,
        metavar="SECONDS",
        help="of a tick (default: %(default)s)",
    )
    add(
        "--duration",
        type=number(0.0, 1e7, "seconds"),
        metavar="SECONDS",
        help="of the robot's time (default: until stopped)",
    )
    add("--seed", type=seed, help="of all chance: robot, arena, draws (default: a new one, told and recorded)")
    add(
        "--world",
        metavar="ARENA",
        help=f"of the in-process emulator: a name of --list or a TOML file (default: {DEFAULT_WORLD}, "
        "or what the scenario was made for)",
    )
    add(
        "--scenario",
        metavar="NAME",
        help="what happens in the world of the in-process emulator: a name of --list or a TOML file",
    )
    add(
        "--faults",
        metavar="SPEC",
        help="faults of the line of the in-process emulator, such as flip=1e-3,late=0.01,disconnect@30+5",
    )
    add("--fast", action="store_true", help="simulated time, as quick as the machine can; in-process emulator only")
    add(
        "--verify",
        action="store_true",
        help="read the sensors twice, and hold them to what the robot can have moved: for a line that loses bytes",
    )
    add(
        "--patience",
        type=number(0.1, 1e6, "seconds"),
        default=PATIENCE,
        metavar="SECONDS",
        help="for a lost line, or a silent robot, to come back (default: %(default)g)",
    )
    add("--resume", action="store_true", help="let a robot that was reset drive on by itself")
    add("--realtime", action="store_true", help="ask for SCHED_FIFO and locked memory; a line says when refused")
    add("--runs", type=Path, default=Path("runs"), metavar="DIR", help="where recordings go (default: %(default)s)")
    add("--view", action="store_true", help="open the viewer on the running loop")
    add(
        "--serve",
        nargs="?",
        const=LOCAL,
        metavar="ADDRESS",
        help="serve the running loop to browsers and viewers, at HOST or HOST:PORT (default: %(const)s)",
    )
    add("--json", action="store_true", help="the last line on standard output is the result as one JSON object")
    add("--list", action="store_true", help="list programs, arenas and scenarios, and end")
    return parser
