"""``khepera-hil runs``: what has been recorded."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from khepera_hil.commands.parser import Parser
from khepera_hil.commands.recorded import add_runs
from khepera_hil.commands.scored import scored
from khepera_hil.errors import RecordingError
from khepera_hil.reading import Run, recorded

__all__ = ["main"]

EPILOG = """\
example:
  khepera-hil runs                  every run in runs/, the latest last
  khepera-hil runs --json           one JSON object a line

A run ended by its duration, by a signal (Ctrl-C) or by an error; killed: the process died, and the log is whole up
to then; going on: it is being recorded. The score is what the emulated world saw; a real robot has none.
"""


def main(arguments: Sequence[str]) -> int:
    """List them."""
    parser = Parser("khepera-hil runs", "List recorded runs: program, seed, length, how they ended, score.", EPILOG)
    add_runs(parser)
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    asked = parser.parse_args(arguments)
    found = [_summary(run) if isinstance(run, Run) else {"damaged": str(run)} for run in recorded(asked.runs)]
    if asked.json:
        for line in found:
            print(json.dumps(line))
    elif not found:
        print(f"no runs in {asked.runs}")
    else:
        _table(found)
    return 0


def _summary(run: Run) -> dict[str, Any]:
    ending = run.manifest.get("ending")
    about = {"run": run.name, "program": run.program, "seed": run.manifest.get("seed")}
    about["started"] = run.manifest.get("started")
    try:
        last = run.last_row()
        # From the start to the end of the last tick's period.
        length = 0.0 if last is None else float(last["t"]) + float(run.manifest.get("period_s", 0.1))
    except (RecordingError, KeyError, TypeError, ValueError) as error:
        return about | {"damaged": str(error)}
    if ending:
        ended = str(ending.get("error") or ending.get("stop") or "?")
    else:
        ended = "going on" if run.going_on else "killed"
    score = (ending or {}).get("score") or {}
    return about | {"length_s": round(length, 3), "ended": ended, "score": score}


def _table(found: list[dict[str, Any]]) -> None:
    rows = [("run", "program", "seed", "length", "ended", "score")]
    for line in found:
        if "damaged" in line:
            continue
        score = scored(line["score"])
        told = (line["run"], line["program"], str(line["seed"]), f"{line['length_s']:.1f} s", line["ended"], score)
        rows.append(told)
    widths = [max(len(row[i]) for row in rows) for i in range(5)]
    if len(rows) > 1:
        for row in rows:
            cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
            print("  ".join([*cells, row[5]]).rstrip())
    for line in found:
        if "damaged" in line:
            print(f"damaged: {line['damaged']}")
