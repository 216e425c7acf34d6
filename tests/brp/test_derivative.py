"""Derivatives of answers by the numbers in the tables, against differences of the joint written out in full."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from brp import (
    Laplace,
    P,
    QuestionError,
    Specification,
    Table,
    Term,
    TooLarge,
    Uniform,
    Variable,
    chain,
    derivative,
)
from brp.programs.behavior import TABLES, Behavior, Energy, behaving, behavior
from tests.brp.joint import Joint, distributions

Array = NDArray[np.float64]

A, B = Variable("A", range(3)), Variable("B", ("x", "y"))
C, D = Variable("C", range(4)), Variable("D", (False, True))


def described(rng: np.random.Generator, zeros: float) -> tuple[Joint, Specification]:
    """A table for each term: C and D know A and B, the last two of a chain."""
    terms = [P(A), P(B | A), P(C | A, B), P(D | C)]
    tables = {
        term: distributions(rng, [len(v) for v in term.of], [len(v) for v in term.given], zeros) for term in terms
    }
    return Joint(tables), Specification({term: Table(table) for term, table in tables.items()})


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("question", [P(A | D), P(B | C, D), P(A, D | B), P(D), P(C | A)])
def test_derivatives_are_those_of_the_joint_written_out(seed: int, question: Term) -> None:
    rng = np.random.default_rng(seed)
    joint, specification = described(rng, 0.2 * (seed % 2))
    description = specification.identify()
    for table in joint.tables:
        found = derivative.towards(description, question, table)
        odds = derivative.by_odds(description, question, table)
        p = joint.tables[table]
        np.testing.assert_allclose(derivative.numbers(description, table), p, rtol=1e-12, atol=1e-15)
        impossible = np.isnan(joint.conditional(question))
        for at in np.ndindex(*p.shape):
            for slopes, change in ((found, moved), (odds, raised)):
                expected = difference(joint, question, table, lambda q, e, at=at, how=change: how(q, at, e))
                # What is impossible may become possible; there is no answer to start from all the same.
                expected[impossible] = np.nan
                np.testing.assert_allclose(slopes[at], expected, rtol=1e-6, atol=1e-7)


def moved(p: Array, at: tuple[int, ...], e: float) -> Array:
    """The column of an entry, a share e nearer to certainty of it."""
    q = p.copy()
    column: tuple[slice | int, ...] = (slice(None), *at[1:])
    q[column] *= 1 - e
    q[at] += e
    return q


def raised(p: Array, at: tuple[int, ...], s: float) -> Array:
    """The odds of an entry times exp(s)."""
    q = p.copy()
    column: tuple[slice | int, ...] = (slice(None), *at[1:])
    q[at] *= np.exp(s)
    q[column] /= q[column].sum()
    return q


def difference(joint: Joint, question: Term, table: Term, change: object) -> Array:
    """Of the joint's own answers, taken to both sides and twice as far (error of the fourth order)."""
    assert callable(change)
    step = 2e-3

    def at(e: float) -> Array:
        return Joint({**joint.tables, table: change(joint.tables[table], e)}).conditional(question)

    return (8 * (at(step) - at(-step)) - (at(2 * step) - at(-2 * step))) / (12 * step)


def test_what_is_impossible_has_no_derivative_and_what_is_certain_or_zero_keeps_its_odds() -> None:
    table = P(Energy | Behavior)
    slopes = derivative.by_odds(behaving, behavior.term, table)
    assert np.isnan(slopes).any(axis=tuple(range(3))).sum() == 18
    p = derivative.numbers(behaving, table)
    still = (p == 0) | (p == 1)
    assert still.sum() == 4
    assert not np.nan_to_num(slopes[still]).any()
    # Towards a zero is something else: to open it matters.
    assert np.nan_to_num(derivative.towards(behaving, behavior.term, table)[p == 0]).any()


def test_columns_whose_behavior_is_told_by_fire_alone_matter_to_no_answer() -> None:
    """Fire is certain in table 6: with a fire nothing but fire-intervention is left, and without one everything
    else, so no other number about fire-intervention has a say."""
    fire = Behavior.place("fire-intervention")
    for number, table in TABLES.items():
        slopes = np.nan_to_num(derivative.by_odds(behaving, behavior.term, table))
        if number == 2:
            np.testing.assert_allclose(slopes[fire], 0, atol=1e-12)
            assert slopes[:, fire].any()
        else:
            np.testing.assert_allclose(slopes[:, fire], 0, atol=1e-12)


