"""``khepera-hil identify``: what a specification learns from data sets, looked at and saved (section 5.3)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp import BrpError, Description, P, Specification, Term, Variable
from brp.counts import Counted
from brp.gaussian import Taught
from brp.programs.behavior import pi_behavior_taught
from brp.programs.home import Dir, H, Prox, Theta1, Vrot
from brp.programs.obstacle import obstacle
from brp.programs.phototaxy import pi_phototaxy1
from brp.store import save
from khepera_hil.commands.identified import counted, remarks, shown
from khepera_hil.commands.parser import Parser, existing_name
from khepera_hil.errors import RecordingError, UsageError
from khepera_hil.teaching.dataset import data_set, joined, learnt
from khepera_hil.teaching.hidden import learnt_home, weights

__all__ = ["SPECIFICATIONS", "main"]

SPECIFICATIONS: Mapping[str, Specification] = MappingProxyType(
    {"obstacle": obstacle, "phototaxy": pi_phototaxy1, "behavior": pi_behavior_taught}
)
"""What data can be looked at with, by the command line's name; and ``home``, of which P(H | Prox) is learnt."""

EPILOG = """\
DATA is a data set's file, the name of one that comes with brp (delta-push), or the folder of a recorded run;
several are joined. DATA@5-20 is the seconds 5 to 20 of it, DATA@5- all from 5 on.

examples:
  khepera-hil identify obstacle --data delta-push
  khepera-hil identify obstacle --data one.json two.json@0-15 --join both.json --out push.description.json
  khepera-hil --program push --data push.description.json
  khepera-hil --program watchman --labels        on the emulator or a robot; say by the keys 1 to 6 what it is to do
  khepera-hil identify behavior --data RUN RUN --labelled --out behavior.description.json
  khepera-hil --program watchman --data behavior.description.json

behavior: tables 2 to 7 of the paper, by Laplace's rule, so that nothing is impossible by accident; from runs of a
watchman, by what it drew and what an operator said (--labelled: by his word alone).
"""


def main(arguments: Sequence[str]) -> int:
    """Read, identify, show, and save where that was asked for."""
    asked = _parser().parse_args(arguments)
    existing_name("specification", asked.specification, [*SPECIFICATIONS, "home"])
    hidden = asked.specification == "home"
    variables = [Dir, Prox, Theta1, Vrot] if hidden else learnt(SPECIFICATIONS[asked.specification])
    if asked.labelled and asked.specification != "behavior":
        raise UsageError(f"--labelled is about behavior, not {asked.specification}: only Behavior is labelled")
    sets = [data_set(source, variables, labelled=asked.labelled) for source in asked.data]
    data = joined(sets, asked.name)
    try:
        if hidden:
            description = learnt_home(data.columns)
        else:
            description = SPECIFICATIONS[asked.specification].identify(dict(data.columns), name=data.name)
    except BrpError as error:
        raise UsageError(f"nothing can be learnt from these data: {error}") from None
    for path in (asked.join, asked.out):
        if path is not None and path.exists() and not asked.force:
            raise UsageError(f"{path} is there already: choose another name, or say --force")
    print(f"{description}: {len(data)} data from {', '.join(asked.data)}")
    found: dict[str, Any] = {}
    if hidden:
        found[str(P(H | Prox))] = _weights(description, data.columns["Prox"])
    behaviors = asked.specification == "behavior"
    if behaviors:
        print("\n".join(remarks(data.columns)))
    for term in description.specification.free:
        form = description[term]
        if behaviors and isinstance(form, Counted):
            found[str(term)] = counted(term, form)
            print("\n".join(shown(term, form)))
        if isinstance(form, Taught):
            found[str(term)] = _learnt(term, form)
            _show(term, form)
    if asked.join is not None:
        data.save(variables, asked.join)
        print(f"data set in {asked.join}")
    if asked.out is not None:
        _save(description, asked.out)
        print(f"description in {asked.out}")
    if asked.json:
        print(json.dumps({"description": str(description), "data": len(data), "terms": found}))
    return 0


