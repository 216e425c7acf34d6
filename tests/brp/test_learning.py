"""One datum at a time: the description that learning makes is the one that all data together identify."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import brp
from brp import (
    DataError,
    Description,
    Form,
    Gaussian,
    Histogram,
    Laplace,
    Nearest,
    NotAValue,
    P,
    Prior,
    Specification,
    Switch,
    Term,
    Uniform,
    Variable,
    simplification,
)
from tests.brp.campaign import examples

Class = Variable("O", range(4))
Nlt = Variable("Nlt", range(5))
Per = Variable("Per", range(40))
Lrl = Variable("Lrl", (0.1, 0.2, 0.35, 0.7))

Datum = dict[str, Any]
data = st.fixed_dictionaries(
    {
        "O": st.sampled_from(Class.values),
        "Nlt": st.sampled_from(Nlt.values),
        "Per": st.sampled_from(Per.values),
        "Lrl": st.sampled_from(Lrl.values),
    }
)
gaussians = st.sampled_from(
    [
        Gaussian(floor=0.01),
        Gaussian(unvisited="uniform"),
        Gaussian(unvisited=Prior(mean=10, deviation=4, strength=2)),
        Gaussian(unvisited=Nearest(scale={"O": 2})),
    ]
)
counts = st.sampled_from([Laplace(), Laplace(bins=2), Histogram(), Histogram(unvisited=Nearest())])


@st.composite
def specifications(draw: st.DrawFn) -> Specification:
    per: Form = draw(gaussians)
    if draw(st.booleans()):
        # Every case of the Switch sees some of the samples only, and may have met none.
        per = Switch(Class, {0: Uniform(), 1: Gaussian(unvisited="uniform"), (2, 3): Laplace(bins=8)})
    return Specification(
        {
            P(Class): draw(st.sampled_from([Uniform(), Laplace()])),
            P(Nlt | Class): draw(counts),
            P(Per | Class): per,
            P(Lrl | Nlt): Gaussian(unvisited="uniform", floor=0.01),
        },
        name="pi-object",
    )


ASKED = (P(Class | Nlt, Per, Lrl), P(Per | Class), P(Nlt, Lrl | Class), P(Class))


def same(one: Description, other: Description, rtol: float = 1e-9) -> None:
    for term in ASKED:
        a, b = one.ask(term), other.ask(term)
        for place in range(5):
            known = {v.keyword: v.values[place * 7 % len(v)] for v in term.given}
            try:
                expected = b(**known).p
            except brp.ImpossibleEvidence:
                with pytest.raises(brp.ImpossibleEvidence):
                    a(**known)
                continue
            np.testing.assert_allclose(a(**known).p, expected, rtol=rtol, atol=1e-13)


@examples(40)
@given(specifications(), st.lists(data, min_size=1, max_size=10), st.integers(1, 10), st.booleans())
def test_learning_one_datum_at_a_time_is_identifying_with_all(
    specification: Specification, rows: list[Datum], first: int, asked: bool
) -> None:
    learnt = specification.identify(rows[:first], name="delta")
    for datum in rows[first:]:
        if asked:
            for term in ASKED:
                learnt.ask(term)
        learnt = learnt.learn(datum)
    same(learnt, specification.identify(rows, name="delta"))


@examples(40)
@given(specifications(), st.lists(data, min_size=1, max_size=8), st.lists(data, min_size=1, max_size=4))
def test_forgetting_is_the_inverse_of_learning(
    specification: Specification, rows: list[Datum], more: list[Datum]
) -> None:
    before = specification.identify(rows)
    after = before
    for datum in more:
        after = after.learn(datum, weight=2)
    for datum in more:
        after = after.forget(datum, weight=2)
    same(after, before, rtol=1e-6)  # Lrl has no whole numbers: its sums keep a rounding


@examples(40)
@given(specifications(), st.lists(st.tuples(data, st.integers(1, 3)), min_size=1, max_size=8))
def test_a_weight_is_a_number_of_observations(specification: Specification, rows: list[tuple[Datum, int]]) -> None:
    weighed = specification.identify([datum for datum, _ in rows], weights=[weight for _, weight in rows])
    same(weighed, specification.identify([datum for datum, weight in rows for _ in range(weight)]))


def test_whole_numbers_are_learnt_and_forgotten_exactly() -> None:
    specification = Specification({P(Class): Uniform(), P(Per | Class): Gaussian(floor=0.01)})
    rng = np.random.default_rng(1)
    data = {"O": rng.integers(0, 4, 500), "Per": rng.integers(0, 40, 500)}
    learnt = specification.identify(data)
    question = P(Per | Class)
    expected = learnt.ask(question)(O=2).p
    for per in range(40):
        learnt = learnt.learn({"O": 2, "Per": per})
    for per in rng.permutation(40):
        learnt = learnt.forget({"O": 2, "Per": int(per)})
    np.testing.assert_array_equal(learnt.ask(question)(O=2).p, expected)


def test_learning_leaves_the_description_before_it_as_it_was() -> None:
    specification = Specification({P(Class): Laplace(), P(Per | Class): Gaussian(unvisited="uniform")})
    first = specification.identify({"O": [1], "Per": [14]}, name="delta")
    before = {term: first.ask(term)(O=1).p.copy() for term in (P(Per | Class),)}
    second = first.learn({"O": 1, "Per": 16})
    assert second.ask(P(Per | Class))(O=1).mean() == pytest.approx(15, abs=0.5)
    for term, p in before.items():
        np.testing.assert_array_equal(first.ask(term)(O=1).p, p)
    assert str(second.ask(P(Per | Class))) == "P(Per | O delta)"


def test_questions_keep_their_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    """The symbolic phase is done once; the descriptions after it only put in their own numbers."""
    done: list[Term] = []
    simplify = simplification.simplify

    def counted(*arguments: Any, **named: Any) -> Any:
        done.append(arguments[1])
        return simplify(*arguments, **named)

    monkeypatch.setattr("brp.question.simplify", counted)
    specification = Specification({P(Class): Uniform(), P(Nlt | Class): Laplace(), P(Per | Class): Gaussian()})
    learnt = specification.identify({"O": [1], "Nlt": [1], "Per": [30]})
    for _ in range(20):
        answer = learnt.ask(P(Class | Nlt, Per))(Nlt=2, Per=7)
        learnt = learnt.learn({"O": answer.best(), "Nlt": 2, "Per": 7})
    assert len(done) == 1


def test_what_came_before_is_let_go() -> None:
    """Memory does not grow with the data: no description holds the one before it."""
    specification = Specification({P(Class): Uniform(), P(Nlt | Class): Laplace(), P(Per | Class): Gaussian()})
    learnt = specification.identify({"O": [1], "Nlt": [1], "Per": [30]})
    before = []
    for _ in range(5):
        learnt.ask(P(Class | Nlt, Per))(Nlt=2, Per=7)
        before.append(weakref.ref(learnt))
        learnt = learnt.learn({"O": 2, "Nlt": 2, "Per": 7})
    gc.collect()
    assert [reference() for reference in before] == [None] * 5


def test_what_is_kept_of_the_data_does_not_grow_with_them() -> None:
    """Constant time and memory: the numbers that a description holds are as many after 300 data as after 3."""
    specification = Specification({P(Class): Laplace(), P(Nlt | Class): Histogram(), P(Per | Class): Gaussian()})
    learnt = specification.identify({"O": [1], "Nlt": [1], "Per": [30]})
    held = []
    for count in range(300):
        learnt = learnt.learn({"O": count % 4, "Nlt": count % 5, "Per": count % 40})
        if count in (2, 299):
            held.append(numbers(learnt))
    assert held[0] == held[1] > 0


def numbers(description: Description) -> int:
    """How many numbers the forms of a description hold, in arrays or otherwise."""
    total, waiting, met = 0, [vars(description[term]) for term in description.specification.terms], set()
    while waiting:
        here: Any = waiting.pop()
        if id(here) in met or isinstance(here, type | str | Variable):
            continue
        met.add(id(here))
        if isinstance(here, np.ndarray):
            total += here.size
        elif isinstance(here, int | float):
            total += 1
        elif isinstance(here, dict):
            waiting.extend(here.values())
        elif isinstance(here, list | tuple | set):
            waiting.extend(here)
        elif hasattr(here, "__dict__"):
            waiting.append(vars(here))
    return total


def test_a_free_form_may_begin_without_data() -> None:
    specification = Specification({P(Class): Uniform(), P(Per | Class): Gaussian()})
    learnt = specification.identify().learn({"O": 1, "Per": 30}).learn({"O": 1, "Per": 32})
    assert learnt.ask(P(Per | Class))(O=0).best() == 31


def test_a_given_parameter_does_not_learn() -> None:
    specification = Specification({P(Class): Laplace(), P(Per | Class): Gaussian()})
    learnt = specification.identify(parameters={P(Per | Class): Gaussian(3, 1)}).learn({"O": 1})
    assert learnt.ask(P(Per))().best() == 3
    assert learnt.ask(P(Class))()[1] == pytest.approx(2 / 5)


def test_a_datum_that_does_not_fit_is_refused_with_a_sentence() -> None:
    specification = Specification({P(Class): Laplace(), P(Per | Class): Gaussian()})
    learnt = specification.identify({"O": [1, 1], "Per": [30, 31]})
    with pytest.raises(DataError, match="no column for Per"):
        learnt.learn({"O": 1})
    with pytest.raises(NotAValue, match="Per = 40"):
        learnt.learn({"O": 1, "Per": 40})
    with pytest.raises(DataError, match="weighs -1"):
        learnt.learn({"O": 1, "Per": 3}, weight=-1)
    with pytest.raises(DataError, match=r"P\(O\) cannot forget a datum that it never learnt"):
        learnt.forget({"O": 2, "Per": 30})
    with pytest.raises(DataError, match=r"P\(Per | O\) cannot forget"):
        learnt.forget({"O": 1, "Per": 5})
    with pytest.raises(DataError, match="weighs less than nothing"):
        specification.identify({"O": [1], "Per": [30]}, weights=[-1])
    with pytest.raises(DataError, match=r"shape \(2,\), and 1 samples"):
        specification.identify({"O": [1], "Per": [30]}, weights=[1, 1])
    with pytest.raises(DataError, match="no finite number"):
        specification.identify({"O": [1], "Per": [30]}, weights=[float("inf")])
