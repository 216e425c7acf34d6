"""``khepera-hil explain``: what spoke for a drawn value, and what against."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from brp import BrpError, Question
from khepera_hil.commands.parser import Parser, number
from khepera_hil.commands.recorded import add_run, add_runs, controller_of, opened
from khepera_hil.errors import UsageError
from khepera_hil.explain import Belief, Reason, reasons
from khepera_hil.reading import Run
from khepera_hil.recording import Tick, Value

__all__ = ["main"]

EPILOG = """\
example:
  khepera-hil explain last --at 12.3                     every draw of the tick at 12.3 s
  khepera-hil explain last --at 12.3 --variable Vrot     that of Vrot

Bits: the logarithm to base 2 of the value's probability with a term over that without it: +1 doubles it, -1 halves
it. Left out, a term counts as 1 for every value, so one that leaves this value little may still speak for it, by
leaving others less. A variable that the question did not know is told as it was before the draw was known, and
after: the value that gains most by it is the one that is answerable for the draw.
"""


def main(arguments: Sequence[str]) -> int:
    """Explain one tick."""
    parser = Parser("khepera-hil explain", "Print which terms spoke for a drawn value and which against.", EPILOG)
    add_run(parser)
    add_runs(parser)
    add = parser.add_argument
    add("--at", type=number(0.0, 1e9, "seconds"), required=True, metavar="SECONDS", help="of the run")
    add("--variable", metavar="NAME", help="the variable that was drawn (default: all)")
    add("--json", action="store_true", help="the result as one JSON object")
    asked = parser.parse_args(arguments)
    run = opened(asked)
    tick = _nearest(run, asked.at)
    found = {}
    for variable, (question, drawn) in _draws(run, tick, asked).items():
        try:
            before = {v.name: tick.draws[v.name] for v in question.known if v.name in tick.draws}
            found[variable] = list(reasons(question, drawn, {**before, **tick.evidence}))
        except (BrpError, KeyError) as error:
            raise UsageError(
                f"tick {tick.tick} cannot be asked again, the program has changed since it was recorded: {error}"
            ) from None
    if asked.json:
        told = {name: [asdict(reason) for reason in all_of_them] for name, all_of_them in found.items()}
        print(json.dumps({"run": str(run.folder), "tick": tick.tick, "t": tick.t, "draws": told}))
        return 0
    print(f"{run.name}, tick {tick.tick} at {tick.t:g} s: {_pairs(tick.evidence.items())}")
    for variable, all_of_them in found.items():
        print(f"{variable} = {tick.draws[variable]} was drawn" + _chance(tick, variable))
        for reason in all_of_them:
            _tell(reason)
    return 0


def _nearest(run: Run, at: float) -> Tick:
    best = None
    for tick in run.ticks():
        if best is not None and abs(tick.t - at) > abs(best.t - at):
            break
        best = tick
    period = float(run.manifest.get("period_s", 0.1))
    if best is None:
        raise UsageError(f"{run.name} has no ticks")
    if at > best.t + period:
        raise UsageError(f"{run.name} ends at {best.t + period:g} s, and has nothing at {at:g} s")
    return best


def _draws(run: Run, tick: Tick, asked: argparse.Namespace) -> dict[str, tuple[Question, dict[str, Value]]]:
    """For each drawn variable the question that it was drawn from, and all that was drawn from that."""
    if not tick.draws:
        why = "; ".join(text for _, text in tick.events) or "it has no readings"
        raise UsageError(f"nothing was drawn in tick {tick.tick} at {tick.t:g} s: {why}")
    found: dict[str, tuple[Question, dict[str, Value]]] = {}
    for key, question in controller_of(run).questions.items():
        names = [key] if len(question.searched) == 1 else [variable.name for variable in question.searched]
        drawn = {
            v.name: tick.draws[name] for v, name in zip(question.searched, names, strict=True) if name in tick.draws
        }
        if key in tick.u and drawn:
            found |= dict.fromkeys([name for name in names if name in tick.draws], (question, drawn))
    if asked.variable is not None:
        if asked.variable not in found:
            raise UsageError(f"{asked.variable!r} was not drawn in that tick; there is {', '.join(found)}")
        return {asked.variable: found[asked.variable]}
    # What was drawn together is explained together, once.
    seen: dict[int, str] = {}
    for name, (question, _) in found.items():
        seen.setdefault(id(question), name)
    return {name: found[name] for name in seen.values()}


def _chance(tick: Tick, variable: str) -> str:
    return f" with u = {tick.u[variable]:.4f}" if variable in tick.u else ""


def _tell(reason: Reason) -> None:
    margin = "    " * reason.depth
    where = f"where {reason.under}: " if reason.under else ""
    print(f"{margin}{where}{reason.question}" + (f"  [{_pairs(reason.known)}]" if reason.known else ""))
    best = ", ".join(f"{value} {p:.3g}" for value, p in reason.answer)
    if reason.explanation is None:
        print(f"{margin}  answers {best}")
    else:
        print(
            f"{margin}  {reason.explanation.value} has {reason.explanation.probability:.3g}; most probable: {best}"
        )
        parts = reason.explanation.contributions
        # A question of one term has nothing more to say of it.
        for part in parts if len(parts) > 1 or reason.depth == 0 else ():
            if abs(part.bits) >= 0.005:
                side = "for" if part.bits > 0 else "against"
                own = "" if part.at is None else f", which has it at {part.at:.3g}"
                print(f"{margin}  {part.bits:+8.2f} bits {side:7} by {part.term}{own}")
    for belief in reason.beliefs:
        print(f"{margin}  {_belief(belief)}")


def _belief(belief: Belief) -> str:
    before = dict(belief.before)
    most = sorted(belief.after, key=lambda share: -share[1])[:3]
    told = ", ".join(f"{value} {before[value]:.3g} -> {p:.3g}" for value, p in most)
    return f"not known, {belief.variable}: {told}   (before the draw -> after)"


def _pairs(pairs: Any) -> str:
    return " ".join(f"{name} {value}" for name, value in (pairs.items() if isinstance(pairs, Mapping) else pairs))
