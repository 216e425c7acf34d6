"""Soft evidence: a known variable may be told a distribution; the question says so."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import (
    EvidenceError,
    ImpossibleEvidence,
    NotAValue,
    P,
    QuestionError,
    Specification,
    SpecificationError,
    Table,
    Term,
    Variable,
)
from brp.logs import logarithms
from tests.brp.campaign import examples
from tests.brp.joint import Array, spread
from tests.brp.test_answers import Program, programs
from tests.brp.test_impossible import ASKED, KNOWN, TABLES, Base

A, B, C = Variable("A", range(3)), Variable("B", range(2)), Variable("C", ("red", "green"))


@examples(80)
@given(st.data())
def test_soft_evidence_weighs_the_joint_written_out_in_full(data: st.DataObject) -> None:
    description, joint = program = data.draw(programs())
    asked, soft = data.draw(softly(program))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    with pytest.MonkeyPatch.context() as patch:
        if data.draw(st.booleans()):
            patch.setattr("brp.tables.FOLD", 0)
        question = description.ask(asked, soft=soft)
    hard = [v for v in asked.given if v not in soft]
    for values in list(product(*(v.values for v in hard)))[:12]:
        weights = {v: rng.random(len(v)) * (rng.random(len(v)) < 0.8) + 1e-9 for v in soft}
        weighed = joint.full()
        for v in soft:
            weighed = weighed * spread(weights[v], [v], joint.variables)
        wanted = marginal(weighed, joint.variables, asked.of, dict(zip(hard, values, strict=True)))
        told: dict[str, Any] = {v.keyword: weights[v] for v in soft}
        told |= {v.keyword: value for v, value in zip(hard, values, strict=True)}
        if not wanted.sum() > 0:
            with pytest.raises(ImpossibleEvidence):
                question(**told)
            continue
        np.testing.assert_allclose(question(**told).p, wanted / wanted.sum(), rtol=1e-11, atol=1e-15)
        evidence = question.signature.read(told)
        logs = logarithms(question.start, question.searched, evidence.places, soft=evidence.logs)
        exact = np.exp(logs) * np.ones(wanted.shape)
        np.testing.assert_allclose(exact, wanted / wanted.sum(), rtol=1e-11, atol=1e-15)


@st.composite
def softly(draw: st.DrawFn, program: Program) -> tuple[Term, tuple[Variable, ...]]:
    roles = [(v, draw(st.sampled_from("ssskkffu"))) for v in program[0].variables]
    searched = [v for v, role in roles if role == "s"] or [roles[0][0]]
    known = [v for v, role in roles if role in "kf" and v not in searched]
    soft = [v for v, role in roles if role == "f" and v in known]
    return Term(tuple(searched), tuple(known)), tuple(soft)


def marginal(full: Array, axes: list[Variable], of: tuple[Variable, ...], at: dict[Variable, object]) -> Array:
    fixed = full[tuple(v.place(at[v]) if v in at else slice(None) for v in axes)]
    left = [v for v in axes if v not in at]
    summed = fixed.sum(axis=tuple(k for k, v in enumerate(left) if v not in of))
    rest = [v for v in left if v in of]
    answer: Array = summed.transpose([rest.index(v) for v in of])
    return answer


def test_soft_evidence_is_not_what_a_subroutine_is() -> None:
    """P(Base) = .5 as soft evidence, homing, Vigil off, Energy high: idle .020 (by a subroutine .333)."""
    behavior = Specification({t: Table(p) for t, p in TABLES.items()}, name="pi-behavior").identify()
    question = behavior.ask(ASKED, soft=Base)
    assert question.name == ("P(Behavior | Behavior_t-1 Vigil Energy (soft Base) Fire Identify pi-behavior)")
    told: dict[str, Any] = {"Behavior_t_1": "homing", "Vigil": False, "Energy": "high"}
    told |= {"Fire": False, "Identify": False}
    half = question(**told, Base=[0.5, 0.5])
    assert half["idle"] == pytest.approx(0.020, abs=5e-4)
    sure = behavior.ask(ASKED)
    for value in Base.values:
        np.testing.assert_allclose(question(**told, Base=value).p, sure(**told, Base=value).p, rtol=1e-12)
        np.testing.assert_allclose(question(**told, Base={value: 3}).p, sure(**told, Base=value).p, rtol=1e-12)
    # Nothing of one evidence is left for the next.
    np.testing.assert_array_equal(question(**told, Base=[0.5, 0.5]).p, half.p)
    assert len(KNOWN) == len(question.known)


def test_what_another_question_answered_can_be_told() -> None:
    first = Specification({P(B): Table([0.3, 0.7])}).identify().ask(P(B))
    second = Specification({P(B): Table([0.5, 0.5]), P(C | B): Table([[0.9, 0.2], [0.1, 0.8]])}).identify()
    answer = second.ask(P(C | B), soft=[B])(B=first())
    np.testing.assert_allclose(answer.p, [0.3 * 0.9 + 0.7 * 0.2, 0.3 * 0.1 + 0.7 * 0.8], rtol=1e-12)


def test_weights_that_do_not_fit_are_refused() -> None:
    description = Specification({P(B): Table([0.5, 0.5]), P(C | B): Table(np.eye(2))}, name="pi").identify()
    question = description.ask(P(C | B), soft=B)
    with pytest.raises(EvidenceError, match=r"B was told 3 weights, and has 2 values \(0, 1\), in P\(C"):
        question(B=[1, 2, 3])
    with pytest.raises(EvidenceError, match="are no distribution"):
        question(B=[0, 0])
    with pytest.raises(EvidenceError, match="are no distribution"):
        question(B=[1, -1])
    with pytest.raises(EvidenceError, match="a distribution over C"):
        question(B=description.ask(P(C))())
    with pytest.raises(NotAValue, match="B = 2"):
        question(B={2: 1.0})
    with pytest.raises(EvidenceError, match="must be told B"):
        question()
    with pytest.raises(QuestionError, match="B cannot be known softly"):
        description.ask(P(C), soft=B)
    with pytest.raises(SpecificationError, match="only softly"):
        Specification({P(B): Table([0.5, 0.5]), P(C | B): question})
    with pytest.raises(QuestionError, match="only softly"):
        question.where_impossible(without=B)


def test_weights_in_an_array_are_refused_as_those_in_a_list_are() -> None:
    for size in (2, 16, 17, 40):
        V = Variable("V", range(size))
        forms = {P(V): Table(np.full(size, 1 / size)), P(C | V): Table(np.full((2, size), 0.5))}
        question = Specification(forms, name="pi").identify().ask(P(C | V), soft=V)
        fine = np.linspace(1.0, 2.0, size)
        np.testing.assert_allclose(question(V=fine).p, 0.5)
        for wrong in (-fine, fine * 0, fine * np.nan, fine * np.inf, fine - 1.5):
            for told in (wrong, wrong.tolist()):
                with pytest.raises(
                    EvidenceError, match=r"V was told weights that are no distribution: .*, in P\(C"
                ):
                    question(V=told)
        last = fine.copy()
        last[-1] = np.nan
        with pytest.raises(EvidenceError, match="no distribution"):
            question(V=last)
        with pytest.raises(EvidenceError, match=f"was told {size + 1} weights"):
            question(V=np.ones(size + 1))
        with pytest.raises(EvidenceError, match="does not know W"):
            question(V=fine, W=1)


def test_what_the_weights_exclude_is_impossible() -> None:
    description = Specification({P(B): Table([1.0, 0.0]), P(C | B): Table(np.eye(2))}, name="pi").identify()
    with pytest.raises(ImpossibleEvidence, match=r"B as told is impossible .*: P\(B \| pi\) excludes it"):
        description.ask(P(C | B), soft=B)(B=[0, 1])


def test_weights_may_be_as_small_as_numbers_get() -> None:
    many = [Variable(f"V{i}", range(2)) for i in range(300)]
    forms = {P(A): Table([0.2, 0.3, 0.5])} | {P(v | A): Table([[0.5, 0.4, 0.3], [0.5, 0.6, 0.7]]) for v in many}
    question = Specification(forms).identify().ask(P(A | many), soft=many)
    logs = np.log([0.2, 0.3, 0.5]) + 300 * np.log(
        np.array([0.5, 0.6, 0.7]) * 1.0 + 1e-6 * np.array([0.5, 0.4, 0.3])
    )
    wanted = np.exp(logs - logs.max())
    answer = question(**{v.keyword: [1e-306, 1e-300] for v in many})
    np.testing.assert_allclose(answer.p, wanted / wanted.sum(), rtol=1e-10)
