"""The postulates and rules of section 3.2, as laws of every description."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from brp import P
from tests.brp.test_answers import Program, programs


@st.composite
def two_variables(draw: st.DrawFn) -> Program:
    return draw(programs(depth=0, zeros=0.0).filter(lambda program: len(program[0].variables) > 1))


@settings(max_examples=40, deadline=None)
@given(two_variables())
def test_a_conjunction_is_one_variable_times_the_other_given_it(program: Program) -> None:
    """[E3.2] for every two values, which is [E3.4]."""
    description = program[0]
    x, y = description.variables[:2]
    both = description.ask(P(x, y))()
    one, other = description.ask(P(x))(), description.ask(P(y))()
    for i, value in enumerate(x.values):
        right = one[value] * description.ask(P(y | x))(**{x.keyword: value}).p
        np.testing.assert_allclose(both.p[i], right, rtol=1e-12, atol=1e-300)
    for j, value in enumerate(y.values):
        right = other[value] * description.ask(P(x | y))(**{y.keyword: value}).p
        np.testing.assert_allclose(both.p[:, j], right, rtol=1e-12, atol=1e-300)


@settings(max_examples=40, deadline=None)
@given(two_variables())
def test_an_answer_sums_to_one_and_so_do_a_value_and_all_others(program: Program) -> None:
    """[E3.5], and [E3.3] for each value."""
    for variable in program[0].variables:
        answer = program[0].ask(P(variable))()
        np.testing.assert_allclose(answer.p.sum(), 1, rtol=1e-12)
        for value in variable.values:
            others = sum(answer[other] for other in variable.values if other != value)
            np.testing.assert_allclose(answer[value] + others, 1, rtol=1e-12)


@settings(max_examples=40, deadline=None)
@given(two_variables())
def test_summing_one_of_two_variables_leaves_the_other(program: Program) -> None:
    """[E3.6], by the engine's elimination and by the answer's marginal."""
    x, y = program[0].variables[:2]
    both = program[0].ask(P(x, y))()
    np.testing.assert_allclose(both.p.sum(axis=0), program[0].ask(P(y))().p, rtol=1e-12, atol=1e-300)
    np.testing.assert_array_equal(both.marginal(y).p, both.p.sum(axis=0))
    np.testing.assert_array_equal(both.marginal(y, x).p, both.p.T)
