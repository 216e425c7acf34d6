"""``khepera-hil replay``: ask a recorded run again."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import mean
from typing import Any

from khepera_hil.commands.parser import Parser, number
from khepera_hil.commands.recorded import add_run, add_runs, controller_of, learning_of, make, opened
from khepera_hil.errors import UsageError
from khepera_hil.otherwise import Beside, beside, with_data, with_program, with_questions
from khepera_hil.reading import Run
from khepera_hil.recording import Tick
from khepera_hil.replay import TOLERANCE, Replay, answered, replay

__all__ = ["main"]

EPILOG = f"""\
examples:
  khepera-hil replay last                     does every question still answer as it did, to the bit?
  khepera-hil replay last --program avoid     what avoid would have done on the same readings
  khepera-hil replay last --data push.json    what the program would have done with other data (a file of brp's)

Every question is asked again with the evidence of the log, and every draw made again with its uniform number. A
distribution is the same when the hash of its float64 values is; between versions of numpy it may differ in the last
bits, and then its sketch (one number in the log) may differ by {TOLERANCE:g}.

exit codes: 0 the same (or, with --program or --data, shown)  1 something differs  2 wrong arguments  6 damaged
"""


def main(arguments: Sequence[str]) -> int:
    """Ask again and compare, or ask somebody else and show both."""
    asked = _parser().parse_args(arguments)
    run = opened(asked)
    if asked.program is not None and asked.data is not None:
        raise UsageError("--program and --data are two questions; ask one of them at a time")
    if asked.program is not None or asked.data is not None:
        return _otherwise(asked, run)
    return _again(asked, run)


def _again(asked: argparse.Namespace, run: Run) -> int:
    controller = controller_of(run)
    found = replay(run, controller.questions, learning_of(controller))
    if asked.json:
        print(json.dumps(_result(run, found)))
        return 0 if found.same else 1
    print(f"{run.name}: {found.ticks} ticks, asked again")
    for one in found.asked.values():
        near = f", {one.near} within {TOLERANCE:g} (worst {one.worst:.1g})" if one.near else ""
        draws = f", {one.draws} draws" if one.draws else ""
        print(
            f"  {one.name}: {one.answers} answers{draws}, {one.same} to the bit{near}, "
            f"{one.different or int(one.differs is not None)} different"
        )
    if found.first is None:
        print("the same")
        return 0
    tick, t, name, why = found.first
    print(f"different, first at tick {tick} ({t:g} s) in {name}: {why}")
    return 1


def _result(run: Run, found: Replay) -> dict[str, Any]:
    first = None
    if found.first is not None:
        first = dict(zip(("tick", "t", "question", "why"), found.first, strict=True))
    questions = {
        one.key: {
            "answers": one.answers,
            "same": one.same,
            "near": one.near,
            "draws": one.draws,
            "different": one.different,
            "worst": one.worst,
        }
        for one in found.asked.values()
    }
    return {
        "run": str(run.folder),
        "ticks": found.ticks,
        "same": found.same,
        "first": first,
        "questions": questions,
    }


def _otherwise(asked: argparse.Namespace, run: Run) -> int:
    then = controller_of(run)
    learning = learning_of(then)
    if asked.program is not None:
        other = make(asked.program)
        name, ticks = asked.program, with_program(run, other)
    else:
        others = with_data(then.questions, asked.data)
        # A question that has other data now learns nothing of what was met with the old ones.
        kept = {key: learn for key, learn in learning.items() if others[key] is then.questions[key]}
        name, ticks = str(asked.data), with_questions(run, others, kept)
    recorded = answered(run, then.questions, learning)
    sums = _show(asked, name, run, recorded, ticks)
    if asked.json:
        result = {
            "run": str(run.folder),
            "beside": name,
            "ticks": sums.ticks,
            "same_draws": sums.agree,
            "same_commands": sums.commands,
            "apart": {key: mean(values) for key, values in sums.apart.items()},
            "first": None if sums.first is None else dict(zip(("tick", "t"), sums.first, strict=True)),
        }
        print(json.dumps(result))
        return 0
    _sums(sums, name, run)
    return 0


def _show(
    asked: argparse.Namespace, name: str, run: Run, recorded: Iterator[Tick], ticks: Iterator[Tick]
) -> Beside:
    """Print both side by side, a line every ``--every`` seconds; the sums."""
    sums, due = Beside(), 0.0
    if not asked.json:
        print(f"{'':>8}  {run.program + ', as recorded':<52}{name}")
    for here, there in beside(recorded, ticks, sums):
        if not asked.json and here.t >= due - 1e-9:
            due = here.t + asked.every
            print(f"{here.t:6.1f} s  {_line(here):<52}{_line(there)}".rstrip())
    return sums


def _line(tick: Tick) -> str:
    if not tick.draws:
        return "no data"
    known = " ".join(f"{name} {value}" for name, value in tick.evidence.items())
    drawn = " ".join(f"{name} {value}" for name, value in tick.draws.items())
    sent = "" if tick.command is None else ", wheels {} {}".format(*tick.command)
    return f"{known} -> {drawn}{sent}"


def _sums(sums: Beside, name: str, run: Run) -> None:
    if not sums.ticks:
        print("there is no tick in which both would have decided")
        return
    print(f"in {sums.ticks} ticks in which both decided:")
    for variable, alike in sums.agree.items():
        print(f"  {variable} drawn alike in {alike} ({alike / sums.ticks:.0%})")
    for key, values in sums.apart.items():
        print(
            f"  {key}: the distributions are apart by {mean(values):.3f} on average, at most {max(values):.3f} "
            "(0 the same, 1 nothing in common)"
        )
    if sums.first is None:
        print(f"{name} would have done the same")
    else:
        print("first otherwise at tick {} ({:g} s)".format(*sums.first))


def _parser() -> Parser:
    parser = Parser("khepera-hil replay", "Ask every question of a recorded run again, and compare.", EPILOG)
    add_run(parser)
    add_runs(parser)
    add = parser.add_argument
    add("--program", metavar="NAME", help="ask another program what it would have done on the same readings")
    add("--data", type=Path, metavar="FILE", help="ask the program with other data, a file of brp's")
    add(
        "--every",
        type=number(0.0, 1e7, "seconds"),
        default=5.0,
        metavar="SECONDS",
        help="side by side, a line so often (default: %(default)g)",
    )
    add("--json", action="store_true", help="the result as one JSON object")
    return parser
