"""What ``khepera-hil identify behavior`` shows: tables 2 to 7 as they were learnt, beside the published ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from brp import Term
from brp.counts import Counted
from brp.derivative import numbers
from brp.programs.behavior import TABLES, Behavior, behaving
from khepera_hil.teaching.behaviors import enough

__all__ = ["counted", "remarks", "shown"]

_NUMBERS = {term: number for number, term in TABLES.items()}


def remarks(columns: Mapping[str, Sequence[Any]]) -> list[str]:
    """How often each behavior was met. Raises UsageError for data of which nothing can be learnt."""
    met = enough(columns)
    lines = ["ticks of each behavior: " + ", ".join(f"{value} {met[value]}" for value in Behavior.values)]
    unmet = [str(value) for value in Behavior.values if not met[value]]
    if unmet:
        lines.append(
            f"never met: {', '.join(unmet)}; their columns are uniform, which lets one expect anything: "
            "teach them, or they will be chosen where they should not be"
        )
    return lines


def counted(term: Term, form: Counted) -> dict[str, Any]:
    """The table as JSON: probabilities and counts, rows of the variable, columns of the given behavior."""
    return {
        "table": _NUMBERS.get(term),
        "rows": list(term.of[0].values),
        "columns": list(term.given[0].values),
        "p": [[round(float(p), 6) for p in row] for row in form.probabilities(term)],
        "counts": form.counts.tolist(),
    }


def shown(term: Term, form: Counted) -> list[str]:
    """The table, the published number behind each learnt one."""
    p, published = form.probabilities(term), numbers(behaving, term)
    number = _NUMBERS.get(term)
    lines = ["", f"{term}, table {number}: learnt (published)"]
    lines.append(f"  {'':18}" + "".join(f"{value:>18}" for value in term.given[0].values))
    for row, value in enumerate(term.of[0].values):
        cells = "".join(f"{p[row, k]:10.4f} ({published[row, k]:.3f})" for k in range(p.shape[1]))
        lines.append(f"  {value!s:18}{cells}")
    seen = form.counts.sum(axis=0)
    lines.append(f"  {'from data':18}" + "".join(f"{n:18g}" for n in np.asarray(seen)))
    return lines
