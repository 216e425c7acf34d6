"""Rules for the rows of a question that are impossible: they fill those rows, and change no other."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import (
    ImpossibleEvidence,
    P,
    Question,
    QuestionError,
    Specification,
    SpecificationError,
    Switch,
    Table,
    Term,
    Uniform,
    Variable,
)
from brp.logs import logarithms
from brp.plan import compiled
from tests.brp.campaign import examples
from tests.brp.joint import Array, Joint, distributions

# pi-behavior of section 9 (tables 2 to 7, the cells without a number sharing what is left of a column).
Before = Variable("Behavior_t-1", ("idle", "patrol", "recognition", "fire-intervention", "homing", "recharge"))
Behavior = Variable("Behavior", Before.values)
Vigil = Variable("Vigil", (False, True))
Energy = Variable("Energy", ("very-low", "low", "high", "very-high"))
Base = Variable("Base", (False, True))
Fire = Variable("Fire", (False, True))
Identify = Variable("Identify", (False, True))
third = 1 / 3
TABLES: dict[Term, Array] = {
    P(Before): np.full(6, 1 / 6),
    P(Behavior | Before): np.array(
        [
            [0.9, 0.02, 0, 0, 0.02, 0.02],
            [0.05, 0.9, 0.0025, third, 0.02, 0.02],
            [0, 0.02, 0.99, 0, 0.02, 0.02],
            [0.05, 0.02, 0.0025, third, 0.02, 0.02],
            [0, 0.02, 0.0025, 0, 0.9, 0.02],
            [0, 0.02, 0.0025, third, 0.02, 0.9],
        ]
    ),
    P(Vigil | Behavior): np.array([[0.9, 0, 0, 0.5, 1, 0.5], [0.1, 1, 1, 0.5, 0, 0.5]]),
    P(Energy | Behavior): np.array(
        [
            [0.325, 0, 0, 0.25, 0.25, 0.8],
            [0.325, 0.1, 0.1, 0.25, 0.25, 0.2],
            [0.25, 0.45, 0.45, 0.25, 0.25, 0],
            [0.1, 0.45, 0.45, 0.25, 0.25, 0],
        ]
    ),
    P(Base | Behavior): np.array([[0, 0.99, 0.99, 0.5, 0.99, 0.99], [1, 0.01, 0.01, 0.5, 0.01, 0.01]]),
    P(Fire | Behavior): np.array([[1, 1, 1, 0, 1, 1], [0, 0, 0, 1, 0, 0]], dtype=float),
    P(Identify | Behavior): np.array([[0.5, 0.5, 0, 0.5, 0.5, 0.5], [0.5, 0.5, 1, 0.5, 0.5, 0.5]]),
}
KNOWN = (Before, Vigil, Energy, Base, Fire, Identify)
ASKED = P(Behavior | KNOWN)


def behavior() -> Question:
    return Specification({t: Table(p) for t, p in TABLES.items()}, name="pi-behavior").identify().ask(ASKED)


def test_without_a_variable_fills_exactly_the_eighteen_impossible_rows_of_pi_behavior() -> None:
    plain = behavior()
    filled = plain.where_impossible(without=Before)
    wanted = Joint(TABLES).conditional(ASKED)
    again = Joint(TABLES).conditional(P(Behavior | KNOWN[1:]))
    rows = 0
    for values in product(*(v.values for v in KNOWN)):
        at = tuple(v.place(value) for v, value in zip(KNOWN, values, strict=True))
        known: dict[str, Any] = dict(zip((v.keyword for v in KNOWN), values, strict=True))
        expected = wanted[(slice(None),) * len(ASKED.of) + at]
        assert plain.possible(**known) is filled.possible(**known) is not bool(np.isnan(expected).any())
        if np.isnan(expected).any():
            rows += 1
            expected = again[(slice(None),) * len(ASKED.of) + at[1:]]
            with pytest.raises(ImpossibleEvidence):
                plain(**known)
        np.testing.assert_allclose(filled(**known).p, expected, rtol=1e-12, atol=1e-15)
    assert rows == 18


def test_an_idle_robot_lifted_off_its_base_with_vigil_off_goes_home() -> None:
    """The row Base = false is impossible for it; counted as nothing, it would stay idle for ever."""
    filled = behavior().where_impossible(without=Before)
    base = Specification({P(Base): Table([0.7, 0.3])}, name="pi-base").identify().ask(P(Base))
    forms = {P(v): Uniform() for v in KNOWN if v != Base} | {P(Base): base, ASKED: filled}
    level = Specification(forms, name="pi-watchman").identify()
    answer = level.ask(P(Behavior | Before, Vigil, Energy, Fire, Identify))
    known: dict[str, Any] = {"Behavior_t_1": "idle", "Vigil": False, "Energy": "high", "Fire": False}
    p = answer(**known, Identify=False)
    assert p["idle"] == pytest.approx(0.3, rel=1e-12)
    assert p["homing"] == pytest.approx(0.7 * filled(**known, Identify=False, Base=False)["homing"], rel=1e-12)
    without = Specification(forms | {ASKED: behavior()}, name="pi-watchman").identify()
    with pytest.raises(ImpossibleEvidence):
        without.ask(answer.term)(**known, Identify=False)


def test_a_subroutine_is_weighed_by_what_it_knows_and_gives_no_evidence_about_it() -> None:
    """E10.5, homing, Vigil off, Energy high, P(Base) = .5: idle .333, where soft evidence would give .020."""
    base = Specification({P(Base): Table([0.5, 0.5])}, name="pi-base").identify().ask(P(Base))
    forms = {P(v): Uniform() for v in KNOWN if v != Base}
    for form in (behavior(), behavior().where_impossible(without=Before)):
        level = Specification(forms | {P(Base): base, ASKED: form}).identify()
        answer = level.ask(P(Behavior | Before, Vigil, Energy, Fire, Identify))
        p = answer(Behavior_t_1="homing", Vigil=False, Energy="high", Fire=False, Identify=False)
        assert p["idle"] == pytest.approx(1 / 3, abs=5e-4)


A, B, C = (Variable(name, range(n)) for name, n in (("A", 3), ("B", 2), ("C", 2)))


def sure() -> Question:
    """P(A | B C): with B = 1 and C = 1 nothing is left, nor with C = 1 alone where B is not known."""
    forms = {
        P(A): Table([0.5, 0.5, 0.0]),
        P(B | A): Table({0: [1, 0], 1: [0, 1], 2: [0, 1]}),
        P(C | A): Table({0: [1, 0], 1: [1, 0], 2: [0, 1]}),
    }
    return Specification(forms, name="pi").identify().ask(P(A | B, C))


def test_rules_apply_one_after_the_other_and_print() -> None:
    question = sure().where_impossible(without=B)
    assert question(B=0, C=0)[0] == 1
    with pytest.raises(ImpossibleEvidence, match="C = 1"):
        question(B=1, C=1)
    last = question.where_impossible(Uniform())
    assert last(B=1, C=1).p.tolist() == pytest.approx([1 / 3] * 3)
    assert last(B=0, C=0)[0] == 1
    assert str(last).splitlines()[-2:] == [
        "where it is impossible: P(A | C pi)",
        "where it is impossible: Uniform()",
    ]


def test_a_rule_must_fit_the_question() -> None:
    D = Variable("D", range(2))
    with pytest.raises(QuestionError, match="does not know D"):
        sure().where_impossible(without=D)
    with pytest.raises(QuestionError, match="wants one rule"):
        sure().where_impossible()
    with pytest.raises(QuestionError, match="wants one rule"):
        sure().where_impossible(Uniform(), without=B)
    with pytest.raises(SpecificationError, match="has the shape"):
        sure().where_impossible(Table([0.5, 0.5]))


@examples(40)
@given(st.data())
def test_a_filled_question_is_a_conditional_distribution_wherever_it_stands(data: st.DataObject) -> None:
    """Alone, inside a program with its known variables summed out, in a Switch, renamed, its result known."""
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    zeros = data.draw(st.sampled_from([0.3, 0.6]))
    inner_tables = {
        P(A): distributions(rng, [3], [], zeros),
        P(B | A): distributions(rng, [2], [3], zeros),
        P(C | A, B): distributions(rng, [2], [3, 2], zeros),
    }
    inner = Specification({t: Table(p) for t, p in inner_tables.items()}).identify()
    first = Joint(inner_tables).conditional(P(A | B, C))
    second = Joint(inner_tables).conditional(P(A | B))[:, :, None]
    filled_table = np.where(np.isnan(first), second, first)
    filled_table = np.where(np.isnan(filled_table), 1 / 3, filled_table)
    form = inner.ask(P(A | B, C)).where_impossible(without=C).where_impossible(Uniform())
    X, K = Variable("X", range(3)), Variable("K", range(2))
    other = distributions(rng, [3], [2, 2], zeros)
    tables = {
        P(K): distributions(rng, [2], [], 0.0),
        P(B | K): distributions(rng, [2], [2], 0.0),
        P(C): distributions(rng, [2], [], 0.0),
        P(X | B, C, K): np.stack([filled_table, other], axis=-1),
    }
    forms = {t: Table(p) for t, p in tables.items()} | {
        P(X | B, C, K): Switch(K, {0: form.renamed({A: X}), 1: Table(other)})
    }
    outer = Specification(forms).identify()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brp.tables.FOLD", data.draw(st.sampled_from([0, 10, 10**5])))
        for asked in (P(X), P(X | B), P(X | K, C), P(K | X), P(B, C | X, K), P(X | B, C, K)):
            question = outer.ask(asked)
            wanted = Joint(tables).conditional(asked)
            plan = compiled(question.start, question.known, question.searched)
            for values in product(*(range(len(v)) for v in asked.given)):  # here values are places
                expected = wanted[(slice(None),) * len(asked.of) + values]
                known = dict(zip((v.keyword for v in asked.given), values, strict=True))
                if np.isnan(expected).any():
                    with pytest.raises(ImpossibleEvidence):
                        question(**known)
                    continue
                np.testing.assert_allclose(question(**known).p, expected, rtol=1e-12, atol=1e-15)
                logs = logarithms(question.start, asked.of, dict(zip(asked.given, values, strict=True)))
                np.testing.assert_allclose(np.exp(logs) * np.ones(expected.shape), expected, rtol=1e-12, atol=1e-15)
                run = plan.run(values)
                if run is not None:
                    np.testing.assert_allclose(run.reshape(expected.shape), expected, rtol=1e-12, atol=1e-15)
