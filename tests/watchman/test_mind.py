"""Late, early and between: the same law for the motors, and a memory that fits them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from brp import Description, Distribution, Value
from brp.programs.beacon import locate_beacon
from brp.programs.watchman import O, Sensory_variables, Vrot, Vtrans, pi_watchman
from brp.variables import P
from khepera_hil.controllers.watchman_mind import EARLY, INTERNAL, LATE, MOTORS, REMEMBERED, Mind
from tests.watchman.evidence import AT_BASE, OUTSIDE, sensed

MOUTH = OUTSIDE | dict(zip((f"L{i}" for i in range(1, 9)), (330, 300, 280, 250, 260, 330, 400, 400), strict=True))
"""Half in the light of the base."""

SITUATIONS = [
    sensed(),
    sensed(Move_t_1="wander", Tempo="elapsed", Prox=9, Dir=2),
    sensed(MOUTH, Vigil=False, Behavior_t_1="homing", Move_t_1="home", Prox=8, Dir=-4),
    sensed(Fire=True, Behavior_t_1="fire-intervention", Move_t_1="approach", Tempo="elapsed", DirL=4, ProxL=9),
    sensed(AT_BASE, Energy="low", Behavior_t_1="recharge", Move_t_1="home", Prox=10, Dir=1),
    sensed(Identify=True, Energy="low", Behavior_t_1="patrol", Prox=5, Dir=7),
]


@pytest.fixture(scope="module")
def watching() -> Description:
    return pi_watchman(locate=locate_beacon).identify()


def answer(mind: Mind, key: str, known: dict[str, Value]) -> Distribution:
    return mind.questions[key](**{v.keyword: known[v.name] for v in mind.questions[key].known})


def drawn_early(mind: Mind, evidence: dict[str, Value], count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """How often each (Vrot, Vtrans) comes of ``count`` times the six draws of section 10.4, shape (21, 11)."""
    groups: list[tuple[dict[str, Value], int]] = [(evidence, count)]
    for v in INTERNAL:
        after: list[tuple[dict[str, Value], int]] = []
        for known, many in groups:
            p = answer(mind, v.name, known).p
            places = np.searchsorted(np.cumsum(p), rng.random(many) * p.sum(), "right").clip(max=len(p) - 1)
            found, often = np.unique(places, return_counts=True)
            after += [
                (known | {v.name: v.values[int(place)]}, int(n)) for place, n in zip(found, often, strict=True)
            ]
        groups = after
    counts = np.zeros((len(Vrot), len(Vtrans)), dtype=np.intp)
    for known, many in groups:
        p = answer(mind, MOTORS, known).p.ravel()
        places = np.searchsorted(np.cumsum(p), rng.random(many) * p.sum(), "right").clip(max=p.size - 1)
        counts += np.bincount(places, minlength=p.size).reshape(counts.shape)
    return counts


@pytest.mark.parametrize("situation", range(len(SITUATIONS)))
def test_a_hundred_thousand_early_draws_have_the_late_distribution(watching: Description, situation: int) -> None:
    evidence = SITUATIONS[situation]
    late = answer(Mind(watching, LATE), MOTORS, evidence).p.ravel()
    counts = drawn_early(Mind(watching, EARLY), evidence, 100_000, np.random.default_rng(situation)).ravel()
    assert counts.sum() == 100_000
    assert not counts[late == 0].any()
    often = late * 100_000 >= 5
    expected = np.append(late[often], late[~often].sum()) * 100_000
    seen = np.append(counts[often], counts[~often].sum())
    kept = expected > 1e-6
    statistic = ((seen - expected)[kept] ** 2 / expected[kept]).sum()
    assert chi2.sf(statistic, kept.sum() - 1) > 1e-4


@pytest.mark.parametrize("names", [("Move",), ("Behavior",), ("Base", "Theta2"), ("H", "Behavior"), EARLY])
def test_whatever_is_drawn_before_the_motors_their_law_is_the_late_one(
    watching: Description, names: tuple[str, ...]
) -> None:
    """Exactly: the answers given what was drawn, weighed by how probable it was, are E10.4."""
    late, between = Mind(watching, LATE), Mind(watching, names)
    for evidence in SITUATIONS:
        weighed = [(evidence, 1.0)]
        for v in INTERNAL:
            if v.name in names:
                weighed = [
                    (known | {v.name: value}, weight * p)
                    for known, weight in weighed
                    for value, p in zip(v.values, answer(between, v.name, known).p, strict=True)
                    if weight * p > 1e-12
                ]
        mixed = sum(weight * answer(between, MOTORS, known).p for known, weight in weighed)
        np.testing.assert_allclose(mixed, answer(late, MOTORS, evidence).p, atol=1e-9)


def test_what_is_remembered_is_drawn_given_the_motors(watching: Description) -> None:
    """Over all motors it is P(Behavior Move | Sensory-variables); for wheels that turn it is no stop."""
    mind = Mind(watching, LATE)
    for evidence in SITUATIONS:
        motors = answer(mind, MOTORS, evidence)
        remembered = np.zeros((6, 6))
        for vrot in Vrot.values:
            for vtrans in Vtrans.values:
                p = motors[vrot, vtrans]
                if p > 1e-13:
                    remembered += p * answer(mind, REMEMBERED, evidence | {"Vrot": vrot, "Vtrans": vtrans}).p
        np.testing.assert_allclose(remembered.sum(axis=1), answer(mind, "Behavior", evidence).p, atol=1e-9)
        np.testing.assert_allclose(remembered.sum(axis=0), answer(mind, "Move", evidence).p, atol=1e-9)
    wandering = SITUATIONS[1]
    assert answer(mind, "Move", wandering)["stop"] > 0.02
    turning = answer(mind, REMEMBERED, wandering | {"Vrot": -3, "Vtrans": 5})
    assert turning.p[:, 0].sum() == 0


def test_o_leaves_the_sum_as_a_factor(watching: Description) -> None:
    """E10.3 is P(Vrot Vtrans | Sensory-variables) times P(O | Nlt Nrt Per Lrl)."""
    whole = watching.ask(P(Vrot, Vtrans, O | Sensory_variables))
    mind = Mind(watching, LATE)
    for evidence in SITUATIONS:
        e10_3 = whole(**{v.keyword: evidence[v.name] for v in Sensory_variables})
        np.testing.assert_allclose(e10_3.p.sum(axis=2), answer(mind, MOTORS, evidence).p, atol=1e-12)
        parts = e10_3.p.sum(axis=2)[..., None] * e10_3.p.sum(axis=(0, 1))
        np.testing.assert_allclose(e10_3.p, parts, atol=1e-12)


def test_a_thought_takes_one_number_for_each_draw(watching: Description) -> None:
    for names, draws in ((LATE, 2), (EARLY, 6), (("Move",), 3), (("Theta2", "H"), 4)):
        thought = Mind(watching, names).think(sensed(), np.random.default_rng(3))
        assert len(thought.u) == draws
        assert {"Vrot", "Vtrans", "Behavior", "Move", *names} <= set(thought.draws)
        for key, u in thought.u.items():
            drawn = thought.answers[key].at(u)
            values = drawn if isinstance(drawn, tuple) else (drawn,)
            for v, value in zip(thought.answers[key].variables, values, strict=True):
                assert thought.draws[v.name] == value