def _weights(description: Description, visited: Sequence[int]) -> dict[str, Any]:
    """P(avoidance | Prox), found although H is in no datum."""
    print("P(H | Prox), H never observed:\n\n     Prox   data   P(avoidance)")
    rows = []
    for prox, weight in zip(Prox.values, weights(description), strict=True):
        rows.append({"Prox": prox, "count": list(visited).count(int(prox)), "avoidance": round(float(weight), 4)})
        print(f"  {prox:7}  {rows[-1]['count']:5}   {weight:12.2f}")
    print()
    return {"cells": rows}


def _save(description: Description, path: Path) -> None:
    try:
        save(description, path)
    except OSError as error:
        raise RecordingError(f"the description {path} cannot be written: {error.strerror or error}") from None


def _learnt(term: Term, form: Taught) -> dict[str, Any]:
    mean, deviation = form.parameters(term)
    visited = form.count > 0
    cells = [
        {
            **{v.name: v.values[place] for v, place in zip(term.given, where, strict=True)},
            "count": int(form.count[tuple(where)]),
            "mean": round(float(mean[tuple(where)]), 4),
            "deviation": round(float(deviation[tuple(where)]), 4),
        }
        for where in np.argwhere(visited).tolist()
    ]
    return {"visited": len(cells), "unvisited": int((~visited).sum()), "cells": cells}


def _show(term: Term, form: Taught) -> None:
    mean, deviation = form.parameters(term)
    visited = form.count > 0
    print(f"{term}: {int(visited.sum())} of {visited.size} situations visited, {int((~visited).sum())} unvisited")
    for title, numbers in (
        ("count", form.count),
        ("mean", mean),
        (f"standard deviation (never below {form.form.floor:g})", deviation),
    ):
        print(f"\n{title} of {term.of[0]}")
        digits = 1 if numbers is deviation else 0
        for line in _grid(term.given, np.where(visited, numbers, np.nan), digits):
            print(f"  {line}")
    print()


def _grid(given: tuple[Variable, ...], numbers: NDArray[np.float64], digits: int) -> list[str]:
    """A line for each value of the first variable, a column for each of the last; unvisited cells are dots."""
    rows = numbers if numbers.ndim == 2 else numbers[None, :]
    across = given[-1]
    down = [f"{given[0]} {value}" for value in given[0].values] if numbers.ndim == 2 else [""]
    left = max(map(len, down))
    wide = 5
    # A long axis is broken, so that a line fits a terminal.
    lines = []
    for first in range(0, len(across), 21):
        part = range(first, min(first + 21, len(across)))
        lines.append(f"{across.name:>{left}} " + "".join(f"{across.values[k]:>{wide}}" for k in part))
        for name, row in zip(down, rows, strict=True):
            cells = "".join(f"{_number(row[k], digits):>{wide}}" for k in part)
            lines.append(f"{name:>{left}} {cells}")
    return lines


def _number(number: float, digits: int) -> str:
    return "." if np.isnan(number) else f"{round(number, digits) + 0.0:.{digits}f}"


def _parser() -> Parser:
    parser = Parser("khepera-hil identify", "What a specification learns from data sets.", EPILOG)
    add = parser.add_argument
    add("specification", metavar="SPECIFICATION", help=", ".join([*SPECIFICATIONS, "home"]))
    add("--data", nargs="+", required=True, metavar="DATA", help="where the data are")
    add("--labelled", action="store_true", help="behavior: only the ticks in which an operator said what it is")
    add("--name", help="of the data set (default: the first one's)")
    add("--out", type=Path, metavar="FILE", help="save the description")
    add("--join", type=Path, metavar="FILE", help="save the data as one data set")
    add("--force", action="store_true", help="write also where a file is already")
    add("--json", action="store_true", help="the last line on standard output is what was learnt, as JSON")
    return parser