def test_a_description_that_is_learnt_has_derivatives_too() -> None:
    rng = np.random.default_rng(5)
    data = {"A": rng.integers(3, size=50).tolist(), "B": rng.choice(["x", "y"], size=50).tolist()}
    learnt = Specification({P(A): Laplace(), P(B | A): Laplace()}).identify(data)
    p = derivative.numbers(learnt, P(B | A))
    slopes = derivative.towards(learnt, P(A | B), P(B | A))
    joint = Joint({P(A): derivative.numbers(learnt, P(A)), P(B | A): p})
    for at in np.ndindex(*p.shape):
        expected = difference(joint, P(A | B), P(B | A), lambda q, e, at=at: moved(q, at, e))
        np.testing.assert_allclose(slopes[at], expected, atol=1e-9)


def test_what_cannot_be_derived_is_one_sentence() -> None:
    with pytest.raises(QuestionError, match=r"has no term P\(Behavior \| Energy\), so no answer can depend on it"):
        derivative.towards(behaving, behavior.term, P(Behavior | Energy))
    wide = [Variable(f"W{i}", range(100)) for i in range(3)]
    broad = Specification({P(w): Uniform() for w in wide} | {P(A): Uniform(), P(B | A): Table(np.ones((2, 3)) / 2)})
    with pytest.raises(TooLarge, match="are 36000000 numbers"):
        derivative.towards(broad.identify(), Term((A, B), tuple(wide)), P(B | A))


def kernels(rng: np.random.Generator) -> list[Array]:
    """Of one class, of two that never meet with some values that end in either, and one that beats time."""
    whole = rng.dirichlet(np.ones(5), size=5)
    parted = np.zeros((5, 5))
    parted[:2, :2] = rng.dirichlet(np.ones(2), size=2)
    parted[2:4, 2:4] = rng.dirichlet(np.ones(2), size=2)
    parted[4] = rng.dirichlet(np.ones(5))
    beating = np.roll(np.eye(5), 1, axis=1)
    return [whole, parted, beating]


@pytest.mark.parametrize("seed", range(3))
def test_the_long_run_is_the_average_over_time(seed: int) -> None:
    for kernel in kernels(np.random.default_rng(seed)):
        power, total = np.eye(5), np.zeros((5, 5))
        n = 20_000
        for _ in range(n):
            total += power
            power = power @ kernel
        np.testing.assert_allclose(chain.limit(kernel), total / n, atol=2e-3)
        np.testing.assert_allclose(chain.limit(kernel) @ kernel, chain.limit(kernel), atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_the_chains_derivatives_are_those_of_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start = rng.dirichlet(np.ones(5))
    for kernel in kernels(rng):
        slope = kernel * (rng.normal(size=(5, 5)))
        slope -= kernel * slope.sum(axis=1, keepdims=True)  # rows still sum to one, zeros stay
        step = 1e-4
        above, below = kernel + step * slope, kernel - step * slope
        both = np.stack([slope, 2 * slope])
        found = chain.limit_slopes(kernel, both)
        expected = (chain.limit(above) - chain.limit(below)) / (2 * step)
        np.testing.assert_allclose(found[0], expected, atol=1e-5)
        np.testing.assert_allclose(found[1], 2 * found[0], atol=1e-12)
        rate = (chain.changes(above, start) - chain.changes(below, start)) / (2 * step)
        np.testing.assert_allclose(chain.changes_slopes(kernel, both, start), [rate, 2 * rate], atol=1e-5)
        lasts = (chain.dwell(above) - chain.dwell(below)) / (2 * step)
        np.testing.assert_allclose(chain.dwell_slopes(kernel, both)[0], lasts, rtol=1e-5)


def test_what_lasts_for_ever_has_no_derivative() -> None:
    kernel = np.array([[1.0, 0.0], [0.25, 0.75]])
    assert chain.dwell(kernel).tolist() == [np.inf, 4]
    slopes = chain.dwell_slopes(kernel, np.array([[0, 0], [-0.01, 0.01]]))
    assert np.isnan(slopes[0])
    assert slopes[1] == pytest.approx(0.16)
    assert chain.changes(kernel, np.array([0.0, 1.0])) == pytest.approx(0, abs=1e-12)
