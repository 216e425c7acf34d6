"""Identification with a variable that was never observed, on data drawn from known models."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import (
    DataError,
    Gaussian,
    Histogram,
    ImpossibleEvidence,
    Laplace,
    P,
    Specification,
    Switch,
    Table,
    Unidentified,
    Uniform,
    Variable,
)
from brp.em import identify_hidden
from brp.programs.home import Dir, H, Prox, Theta1, Vrot, command, home
from brp.programs.obstacle import avoid
from brp.programs.phototaxy import phototaxy1
from tests.brp.campaign import examples

C = Variable("C", ("one", "other"))
A = Variable("A", range(4))
B = Variable("B", range(3))
X = Variable("X", range(-10, 11))


def test_when_to_avoid_is_learnt_from_data_that_do_not_say_which_behavior_it_was() -> None:
    """Lesson 7: P(H | Prox) from Dir, Prox, Theta1 and Vrot as E7.1 draws them; it comes to the Sigmoid of S7.5."""
    learning = Specification(
        {
            P(Dir): Uniform(),
            P(Prox): Uniform(),
            P(Theta1): Uniform(),
            P(H | Prox): Laplace(),
            P(Vrot | Dir, Prox, Theta1, H): Switch(H, {"avoidance": avoid, "phototaxy": phototaxy1}),
        },
        name="pi-home",
    )
    rng = np.random.default_rng(17)
    rows = [
        {"Dir": int(rng.integers(-10, 11)), "Prox": prox, "Theta1": int(rng.integers(-17, 19)) * 10}
        for prox in range(16)
        for _ in range(400)
    ]
    data = [{**row, "Vrot": home(**row).draw(rng)} for row in rows]
    result = identify_hidden(learning, data, name="delta-home")
    assert result.converged
    learnt = result.description.ask(P(H | Prox))
    assert learnt.name == "P(H | Prox delta-home pi-home)"
    error = np.array([learnt(Prox=p)["avoidance"] - command(Prox=p)["avoidance"] for p in range(16)])
    # A share of 400 data has a deviation of .025 at most; which behavior it was is not always plain to see.
    assert np.abs(error).max() < 0.1
    assert np.abs(error).mean() < 0.03


def test_two_gaussians_are_told_apart() -> None:
    source = Specification(
        {P(C): Table([0.3, 0.7]), P(X | C): Switch(C, {"one": Gaussian(-4, 1.5), "other": Gaussian(3, 2)})}
    )
    both = source.identify().ask(P(X))()
    rng = np.random.default_rng(2)
    data = {"X": [both.draw(rng) for _ in range(6000)]}
    wanted = Specification({P(C): Histogram(), P(X | C): Gaussian()})
    best = max(
        (identify_hidden(wanted, data, rng=np.random.default_rng(seed), rounds=400) for seed in range(3)),
        key=lambda result: result.log_likelihoods[-1],
    )
    first, second = sorted(C.values, key=lambda c: best.description.ask(P(X | C))(C=c).mean())
    question = best.description.ask(P(X | C))
    assert best.description.ask(P(C))()[first] == pytest.approx(0.3, abs=0.04)
    assert question(C=first).mean() == pytest.approx(-4, abs=0.3)
    assert question(C=second).mean() == pytest.approx(3, abs=0.3)
    start = Specification({P(C): Histogram(), P(X | C): Gaussian()}).identify({"C": list(C.values), "X": [5, -5]})
    placed = identify_hidden(wanted, data, start=start).description.ask(P(X | C))
    assert placed(C="one").mean() == pytest.approx(3, abs=0.3)


naive = Specification({P(C): Histogram(), P(A | C): Histogram(), P(B | C): Histogram()})


@examples(30)
@given(
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), min_size=2, max_size=30), st.integers(0, 2**32 - 1)
)
def test_with_histograms_the_likelihood_never_falls(rows: list[tuple[int, int]], seed: int) -> None:
    data = [{"A": a, "B": b} for a, b in rows]
    result = identify_hidden(naive, data, rng=np.random.default_rng(seed), rounds=60, tolerance=0.0)
    for before, after in pairwise(result.log_likelihoods):
        assert after >= before - 1e-9 * len(rows)


def test_rounds_are_those_of_em_written_out_in_numpy() -> None:
    rng = np.random.default_rng(8)
    a, b = rng.integers(0, 4, 200), rng.integers(0, 3, 200)
    weights = rng.uniform(0, 2, 200)
    pc, pa, pb = np.array([0.4, 0.6]), rng.dirichlet(np.ones(4), 2).T, rng.dirichlet(np.ones(3), 2).T
    start = Specification({P(C): Table(pc), P(A | C): Table(pa), P(B | C): Table(pb)}).identify()
    result = identify_hidden(naive, {"A": a, "B": b}, weights=weights, start=start, rounds=5, tolerance=0.0)
    for likelihood in result.log_likelihoods:
        joint = pc * pa[a] * pb[b]
        assert likelihood == pytest.approx(weights @ np.log(joint.sum(axis=1)), rel=1e-10)
        share = joint / joint.sum(axis=1, keepdims=True) * weights[:, None]
        pc = share.sum(axis=0) / share.sum()
        pa = np.array([share[a == value].sum(axis=0) for value in range(4)]) / share.sum(axis=0)
        pb = np.array([share[b == value].sum(axis=0) for value in range(3)]) / share.sum(axis=0)
    np.testing.assert_allclose(result.description.ask(P(C))().p, pc, rtol=1e-9)
    np.testing.assert_allclose(result.description.ask(P(A | C))(C="other").p, pa[:, 1], rtol=1e-9)
    assert not result.converged


def test_what_cannot_be_identified_is_refused_with_a_sentence() -> None:
    with pytest.raises(DataError, match="call identify"):
        identify_hidden(naive, {"A": [1], "B": [1], "C": ["one"]})
    with pytest.raises(DataError, match="nothing can be identified"):
        identify_hidden(Specification({P(A): Uniform()}), {"A": [1]})
    with pytest.raises(Unidentified):
        identify_hidden(naive, {"A": [1], "B": [1]})
    start = Specification({P(C): Uniform(), P(A | C): Table([[1, 1], [0, 0], [0, 0], [0, 0]]), P(B | C): Uniform()})
    with pytest.raises(ImpossibleEvidence, match="A = 1, B = 1 is impossible"):
        identify_hidden(naive, {"A": [0, 1], "B": [1, 1]}, start=start.identify())
