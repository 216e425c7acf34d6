"""Propositions, expectations and explanations: the rules of section 3.2 as laws."""

from __future__ import annotations

from math import log2

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import (
    Distribution,
    ImpossibleEvidence,
    NotAValue,
    NotNumeric,
    P,
    Proposition,
    QuestionError,
    Specification,
    SpecificationError,
    Table,
    TermError,
    Uniform,
    Variable,
)
from brp.programs.home import Dir, H, Prox, Theta1, Vrot, home, homing
from tests.brp.campaign import examples
from tests.brp.joint import distributions

X, Y, Z = Variable("X", range(-1, 3)), Variable("Y", range(3)), Variable("Z", ("red", "green"))


def joint(seed: int) -> Distribution:
    rng = np.random.default_rng(seed)
    forms = {
        P(X): Table(distributions(rng, [4], [], 0.2)),
        P(Y | X): Table(distributions(rng, [3], [4], 0.2)),
        P(Z | X, Y): Table(distributions(rng, [2], [4, 3], 0.2)),
    }
    return Specification(forms, name="pi").identify().ask(P(X, Y, Z))()


@st.composite
def propositions(draw: st.DrawFn, depth: int = 2) -> Proposition:
    if depth and draw(st.booleans()):
        one = draw(propositions(depth - 1))
        match draw(st.sampled_from("&|~")):
            case "&":
                return one & draw(propositions(depth - 1))
            case "|":
                return one | draw(propositions(depth - 1))
            case _:
                return ~one
    variable = draw(st.sampled_from([X, Y, Z]))
    if variable is Z or draw(st.booleans()):
        return variable.is_(*draw(st.lists(st.sampled_from(variable.values), min_size=1, max_size=2)))
    bound = draw(st.integers(-2, 3))
    return draw(st.sampled_from([variable < bound, variable <= bound, variable > bound, variable >= bound]))


@examples(150)
@given(st.integers(0, 2**32 - 1), propositions(), propositions())
def test_e3_2_and_e3_3_and_what_follows_from_them(seed: int, a: Proposition, b: Proposition) -> None:
    p = joint(seed).probability
    assert p(a) + p(~a) == pytest.approx(1, rel=1e-12)  # [E3.3]
    if p(a) > 0:
        assert p(a & b) == pytest.approx(p(a) * p(b, a), rel=1e-12, abs=1e-15)  # [E3.2]
    else:
        with pytest.raises(ImpossibleEvidence, match="is impossible"):
            p(b, a)
    assert p(a & b) == p(b & a)
    assert p(a | b) == pytest.approx(p(a) + p(b) - p(a & b), rel=1e-12, abs=1e-15)
    assert p(~(a & b)) == pytest.approx(p(~a | ~b), rel=1e-12, abs=1e-15)


@examples(30)
@given(st.integers(0, 2**32 - 1))
def test_e3_1_and_e3_4_to_e3_6_the_rules_of_variables(seed: int) -> None:
    d = joint(seed)
    for x in X.values:
        for other in X.values:
            if other != x:
                assert d.probability(X.is_(x) & X.is_(other)) == 0  # [E3.1], exclusive
        for y in Y.values:
            both = d.marginal(X, Y)[x, y]
            assert d.probability(X.is_(x) & Y.is_(y)) == pytest.approx(both, rel=1e-12, abs=1e-15)
            if d.probability(X.is_(x)) > 0:
                conditional = d.probability(Y.is_(y), X.is_(x))
                assert both == pytest.approx(d.marginal(X)[x] * conditional, rel=1e-12, abs=1e-15)  # [E3.4]
    assert sum(d.probability(X.is_(x)) for x in X.values) == pytest.approx(1, rel=1e-12)  # [E3.5]
    assert d.probability(X.is_(*X.values)) == pytest.approx(1, rel=1e-12)  # [E3.1], exhaustive
    for y in Y.values:
        summed = sum(d.probability(X.is_(x) & Y.is_(y)) for x in X.values)
        assert summed == pytest.approx(d.marginal(Y)[y], rel=1e-12, abs=1e-15)  # [E3.6]


def test_a_proposition_prints_and_guards_against_slips() -> None:
    assert str(X.is_(1) & ~(Y > 1)) == "(X = 1) ∧ ¬(Y > 1)"
    assert str(Z.is_("red", "green") | (X <= 0)) == "(Z in {red, green}) ∨ (X <= 0)"
    assert Variable("X", range(-1, 3)) == X  # equality stays what it was
    with pytest.raises(TermError, match="not settled"):
        _ = 0 < X < 2
    with pytest.raises(NotAValue):
        X.is_(7)
    with pytest.raises(NotNumeric):
        _ = Z > 1
    with pytest.raises(TermError, match="with a number only"):
        _ = X > Y  # type: ignore[operator]  # a user's slip
    with pytest.raises(TermError, match="wants a value"):
        X.is_()


