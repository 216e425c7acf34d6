"""What a question answers: draws, and what can be read off."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import Distribution, NotAValue, NotNumeric, QuestionError, Variable

X = Variable("X", range(-3, 4))
Word = Variable("Word", ("yes", "no"))


def over(*p: float) -> Distribution:
    array = np.array(p)
    return Distribution((Variable("X", range(len(p))),), array / array.sum())


weights = st.lists(st.one_of(st.just(0.0), st.floats(1e-300, 1), st.just(1.0)), min_size=1, max_size=12).filter(any)


@given(weights, st.integers(0, 2**53 - 1))
def test_no_uniform_number_draws_a_value_of_probability_zero(p: list[float], numerator: int) -> None:
    distribution = over(*p)
    for u in (numerator * 2.0**-53, 0.0, 1 - 2.0**-53):
        assert distribution[distribution.at(u)] > 0


@given(weights)
def test_a_value_is_drawn_by_a_stretch_of_the_uniform_numbers_as_long_as_its_probability(p: list[float]) -> None:
    distribution = over(*p)
    ends = np.concatenate(([0], np.cumsum(distribution.p) / distribution.p.sum()))
    for value, (low, high) in enumerate(pairwise(ends)):
        if high - low > 1e-9:
            assert distribution.at(low + (high - low) * 1e-3) == value
            assert distribution.at(high - (high - low) * 1e-3) == value


def test_draws_follow_the_distribution() -> None:
    """Chi square on 20 000 draws with a fixed seed; chance passes 32.9 once in 1000 (12 degrees of freedom)."""
    p = np.array([0.2, 0.01, 0.05, 0.0, 0.14, 0.1, 0.02, 0.08, 0.0, 0.1, 0.03, 0.07, 0.05, 0.1, 0.05])
    distribution = Distribution((Variable("X", range(15)),), p)
    rng = np.random.default_rng(7)
    counts = np.bincount([distribution.draw(rng) for _ in range(20_000)], minlength=15)
    assert (counts[p == 0] == 0).all()
    expected = 20_000 * p[p > 0]
    assert ((counts[p > 0] - expected) ** 2 / expected).sum() < 32.9


def test_a_draw_takes_exactly_one_uniform_number_and_at_finds_it_again() -> None:
    distribution = over(3, 1, 4, 1, 5)
    drawing, counting = np.random.default_rng(3), np.random.default_rng(3)
    for _ in range(100):
        assert distribution.draw(drawing) == distribution.at(counting.random())
    assert drawing.random() == counting.random()


def test_several_variables_are_drawn_as_a_tuple_in_the_order_asked() -> None:
    p = np.zeros((7, 2))
    p[5, 1] = 1
    both = Distribution((X, Word), p)
    assert both.draw(np.random.default_rng(0)) == (2, "no") == both.best()
    assert both[2, "no"] == 1
    assert both.marginal(Word).best() == "no"
    assert both.marginal(Word, X)["no", 2] == 1
    assert both.values[0] == (-3, "yes")


def test_what_can_be_read_off() -> None:
    distribution = Distribution((X,), np.array([0, 0, 0.25, 0.25, 0.5, 0, 0]))
    assert distribution.best() == 1
    assert distribution.mean() == pytest.approx(0.25)
    assert distribution.entropy() == pytest.approx(1.5)
    assert over(1, 0, 0).entropy() == 0
    assert over(1, 1, 1, 1).entropy() == pytest.approx(2)
    assert distribution[-1] == 0.25
    assert "1: 0.5" in repr(distribution)


def test_an_answer_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        over(1, 2).p[0] = 0.5


def test_what_cannot_be_read_off_is_refused_by_name() -> None:
    words = Distribution((Word,), np.array([0.5, 0.5]))
    with pytest.raises(NotNumeric, match="Word has words"):
        words.mean()
    with pytest.raises(NotAValue, match="Word = 'perhaps'"):
        words["perhaps"]
    with pytest.raises(QuestionError, match="X is not among"):
        words.marginal(X)
