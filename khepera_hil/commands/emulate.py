"""``khepera-hil emulate``: the robot's end alone, for any program that drives a Khepera over a serial port."""

from __future__ import annotations

import os
import secrets
import signal
from collections.abc import Sequence
from pathlib import Path

from khepera_hil.commands.parser import Parser, baud, seed
from khepera_hil.serve import serve_pty
from khepera_hil.world import World

__all__ = ["main"]

EPILOG = """\
example:
  khepera-hil emulate --pty khepera --seed 3       in one terminal
  khepera-hil --port khepera --program home        in another
"""


def main(arguments: Sequence[str]) -> int:
    """Serve an emulated robot until Ctrl-C or SIGTERM, then say what its world saw."""
    asked = _parser().parse_args(arguments)
    chosen = secrets.randbits(32) if asked.seed is None else asked.seed
    world = World(asked.world, chosen)
    wakes, wake = os.pipe()
    for which in (signal.SIGINT, signal.SIGTERM):
        signal.signal(which, lambda number, frame: os.write(wake, b"!") and None)

    def ready(device: str) -> None:
        print(
            f"{asked.pty} -> {device}: a Khepera at {asked.baud} baud in {asked.world}, "
            f"seed {chosen}; Ctrl-C ends it",
            flush=True,
        )

    score = serve_pty(asked.pty, world, baud=asked.baud, stop=wakes, on_ready=ready)
    print("score: " + ", ".join(f"{name} {value}" for name, value in score.items()))
    return 0


def _parser() -> Parser:
    parser = Parser("khepera-hil emulate", "An emulated Khepera behind a pseudo-terminal.", EPILOG)
    add = parser.add_argument
    add("--pty", type=Path, required=True, metavar="LINK", help="the name under which clients open it")
    add("--world", default="furnished", metavar="ARENA", help="a name of khepera-hil --list, or a TOML file")
    add("--baud", type=baud, default=38400, help="the robot's rate (default: %(default)s)")
    add("--seed", type=seed, help="of robot, start and arena (default: a new one, told)")
    return parser