def test_a_question_answers_about_a_proposition() -> None:
    known = {"Dir": -5, "Prox": 9, "Theta1": -90}
    answer = home(**known)
    assert home.probability(Vrot > 0, **known) == pytest.approx(answer.p[11:].sum(), rel=1e-12)
    assert home.probability(Vrot.is_(10), Vrot > 0, **known) == pytest.approx(answer[10] / answer.p[11:].sum())
    with pytest.raises(QuestionError, match="H is not among what was searched"):
        home.probability(H.is_("avoidance"), **known)
    both = homing.ask(P(Vrot, H | Dir, Prox, Theta1))
    right = both.probability((Vrot > 0) & H.is_("avoidance"), **known)
    assert right == pytest.approx(both(**known).p[11:, 0].sum(), rel=1e-12)


def test_an_expectation_is_the_sum_of_utilities_weighed_by_probability() -> None:
    d = joint(3)
    worth = np.arange(24.0).reshape(4, 3, 2)
    assert d.expect(worth) == pytest.approx((d.p * worth).sum(), rel=1e-12)
    assert d.expect(lambda X: X**2) == pytest.approx(d.marginal(X).p @ np.array([1, 0, 1, 4]), rel=1e-12)
    wanted = sum(p * (x + (z == "red")) for p, (x, _, z) in zip(d.p.ravel(), d.values, strict=True))
    assert d.expect(lambda X, Z: X + (Z == "red")) == pytest.approx(wanted, rel=1e-12)
    assert d.expect(lambda: 3.0) == 3.0
    with pytest.raises(SpecificationError, match="'Speed'"):
        d.expect(lambda Speed: Speed)
    with pytest.raises(QuestionError, match="shape"):
        d.expect([1.0, 2.0])


def test_an_explanation_says_what_each_term_contributes() -> None:
    """In a product of conditionals, leaving a term out is asking without what it says."""
    rng = np.random.default_rng(5)
    tables = {P(Y): distributions(rng, [3], [], 0), P(X | Y): distributions(rng, [4], [3], 0)}
    tables[P(Z | Y)] = distributions(rng, [2], [3], 0)
    description = Specification({t: Table(p) for t, p in tables.items()}, name="pi").identify()
    told = description.ask(P(Y | X, Z)).explain(1, X=2, Z="red")
    assert told.probability == description.ask(P(Y | X, Z))(X=2, Z="red")[1]
    by_term = {c.term: c for c in told.contributions}
    assert by_term["P(X | Y pi)"].without == pytest.approx(description.ask(P(Y | Z))(Z="red")[1], rel=1e-12)
    assert by_term["P(Z | Y pi)"].without == pytest.approx(description.ask(P(Y | X))(X=2)[1], rel=1e-12)
    prior = tables[P(X | Y)][3] * tables[P(Z | Y)][0]
    assert by_term["P(Y | pi)"].without == pytest.approx(prior[1] / prior.sum(), rel=1e-12)
    for c in told.contributions:
        assert c.bits == pytest.approx(log2(told.probability / c.without), rel=1e-12)
    assert by_term["P(X | Y pi)"].at == pytest.approx(tables[P(X | Y)][3, 1], rel=1e-12)
    sizes = [abs(c.bits) for c in told.contributions]
    assert sizes == sorted(sizes, reverse=True)
    assert "P(X | Y pi)" in str(told)


def test_an_explanation_reaches_into_subroutines() -> None:
    told = home.explain(10, Dir=-5, Prox=15, Theta1=-90)
    assert {c.term for c in told.contributions} == {
        "P(H | Prox pi-home)",
        "P(Vrot | Prox Dir delta-avoid pi-obstacle)",
        "P(Vrot | Theta1 delta-phototaxy pi-phototaxy1)",
    }
    assert told.contributions[0].term == "P(Vrot | Prox Dir delta-avoid pi-obstacle)"
    assert told.contributions[0].bits > 0
    unlikely = Specification({P(X): Uniform(), P(Y | X): Table(np.eye(3)[:, [0, 1, 2, 2]])}).identify()
    never = unlikely.ask(P(X | Y)).explain(1, Y=0)
    assert never.probability == 0
    assert never.contributions[0].bits == -np.inf
    assert len({Dir, Prox, Theta1}) == 3
