"""A batch of evidence has the answers that its rows have one by one."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import EvidenceError, ImpossibleEvidence, NotAValue, P, Question, Specification, Table, Uniform, Variable
from brp.programs.fusion import L, Theta2, fusing
from brp.programs.home import home
from brp.programs.watchman import watchman
from tests.brp.campaign import examples
from tests.brp.joint import distributions
from tests.brp.test_answers import programs
from tests.brp.test_soft import softly

A, B = Variable("A", range(3)), Variable("B", ("red", "green"))


def single(question: Question, row: dict[str, Any]) -> Any:
    try:
        return question(**row).p
    except ImpossibleEvidence:
        return None


@examples(80)
@given(st.data())
def test_a_batch_answers_as_its_rows_do(data: st.DataObject) -> None:
    description, _ = program = data.draw(programs())
    asked, soft = data.draw(softly(program))
    with pytest.MonkeyPatch.context() as patch:
        if data.draw(st.booleans()):
            patch.setattr("brp.tables.FOLD", 0)
        patch.setattr("brp.batch.NUMBERS", data.draw(st.sampled_from([1, 30, 10**6])))
        patch.setattr("brp.rows.MOST", data.draw(st.sampled_from([1, 3, 1024])))
        question = description.ask(asked, soft=soft)
        rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
        rows = [
            {
                v.keyword: rng.random(len(v)) + 1e-6 if v in soft else value
                for v, value in zip(asked.given, values, strict=True)
            }
            for values in product(*([v.values[0]] if v in soft else v.values for v in asked.given))
        ]
        wanted = [(row, single(question, row)) for row in rows[:40]]
        good = [(row, p) for row, p in wanted if p is not None]
        if not asked.given:
            with pytest.raises(EvidenceError, match="no batch"):
                question.batch({})
            return
        told = {v.keyword: [row[v.keyword] for row, _ in good] for v in asked.given}
        answers = question.batch(told)
        assert answers.shape == (len(good), *(len(v) for v in asked.of))
        for answer, (_, p) in zip(answers, good, strict=True):
            np.testing.assert_allclose(answer, p, rtol=1e-12, atol=1e-15)
        if len(good) < len(wanted):
            with pytest.raises(ImpossibleEvidence, match=r"^row "):
                question.batch({v.keyword: [row[v.keyword] for row, _ in wanted] for v in asked.given})


def test_a_batch_of_fusions_and_of_homes() -> None:
    rng = np.random.default_rng(9)
    locate = fusing.ask(P(Theta2 | L))
    rows: dict[str, Any] = {v.keyword: rng.integers(0, 512, 50) for v in L}
    answers = locate.batch(rows)
    for number in range(50):
        one = locate(**{keyword: column[number] for keyword, column in rows.items()})
        np.testing.assert_allclose(answers[number], one.p, rtol=1e-10, atol=1e-300)
    rows = {v.keyword: rng.choice(v.values, 50) for v in home.known}
    for number, answer in enumerate(home.batch(rows)):
        np.testing.assert_array_equal(answer, home(**{k: column[number] for k, column in rows.items()}).p)


@pytest.mark.parametrize("most", [7, 1024])
def test_a_batch_of_the_watchmans_ticks(most: int) -> None:
    """Cases, some of them weighing nothing in some rows; questions within; a known command variable."""
    rng = np.random.default_rng(10)
    rows: dict[str, Any] = {v.keyword: [v.values[k] for k in rng.integers(len(v), size=60)] for v in watchman.known}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brp.rows.MOST", most)
        question = Question(watchman.description, watchman.term)
        answers = question.batch(rows)
    for number, answer in enumerate(answers):
        one = watchman(**{keyword: column[number] for keyword, column in rows.items()})
        np.testing.assert_allclose(answer, one.p, rtol=1e-11, atol=1e-300)


def test_a_batch_with_soft_evidence_as_one_array() -> None:
    rng = np.random.default_rng(11)
    forms = {P(A): Table([0.2, 0.3, 0.5]), P(B | A): Table(distributions(rng, [2], [3], 0.0))}
    question = Specification(forms).identify().ask(P(B | A), soft=A)
    said = rng.random((500, 3))
    answers = question.batch({"A": said})
    for weights, answer in zip(said, answers, strict=True):
        np.testing.assert_allclose(answer, question(A=weights).p, rtol=1e-13)
    said[7] = [0, -1, 1]
    with pytest.raises(EvidenceError, match="no distribution"):
        question.batch({"A": said})


def test_a_row_that_is_all_but_impossible_is_answered_and_disturbs_no_other() -> None:
    """Forty observations, half of which contradict the others: either value has 1e-240."""
    X = Variable("X", range(2))
    Y = [Variable(f"Y{k}", range(2)) for k in range(40)]
    near = Table([[1 - 1e-12, 1e-12], [1e-12, 1 - 1e-12]])
    question = Specification({P(X): Table([0.3, 0.7]), **{P(y | X): near for y in Y}}).identify().ask(P(X | Y))
    rows = {y.keyword: np.zeros(300, dtype=int) for y in Y}
    for k, y in enumerate(Y):
        rows[y.keyword][3] = k % 2  # half of them say this, half that
    answers = question.batch(rows)
    np.testing.assert_allclose(answers[3], [0.3, 0.7], rtol=1e-9)
    np.testing.assert_allclose(answers[[0, 299], 0], 1)


def test_a_batch_that_does_not_fit_is_refused() -> None:
    forms = {P(A): Uniform(), P(B | A): Table(distributions(np.random.default_rng(1), [2], [3], 0.0))}
    question = Specification(forms, name="pi").identify().ask(P(B | A))
    with pytest.raises(NotAValue, match="row 1: A = 3"):
        question.batch({"A": np.array([0, 3])})
    with pytest.raises(NotAValue, match="A = 'red'"):
        question.batch({"A": ["red"]})
    with pytest.raises(EvidenceError, match="must be told A"):
        question.batch({})
    with pytest.raises(EvidenceError, match="does not know B"):
        question.batch({"A": [1], "B": ["red"]})
    both = Specification(forms, name="pi").identify().ask(P(A | B))
    assert both.batch({"B": []}).shape == (0, 3)
    assert both.batch({"B": ["red", "green"]}).shape == (2, 3)
    C = Variable("C", range(2))
    three = Specification({P(A): Uniform(), P(C): Uniform(), P(B | A, C): Uniform()}).identify().ask(P(B | A, C))
    with pytest.raises(EvidenceError, match="different lengths"):
        three.batch({"A": [0, 1], "C": [0]})
