"""``khepera-hil paper``: the paper's experiments, sections 5 to 10: run, measured, shown."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

from khepera_hil.commands.beside import BESIDE, add_beside
from khepera_hil.commands.parser import Parser, existing_name, number
from khepera_hil.commands.plan_file import planned, saved
from khepera_hil.errors import UsageError
from khepera_hil.experiments import watchman
from khepera_hil.experiments.campaign import progress_stream, run
from khepera_hil.experiments.campaign import table as kept
from khepera_hil.experiments.experiment import Experiment, Report
from khepera_hil.experiments.figures import table
from khepera_hil.experiments.page import written
from khepera_hil.experiments.registry import EXPERIMENTS

__all__ = ["main"]

EPILOG = """\
Each prints its figures with 95 % intervals, beside what the paper says and what is to be reached, and leaves
pictures and a recording for rerun in its folder. Results are written there as they come, as parquet. Ctrl-C
interrupts; the same command goes on where it was. What is to be run can stand in a small file, the plan
(docs/campaigns.md); words beside --plan go before what it says.

examples:
  khepera-hil paper --list
  khepera-hil paper push avoid --seeds 20
  khepera-hil paper all --seeds 100 --json
  khepera-hil paper stability --seeds 12 --amount 1
  khepera-hil paper learnt --data behavior.description.json --seeds 20
  khepera-hil paper watchman --hours 30 --days 3 --seeds 100 --save-plan fair.toml
  khepera-hil paper --plan fair.toml
  khepera-hil paper --plan fair.toml --scheduler tcp://HOST:8786
"""


def main(arguments: Sequence[str]) -> int:
    """Run the experiments that were asked for, one after the other."""
    parser = _parser()
    asked = parser.parse_args(arguments)
    if asked.plan is not None:
        asked = planned(parser, asked.plan, arguments)
    if asked.list:
        for experiment in EXPERIMENTS.values():
            print(f"  {experiment.name:11} {experiment.about} (section {experiment.section})")
        print("beside these, and not among all:")
        for name, (about, _) in BESIDE.items():
            print(f"  {name:11} {about}")
        return 0
    names = list(EXPERIMENTS) if asked.names == ["all"] else list(dict.fromkeys(asked.names))
    if not names:
        raise UsageError("say which experiment, or all, or --plan FILE; khepera-hil paper --list has them")
    for name in names:
        existing_name("experiment", name, [*EXPERIMENTS, *BESIDE])
    beside = {name: BESIDE[name][1](asked) for name in names if name in BESIDE}
    if asked.save_plan is not None:
        saved(parser, asked, asked.save_plan)
        print(f"the plan is in {asked.save_plan}: khepera-hil paper --plan {asked.save_plan}")
        return 0
    seeds = range(asked.first, asked.first + asked.seeds)
    found: dict[str, Any] = {}
    try:
        for name in names:
            experiment = beside[name] if name in beside else EXPERIMENTS[name]
            if name == "watchman" and (asked.hours or asked.nights is not None):
                experiment = watchman.experiment(asked.hours, asked.nights or 0, asked.record, asked.days)
            found[name] = _one(experiment, seeds, asked)
    except KeyboardInterrupt:
        print("interrupted: what was measured is kept, the same command goes on from there", file=sys.stderr)
        return 130
    if asked.json:
        figures = {figure: row for one in found.values() for figure, row in one["figures"].items()}
        print(json.dumps({"experiments": found, "figures": figures, "seeds": [seeds[0], seeds[-1]]}))
    return 0


def _one(experiment: Experiment, seeds: range, asked: argparse.Namespace) -> dict[str, Any]:
    began = time.monotonic()
    folder = asked.out / experiment.name
    cases = experiment.cases(seeds)
    results = run(
        experiment.name,
        experiment.trial,
        cases,
        folder,
        workers=asked.jobs,
        scheduler=asked.scheduler,
        fresh=asked.fresh,
        progress=progress_stream(),
    )
    report = experiment.report(cases, results)
    # With --json standard output is the one object, and nothing beside it.
    out = sys.stderr if asked.json else sys.stdout
    if asked.markdown:
        print(
            "\n".join([f"### {experiment.name}, seeds {seeds[0]} to {seeds[-1]}", "", *_markdown(report)]), file=out
        )
    else:
        _print(experiment, seeds, report, out)
    files: list[Path] = []
    if not asked.no_show:
        shown = experiment.show(folder)
        files = [*shown.files, *written(experiment, seeds, report, shown.pictures, folder)]
    if not asked.markdown:
        for path in files:
            print(f"  to look at: {path}", file=out)
        took = time.monotonic() - began
        if cases:
            print(f"  results: {kept(experiment.trial, folder)}", file=out)
        print(f"  {len(cases)} trials, {took:.0f} s", file=out)
    print(file=out, flush=True)
    prefix = f"{experiment.name}: "
    figures = {prefix + figure.name: figure.row() for figure in report.figures}
    return {"figures": figures, "files": list(map(str, files))}


def _print(experiment: Experiment, seeds: range, report: Report, out: TextIO | None) -> None:
    about = f"{experiment.name}: {experiment.about} (section {experiment.section})"
    print(f"{about}, seeds {seeds[0]} to {seeds[-1]}", file=out)
    for figure in report.figures:
        print(figure.line(), file=out)
    for line in report.lines:
        print(line, file=out)


def _markdown(report: Report) -> list[str]:
    """The figures as a table, and the lines beside them, as docs/paper.md has them."""
    lines = table(report.figures) if report.figures else []
    return [*lines, *(["", "```", *report.lines, "```"] if report.lines else [])]


def _parser() -> Parser:
    parser = Parser("khepera-hil paper", "The paper's experiments, sections 5 to 10.", EPILOG)
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="see --list; or all")
    add("--list", action="store_true", help="list the experiments, and end")
    add("--seeds", type=_count, default=5, metavar="N", help="how many (default: %(default)s)")
    add("--first", type=_count, default=1, metavar="SEED", help="the first of them (default: %(default)s)")
    add("--plan", type=Path, metavar="FILE", help="what to run, as a plan file")
    add("--save-plan", type=Path, metavar="FILE", help="write a plan of what is asked by these words, and end")
    add("--hours", type=number(0, 10_000, "hours"), default=0.0, help="watchman: so long a fair")
    add(
        "--days",
        type=_count,
        default=watchman.DAYS,
        metavar="N",
        help="watchman: in so many days, each a trial of its own (default: %(default)s)",
    )
    add("--nights", type=_count, metavar="N", help="watchman: so many short nights")
    add("--record", type=Path, metavar="DIR", help="watchman: record the fair's days there")
    add("--jobs", type=_count, metavar="N", help="processes at a time (default: one for each core)")
    add("--scheduler", metavar="ADDRESS", help="run on a dask cluster instead, such as tcp://HOST:8786")
    add("--out", type=Path, default=Path("runs/paper"), metavar="DIR", help="(default: %(default)s)")
    add("--fresh", action="store_true", help="measure anew what was measured before")
    add("--no-show", action="store_true", help="figures only, no pictures and recordings")
    add("--markdown", action="store_true", help="the figures as tables in Markdown")
    add("--json", action="store_true", help="all figures as one JSON object; the rest goes to standard error")
    add_beside(parser)
    return parser


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 100_000:
        raise argparse.ArgumentTypeError(f"{text!r} is no number from 1 to 100000")
    return int(text)
