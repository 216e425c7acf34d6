"""The postulates and rules of section 3.2, as laws of every description."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from brp import (
    Dirac,
    Form,
    Gaussian,
    Histogram,
    Laplace,
    Nearest,
    P,
    Prior,
    Question,
    Sigmoid,
    Specification,
    Switch,
    Table,
    Uniform,
    Variable,
)
from tests.brp.campaign import examples
from tests.brp.test_answers import Program, programs


@st.composite
def two_variables(draw: st.DrawFn) -> Program:
    return draw(programs(depth=0, zeros=0.0).filter(lambda program: len(program[0].variables) > 1))


@examples(40)
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


@examples(40)
@given(two_variables())
def test_an_answer_sums_to_one_and_so_do_a_value_and_all_others(program: Program) -> None:
    """[E3.5], and [E3.3] for each value."""
    for variable in program[0].variables:
        answer = program[0].ask(P(variable))()
        np.testing.assert_allclose(answer.p.sum(), 1, rtol=1e-12)
        for value in variable.values:
            others = sum(answer[other] for other in variable.values if other != value)
            np.testing.assert_allclose(answer[value] + others, 1, rtol=1e-12)


@examples(40)
@given(two_variables())
def test_summing_one_of_two_variables_leaves_the_other(program: Program) -> None:
    """[E3.6], by the engine's elimination and by the answer's marginal."""
    x, y = program[0].variables[:2]
    both = program[0].ask(P(x, y))()
    np.testing.assert_allclose(both.p.sum(axis=0), program[0].ask(P(y))().p, rtol=1e-12, atol=1e-300)
    np.testing.assert_array_equal(both.marginal(y).p, both.p.sum(axis=0))
    np.testing.assert_array_equal(both.marginal(y, x).p, both.p.T)


X, Y = Variable("X", (3, 8)), Variable("Y", range(-3, 4))
HALF = Specification({P(Y): Uniform(), P(X | Y): Sigmoid(3, alpha=0, beta=0.5)}).identify().ask(P(X | Y))
means = st.floats(-1e4, 1e4)
deviations = st.floats(1e-3, 1e4)


@st.composite
def forms(draw: st.DrawFn) -> Form:
    """Any form of P(X | Y)."""
    weight = draw(st.floats(0, 1))
    simple = [
        Uniform(),
        Table(lambda X: weight if X == 3 else 1 - weight),
        Table({y: {3: weight, 8: "x"} for y in Y.values}),
        Sigmoid(8, alpha=draw(means), beta=draw(st.floats(-1e3, 1e3))),
        Gaussian(draw(means), draw(deviations)),
        Gaussian(),
        Gaussian(unvisited="uniform", floor=draw(deviations)),
        Gaussian(unvisited=Prior(draw(means), draw(deviations), draw(st.floats(0, 10)))),
        Laplace(),
        Laplace(bins=1),
        Histogram(),
        Histogram(unvisited=Nearest()),
        Dirac(lambda Y: 3 if Y > 0 else 8),
        HALF,
    ]
    # Within a Switch on Y the term is P(X), which those forms do not fit that need Y.
    alone = st.sampled_from([form for form in simple if not isinstance(form, Dirac | Sigmoid | Question | Table)])
    switches = st.builds(lambda one, other: Switch(Y, {0: one, (-3, -2, -1, 1, 2, 3): other}), alone, alone)
    return draw(st.sampled_from(simple) | switches)


@examples(150)
@given(forms(), st.lists(st.tuples(st.sampled_from((3, 8)), st.integers(-3, 3)), min_size=1, max_size=20))
def test_every_form_sums_to_one_over_its_left_side(form: Form, data: list[tuple[int, int]]) -> None:
    rows = [*data, (3, 0), (8, 1)]  # each case of a Switch has met a sample
    learnt = Specification({P(Y): Uniform(), P(X | Y): form}).identify({"X": x, "Y": y} for x, y in rows)
    question = learnt.ask(P(X | Y))
    for y in Y.values:
        p = question(Y=y).p
        assert (p >= 0).all()
        np.testing.assert_allclose(p.sum(), 1, rtol=1e-12)
