"""Trees of large numeric domains: as near to the exact distribution as they say, at few of its values."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from brp import (
    EvidenceError,
    Gaussian,
    ImpossibleEvidence,
    Laplace,
    P,
    QuestionError,
    Specification,
    Switch,
    Table,
    TooLarge,
    Uniform,
    Variable,
)
from brp.mrbt import grow, tree
from tests.brp.campaign import examples

Class = Variable("O", range(16))
Per = Variable("Per", range(10_000))
Far = Variable("Far", range(-5_000_000, 5_000_000))


def variation(p: NDArray[np.float64], q: NDArray[np.float64]) -> float:
    return float(np.abs(p - q).sum() / 2)


@examples(60)
@given(
    st.lists(
        st.tuples(st.floats(0, 9999), st.floats(0.5, 3000), st.floats(0.01, 1)),
        min_size=1,
        max_size=3,
    ),
    st.sampled_from([0.2, 0.05, 0.01, 0.001]),
)
def test_a_tree_is_as_near_as_it_says(peaks: list[tuple[float, float, float]], error: float) -> None:
    """Mixtures of Gaussians; first leaves narrower than the narrowest of them, so that none can hide."""

    def logs(at: NDArray[np.intp]) -> NDArray[np.float64]:
        each = [np.log(w / d) - 0.5 * ((at - mean) / d) ** 2 for mean, d, w in peaks]
        return np.asarray(np.logaddexp.reduce(each))

    made = grow(Per, logs, error=error, most=10_000, first=10_000 if min(d for _, d, _ in peaks) < 30 else 500)
    exact = logs(np.arange(10_000))
    p = np.exp(exact - exact.max())
    p /= p.sum()
    assert made.error <= error
    assert variation(made.distribution().p, p) <= made.error + 1e-9
    assert made.masses.sum() == pytest.approx(1)
    assert made.mean() == pytest.approx(float(made.distribution().p @ Per.numbers), rel=1e-9, abs=1e-6)


def test_ten_million_values_are_held_at_some_hundred_of_them() -> None:
    looked = 0

    def logs(at: NDArray[np.intp]) -> NDArray[np.float64]:
        nonlocal looked
        looked += len(at)
        return np.asarray(-0.5 * ((at - 7_654_321) / 250.0) ** 2)

    made = grow(Far, logs, error=0.02)
    assert len(made.masses) < 1000
    assert looked < 10_000
    assert made.best() == pytest.approx(2_654_321, abs=30)
    assert made.mean() == pytest.approx(2_654_321, abs=1)
    assert made[2_654_321] == pytest.approx(1 / (250 * np.sqrt(2 * np.pi)), rel=0.02)
    # Finer where the mass is.
    assert made.sizes.min() < 50 < 100_000 < made.sizes.max()


def objects() -> Any:
    return Specification(
        {P(Class): Laplace(), P(Per | Class): Gaussian(lambda O: 300 + 600 * O, lambda O: 20 + 10 * O)},  # noqa: E741
        name="pi-object",
    ).identify({"O": [1, 1, 1, 4, 4, 9]})


def test_a_question_over_a_large_domain_is_answered_as_a_tree() -> None:
    description = objects()
    exact = description.ask(P(Per))()
    made = tree(description, P(Per), error=0.01, first=500)
    assert made.error <= 0.01
    assert variation(made.distribution().p, exact.p) <= made.error
    known = tree(description, P(Per | Class), {"O": 9}, error=0.01)
    assert variation(known.distribution().p, description.ask(P(Per | Class))(O=9).p) <= known.error
    assert len(known.masses) < 2000
    assert known.error <= 0.01


def test_draws_of_a_tree_follow_it_and_take_one_uniform_number() -> None:
    """Chi square of 20 000 draws over 20 stretches; chance passes 43.8 once in 1000 (19 degrees of freedom)."""
    made = tree(objects(), P(Per | Class), {"O": 4}, error=0.05)
    random, counting = np.random.default_rng(8), np.random.default_rng(8)
    drawn = np.array([made.draw(random) for _ in range(20_000)])
    counting.random(20_000)
    assert random.random() == counting.random()
    p = made.distribution().p
    borders = np.searchsorted(np.cumsum(p), np.linspace(0, 1, 21)[1:-1])
    mass = np.array([part.sum() for part in np.split(p, borders)])
    counts = np.bincount(np.searchsorted(borders, drawn, "right"), minlength=20)
    expected = 20_000 * mass
    assert ((counts - expected) ** 2 / expected).sum() < 43.8
    for u in (0.0, 1 - 2**-53):
        assert made[made.at(u)] > 0


def test_zeros_are_never_drawn_and_small_domains_come_out_exact() -> None:
    Small = Variable("Small", range(8))
    p = np.array([0, 0.1, 0.2, 0, 0, 0.3, 0.4, 0])
    description = Specification({P(Small): Table(p)}).identify()
    made = tree(description, P(Small), error=0.0)
    np.testing.assert_allclose(made.distribution().p, p, atol=1e-15)
    assert made.error == 0
    assert {made.at(u) for u in np.linspace(0, 1, 999, endpoint=False)} == {1, 2, 5, 6}


def test_what_cannot_be_a_tree_is_refused_with_a_sentence() -> None:
    description = objects()
    with pytest.raises(QuestionError, match="a tree is over one variable"):
        tree(description, P(Per, Class))
    with pytest.raises(EvidenceError, match="must be told O"):
        tree(description, P(Per | Class))
    with pytest.raises(QuestionError, match="has no variable Far"):
        tree(description, P(Far))
    Word = Variable("Word", ("yes", "no"))
    with pytest.raises(QuestionError, match="not for Word"):
        tree(Specification({P(Word): Uniform()}).identify(), P(Word))
    with pytest.raises(TooLarge, match="Per have 10000 values together"):
        tree(
            Specification(
                {P(Per): Uniform(), P(Far | Per): Switch(Per, dict.fromkeys(range(10_000), Uniform()))}
            ).identify(),
            P(Far),
        )
    with pytest.raises(ImpossibleEvidence, match="no value of Per"):
        grow(Per, lambda at: np.full(len(at), -np.inf))
