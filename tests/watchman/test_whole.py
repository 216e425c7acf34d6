"""The whole distribution as a memory: a filter, held against one that is written out path by path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from brp import Value
from brp.programs.base import at_base
from brp.programs.behavior import (
    Behavior,
    Behavior_t_1,
    Energy,
    behaving,
    table_3,
    table_4,
    table_5,
    table_6,
    table_7,
)
from brp.programs.move import QUOTA, Move, move
from brp.variables import P
from khepera_hil.controllers.watchman_whole import WholeMind
from tests.watchman.evidence import AT_BASE, sensed

of_behavior = behaving.ask(P(Behavior | Behavior_t_1))
Belief = dict[tuple[str, str, int], float]
"""Of Behavior, Move and its age."""


def likely(table: Sequence[Sequence[object]], row: int, behavior: str) -> float:
    """An entry of tables 3 to 7; an x is an equal share of what its column leaves."""
    column = [line[Behavior.place(behavior)] for line in table]
    known = sum(float(str(entry)) for entry in column if entry != "x")
    entry = column[row]
    return (1 - known) / column.count("x") if entry == "x" else float(str(entry))


def page(belief: Belief, evidence: dict[str, Value]) -> Belief:
    """One tick, every pair of before and now."""
    base = at_base(**{v.keyword: evidence[v.name] for v in at_base.known})
    kernel: dict[tuple[str, str], float] = {}
    for at in (False, True):
        weights = {}
        for before in Behavior.values:
            for now in Behavior.values:
                p = of_behavior(Behavior_t_1=before)[now]
                p *= likely(table_3, int(bool(evidence["Vigil"])), str(now))
                p *= likely(table_4, Energy.place(evidence["Energy"]), str(now))
                p *= likely(table_5, int(at), str(now))
                p *= likely(table_6, int(bool(evidence["Fire"])), str(now))
                p *= likely(table_7, int(bool(evidence["Identify"])), str(now))
                weights[str(before), str(now)] = p
        total = sum(p * weights[b, str(now)] for (b, _, _), p in belief.items() for now in Behavior.values)
        for (before, now), p in weights.items():
            share = (
                p / total if total else sum(weights[str(b), now] for b in Behavior.values) / sum(weights.values())
            )
            kernel[before, now] = kernel.get((before, now), 0) + base[at] * share
    after: Belief = {}
    for (before, last, age), p in belief.items():
        tempo = "elapsed" if age >= QUOTA.get(last, 10**9) else "running"
        for now in map(str, Behavior.values):
            moves = move(Behavior=now, Move_t_1=last, Tempo=tempo, Tour=evidence["Tour"])
            for m in map(str, Move.values):
                key = (now, m, age + 1 if m == last else 1)
                after[key] = after.get(key, 0) + p * kernel[before, now] * moves[m]
    return after


@pytest.mark.parametrize("lift", [False, True])
def test_the_belief_is_that_of_all_paths(lift: bool) -> None:
    ticks = [sensed(Energy="low")] * 21 + [sensed(AT_BASE, Energy="very-low")] * 3 + [sensed(Energy="low")] * 3
    if lift:  # an idle robot, its vigil off, is lifted off its base: an impossible row
        ticks = [sensed(AT_BASE, Vigil=False)] * 5 + [sensed(Vigil=False)] * 3
    mind = WholeMind()
    rng = np.random.default_rng(1)
    belief: Belief = {("homing", "stop", 1): 1.0}
    for evidence in ticks:
        thought = mind.think(evidence, rng, arrived=False)
        belief = page(belief, evidence)
        both = np.zeros((6, 6))
        for (b, m, _), p in belief.items():
            both[Behavior.place(b), Move.place(m)] += p
        np.testing.assert_allclose(mind.joint, both, atol=1e-12)
        np.testing.assert_allclose(thought.answers["Move"].p, both.sum(axis=0), atol=1e-12)
    assert mind.joint.sum() == pytest.approx(1)


def test_a_lifted_robot_does_not_stay_idle() -> None:
    mind = WholeMind()
    rng = np.random.default_rng(2)
    for _ in range(20):
        mind.think(sensed(AT_BASE, Vigil=False), rng, arrived=False)
    thought = mind.think(sensed(Vigil=False), rng, arrived=False)
    assert thought.behavior == "homing"


def test_the_motors_are_the_mixture_of_the_six_movements() -> None:
    mind = WholeMind()
    rng = np.random.default_rng(3)
    for _ in range(130):
        thought = mind.think(sensed(Prox=3, Dir=-2), rng, arrived=False)
    moves = thought.answers["Move"]
    assert 0.05 < moves["stop"] < 0.95  # after a while it both wanders and stops
    motors = thought.answers["Vrot Vtrans"]
    still = motors[0, 0]
    assert still == pytest.approx(moves["stop"], abs=0.01)
