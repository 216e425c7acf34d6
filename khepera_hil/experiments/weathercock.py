"""How often the watchman would change its mind (section 9.5), computed from pi-behavior alone, and lesson 9's
count.

Behavior is drawn each tick from P(Behavior | ... Behavior_t-1), the evidence staying as it is: a Markov chain,
whose changes a minute are exact.
"""

from __future__ import annotations

import numpy as np

from brp import Question
from brp.programs.behavior import (
    Base,
    Behavior,
    Energy,
    Fire,
    Identify,
    Vigil,
    behaving,
    behavior,
    pi_behavior,
    steadier,
)
from brp.variables import P

__all__ = ["changes", "entries", "table"]

_A_MINUTE = 600.0  # ticks

_forgetful = behaving.ask(P(Behavior | Vigil, Energy, Base, Fire, Identify))


def changes(question: Question, energy: str, *, every: int = 1) -> float:
    """Changes of Behavior a minute, out on patrol with Vigil, when it is decided every so many ticks."""
    told = {"Vigil": True, "Energy": energy, "Base": False, "Fire": False, "Identify": False}
    kernel = np.array(
        [
            question(**told, Behavior_t_1=b).p if len(question.known) == 6 else question(**told).p
            for b in Behavior.values
        ]
    )
    # The chain's long run, begun on patrol.
    p = np.zeros(len(Behavior))
    p[Behavior.place("patrol")] = 1
    for _ in range(20_000):
        p = p @ kernel
    return float(p @ (1 - np.diag(kernel)) * _A_MINUTE / every)


def entries() -> tuple[int, int]:
    """Lesson 9: numbers in the tables of pi-behavior, and in one table of P(Behavior | all that it knows)."""
    variables = {v for term in pi_behavior.terms for v in term.variables}
    tables = sum(int(np.prod([len(v) for v in term.variables])) for term in pi_behavior.terms if term.given)
    return tables, int(np.prod([len(v) for v in variables]))


def table() -> list[str]:
    """Both, as lines."""
    ways: list[tuple[str, Question, int]] = [
        ("the tables as printed", behavior, 1),
        ("decided once a second", behavior, 10),
        ("diagonal of table 2 at .99", steadier(0.99), 1),
        ("diagonal of table 2 at .999", steadier(0.999), 1),
        ("without Behavior_t-1 at all", _forgetful, 1),
    ]
    lines = ["changes of Behavior a minute, out with Vigil (exact), by Energy:"]
    lines.append(f"  {'':30}" + "".join(f"{level:>11}" for level in Energy.values))
    for name, question, every in ways:
        found = (changes(question, str(level), every=every) for level in Energy.values)
        lines.append(f"  {name:30}" + "".join(f"{value:11.2f}" for value in found))
    few, many = entries()
    lines.append(f"entries of tables (lesson 9): {few} by inverse programming, {many} in one table of all")
    return lines
