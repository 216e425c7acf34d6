"""``khepera-hil meet``: several programs at once, each on a robot of its own in one simulated world."""

from __future__ import annotations

import argparse
import json
import secrets
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from khepera_hil.commands.parser import Parser, existing_name, number, seed
from khepera_hil.commands.scored import scored
from khepera_hil.controllers import PROGRAMS
from khepera_hil.errors import UsageError
from khepera_hil.experiments.meeting import meet
from khepera_hil.world import MOST_ROBOTS, load_scenario

__all__ = ["main"]

EPILOG = """\
example:
  khepera-hil meet watchman avoid --world watchman --seed 3 --duration 120
  khepera-hil review last

Each program runs as it does alone, over the bytes of its own line, and has a recording of its own. Time is
simulated, as quick as the machine can: the same command gives the same runs. For programs of any kind, at the
wall's pace, see khepera-hil emulate --robots.

exit codes: 0 all ended  2 wrong arguments or arena  4 a robot was not understood  6 a recording
"""


def main(arguments: Sequence[str]) -> int:
    """Run them, and say what each was worth."""
    asked = _parser().parse_args(arguments)
    for name in asked.programs:
        existing_name("program", name, list(PROGRAMS))
    if not 2 <= len(asked.programs) <= MOST_ROBOTS:
        raise UsageError(f"name from 2 to {MOST_ROBOTS} programs, one for each robot, not {len(asked.programs)}")
    chosen = secrets.randbits(32) if asked.seed is None else asked.seed
    scenario = None if asked.scenario is None else load_scenario(asked.scenario)
    world = asked.world or (scenario.world if scenario is not None else None) or "furnished"
    trials = meet(
        [PROGRAMS[name].make() for name in asked.programs],
        world=world,
        seed=chosen,
        duration=asked.duration,
        record=asked.runs,
        options={} if asked.scenario is None else {"scenario": asked.scenario},
    )
    runs: list[dict[str, Any]] = []
    for place, (name, trial) in enumerate(zip(asked.programs, trials, strict=True), 1):
        print(f"robot {place}, {name}: {len(trial.ticks)} ticks, score: {scored(trial.score)}")
        print(f"  recorded in {trial.folder}")
        runs.append(
            {
                "robot": place,
                "program": name,
                "run": str(trial.folder),
                "ticks": len(trial.ticks),
                "score": trial.score,
            }
        )
    if asked.json:
        print(json.dumps({"world": world, "seed": chosen, "runs": runs}))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = Parser("khepera-hil meet", "Several programs at once, each on its own robot in one world.", EPILOG)
    add = parser.add_argument
    add("programs", nargs="+", metavar="PROGRAM", help="what robot 1, robot 2 ... run: names of khepera-hil --list")
    add("--world", metavar="ARENA", help="a name of khepera-hil --list, or a TOML file (default: furnished)")
    add("--scenario", metavar="SCENARIO", help="what happens in it: a name of khepera-hil --list, or a TOML file")
    add(
        "--duration",
        type=number(0.0, 1e7, "seconds"),
        default=60.0,
        metavar="SECONDS",
        help="of the robots' time (default: %(default)g)",
    )
    add("--seed", type=seed, help="of robots, starts, arena, noise and draws (default: a new one, told)")
    add("--runs", type=Path, default=Path("runs"), metavar="DIR", help="where recordings go (default: %(default)s)")
    add("--json", action="store_true", help="the last line on standard output is the result as one JSON object")
    return parser
