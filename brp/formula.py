"""A simplified question as one reads it: the right side of equations such as E7.1 and E10.4."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from typing import TYPE_CHECKING, Any

from brp.expression import Conditional, Leaf, Node, Otherwise, Slice, Soft, Split, Sum, climb
from brp.factors import Factor, label
from brp.variables import text

if TYPE_CHECKING:
    from brp.simplification import Simplified

__all__ = ["formula", "report"]

LONG = 4000
"""A part longer than this is cut short: a thousand nested sums are not for reading."""


def formula(simplified: Simplified) -> str:
    """The expression as text, several lines where there are cases."""
    (child,) = simplified.start.children
    body = climb(_write, child, 0)
    return f"1/Σ × {body}" if simplified.division else body


def _write(here: Node, depth: int) -> Generator[tuple[Any, ...], str, str]:
    indent = "\n" + "  " * (depth + 1)
    if isinstance(here, Leaf):
        density = here.density
        return label(density.of, density.given, density.names, here.fixed)
    if isinstance(here, Soft):
        return f"({here.variable})"
    if isinstance(here, Sum) and isinstance(here.children[0], Split):
        parts = []
        for branch in here.children[0].children:
            parts.append((yield (branch, depth + 1)))
        return _short(f"[ {f'{indent}+ '.join(parts)} ]")
    if isinstance(here, Sum):
        inner = yield (here.children[0], depth + 1)
        return _short(f"Σ_{{{text(here.variables)}}} [ {inner} ]")
    if isinstance(here, Split):
        # Values next to each other that share a case share its line.
        runs: list[tuple[Any, Any, str]] = []
        for value, branch in zip(here.variable.values, here.children, strict=True):
            case = yield (branch, depth + 1)
            if runs and runs[-1][2] == case:
                runs[-1] = (runs[-1][0], value, case)
            else:
                runs.append((value, value, case))
        parts = [
            f"{here.variable} = {first if first == last else f'{first}..{last}'}: {case}"
            for first, last, case in runs
        ]
        return _short("{ " + f"{indent}; ".join(parts) + " }")
    if isinstance(here, Conditional):
        return here.name
    if isinstance(here, Otherwise):
        first, second = (yield (here.children[0], depth)), (yield (here.children[1], depth))
        return f"{{ {first}; where it is impossible {second} }}"
    if isinstance(here, Slice):
        child = here.children[0]
        depends = child.scope | (child.evidence or frozenset())
        where = ", ".join(f"{v} = {v.values[place]}" for v, place in here.fixed.items() if v in depends)
        inner = yield (child, depth)
        return f"{inner} at {where}" if where else inner
    parts = []
    for child in here.children:
        parts.append((yield (child, depth)))
    return _short(" × ".join(parts)) or "1"


def _short(words: str) -> str:
    return words if len(words) <= LONG else f"{words[: LONG // 2]} ... {words[-LONG // 2 :]}"


def report(simplified: Simplified) -> str:
    """What the symbolic phase did, a line for each thing that it did do, and what is left to compute."""
    lines = [
        ("left to compute", formula(simplified)),
        ("uniform, dropped", _listed(simplified.flat)),
        ("constant, dropped", _listed(f for f in simplified.constant if not f.vanishes)),
        ("constant, kept since it may be zero", _listed(f for f in simplified.constant if f.vanishes)),
        ("sums to 1, vanished", _listed([*simplified.beside, *simplified.vanished])),
        ("outside the sum", _listed(simplified.outside) if simplified.summed else ""),
        ("summed, in this order", _short(text(simplified.order))),
        ("largest array", f"{simplified.largest} numbers; {simplified.operations} multiplications"),
    ]
    return "\n".join(f"{what}: {which}" for what, which in lines if which)


def _listed(factors: Iterable[Factor | str]) -> str:
    return _short(", ".join(map(str, factors)))
