"""Monte-Carlo answers lie within the error that they state of the exact ones."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import (
    Dirac,
    EvidenceError,
    Form,
    Gaussian,
    ImpossibleEvidence,
    P,
    QuestionError,
    Specification,
    Table,
    Term,
    TooLarge,
    Uniform,
    Variable,
)
from brp.sampling import Sampling
from tests.brp.campaign import examples
from tests.brp.test_answers import programs, questions


@examples(40, derandomize=True)
@given(st.data())
def test_estimates_lie_within_their_errors_of_the_exact_answers(data: st.DataObject) -> None:
    """Every form, Switches and subroutines; a deviation of more than five errors is no chance."""
    program = data.draw(programs(zeros=0.0))
    term = data.draw(questions(program))
    known: dict[str, Any] = {v.keyword: v.values[data.draw(st.integers(0, len(v) - 1))] for v in term.given}
    exact = program[0].ask(term)(**known)
    estimate = Sampling(program[0], term).ask(np.random.default_rng(3), 20_000, **known)
    assert estimate.distribution.variables == term.of
    assert estimate.distribution.p.sum() == pytest.approx(1)
    assert 1 <= estimate.effective <= 20_000 * (1 + 1e-9)
    assert (np.abs(estimate.distribution.p - exact.p) <= 5 * estimate.errors + 10 / estimate.effective).all()


A, B = Variable("A", range(3)), Variable("B", range(4))
rng = np.random.default_rng(5)
PA, PB = rng.dirichlet(np.ones(3)), rng.dirichlet(np.ones(4), size=3).T
pair = Specification({P(A): Table(PA), P(B | A): Table(PB)}).identify()


def test_the_stated_error_is_the_deviation_of_many_estimates() -> None:
    sampling = Sampling(pair, P(A | B))
    exact = pair.ask(P(A | B))(B=2).p
    estimates = [sampling.ask(np.random.default_rng(seed), 500, B=2) for seed in range(300)]
    z = np.array([(e.distribution.p - exact) / e.errors for e in estimates])
    assert 0.85 < z.std() < 1.15
    assert abs(z.mean()) < 0.2


def test_sampling_ends_when_the_error_asked_for_is_reached() -> None:
    estimate = Sampling(pair, P(A | B)).ask(np.random.default_rng(1), 2_000_000, error=0.003, B=1)
    assert estimate.errors.max() <= 0.003
    assert estimate.count < 200_000
    assert Sampling(pair, P(A | B)).ask(np.random.default_rng(1), 777, B=1).count == 777


def test_what_the_exact_way_refuses_is_estimated() -> None:
    """Six variables, each two of them seen together: the exact sum needs an array over nearly all of them."""
    random = np.random.default_rng(9)
    hidden = [Variable(f"X{i}", range(8)) for i in range(6)]
    forms: dict[Term, Form] = {P(v): Table(random.dirichlet(np.ones(8))) for v in hidden}
    seen = []
    for v, w in combinations(hidden, 2):
        seen.append(Variable(f"Z{v}{w}", range(2)))
        share = random.uniform(0.2, 0.8, (8, 8))
        forms[P(seen[-1] | v, w)] = Table(np.stack([share, 1 - share]))
    description = Specification(forms).identify()
    term = P(hidden[0] | seen)
    with pytest.raises(TooLarge):
        description.ask(term, largest=50_000)
    known: dict[str, Any] = {v.keyword: int(random.integers(2)) for v in seen}
    exact = description.ask(term)(**known)
    estimate = Sampling(description, term).ask(random, 40_000, **known)
    assert (np.abs(estimate.distribution.p - exact.p) < 4 * estimate.errors).all()
    assert estimate.errors.max() < 0.02


def test_unlikely_evidence_is_weighed_and_not_waited_for() -> None:
    """A reading 60 deviations away: exp(-1800) underflows, the ratio of weights does not."""
    X, Z = Variable("X", range(20)), Variable("Z", range(101))
    far = Specification({P(X): Uniform(), P(Z | X): Gaussian(lambda X: X, 1)}).identify()
    estimate = Sampling(far, P(X | Z)).ask(np.random.default_rng(4), 2000, Z=80)
    assert estimate.distribution.best() == 19
    assert far.ask(P(X | Z))(Z=80).best() == 19


def test_what_no_sample_agrees_with_is_refused_by_name() -> None:
    same = Specification({P(A): Table([0.5, 0.5, 0.0]), P(B | A): Dirac(lambda A: A)}).identify()
    with pytest.raises(ImpossibleEvidence, match=r"none of 100 samples .* agrees with B = 3"):
        Sampling(same, P(A | B)).ask(np.random.default_rng(0), 100, B=3)
    with pytest.raises(EvidenceError, match="must be told B"):
        Sampling(same, P(A | B)).ask(np.random.default_rng(0))
    with pytest.raises(QuestionError, match="0 samples"):
        Sampling(same, P(A)).ask(np.random.default_rng(0), 0)
    with pytest.raises(QuestionError, match="has no variable C"):
        Sampling(same, P(Variable("C", range(2))))
