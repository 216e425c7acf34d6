"""What a user gets wrong is answered with a sentence that names it, at once, and before anything is allocated."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brp import (
    BrpError,
    DataError,
    Dirac,
    EvidenceError,
    Filter,
    Form,
    Gaussian,
    Histogram,
    Laplace,
    Nearest,
    NotAValue,
    P,
    Prior,
    QuestionError,
    Sampling,
    Sigmoid,
    Specification,
    SpecificationError,
    Switch,
    Table,
    Term,
    TermError,
    TooLarge,
    Uniform,
    Variable,
    tree,
)

A, B, Prox = Variable("A", range(3)), Variable("B", range(2)), Variable("Prox", range(16))
BIG = [Variable(f"G{k}", range(10_000)) for k in range(4)]
EVEN: dict[Term, Form] = {P(v): Uniform() for v in (B, Prox, *BIG)}
asked = Specification({**EVEN, P(A | B): Table(np.full((3, 2), 1 / 3))}).identify().ask(P(A | B))
# What a type checker would refuse already.
NOTHING: Any = None
LISTED: Any = [1]
THREE: Any = 3
NO_TERM: Any = A
softly = asked.description.ask(P(A | B), soft=B)
BOTH = Specification({P(A): Uniform(), P(B): Uniform()}, name="pi-both").identify().ask(P(A, B))()
GAUSSIAN = Specification({P(Prox): Uniform(), P(A | Prox): Gaussian()}, name="pi-taught")
MISSPELT: Any = "A"
TRUTH: Any = A == 1


@pytest.mark.parametrize(
    ("slip", "refusal", "words"),
    [
        (lambda: Variable("X", [1.0, float("nan")]), TermError, "nan is no value"),
        (lambda: Variable("X", [NOTHING, 1]), TermError, "None is no value"),
        (lambda: Variable("X", [LISTED, 2]), TermError, "no value for a variable"),
        (lambda: Specification({P(A, B): Dirac((1,))}), SpecificationError, "a tuple of 2 values"),
        (lambda: Specification({P(A, B): Dirac(1)}), SpecificationError, "a tuple of 2 values"),
        (lambda: Switch(B, {0: Uniform(), 1: THREE}), SpecificationError, "3 for 1, which is no form"),
        (
            lambda: Specification({**EVEN, P(A | B): Switch(Prox, dict.fromkeys(range(16), Uniform()))}),
            SpecificationError,
            "which is not right of its bar",
        ),
        (
            lambda: Specification({P(Prox): Uniform(), P(B | Prox): Sigmoid(1, alpha=float("nan"), beta=1)}),
            SpecificationError,
            "no number",
        ),
        (lambda: Variable("X", THREE), TermError, "a sequence of values in their order"),
        (lambda: Variable("X", {1, 2}), TermError, "in their order"),
        (lambda: Variable(THREE, [1]), TermError, "no name for a variable"),
        (lambda: A > 0 & B, TermError, "neither true nor false"),
        (lambda: ~A, TermError, r"write ~\(A > 0\)"),
        (lambda: Specification(LISTED), SpecificationError, "a mapping from its terms"),
        (lambda: GAUSSIAN.ask(P(A | Prox)), QuestionError, r"identify\(\) makes it a description"),
        (lambda: GAUSSIAN.identify(MISSPELT), DataError, "rows of values by name"),
        (lambda: GAUSSIAN.identify([(1, 2)]), DataError, r"datum 0 is \(1, 2\)"),  # type: ignore[list-item]
        (lambda: GAUSSIAN.identify({"A": 1, "Prox": 2}), DataError, "1 for A, and not a column"),
        (lambda: GAUSSIAN.identify([]).learn(THREE), DataError, "a datum is a mapping"),
        (lambda: asked.description[P(B | A)], QuestionError, r"has no term P\(B \| A\); it has P\(B\), "),
        (lambda: asked.description.ask(P(A | B), soft=MISSPELT), QuestionError, "^A cannot be known softly"),
        (lambda: asked(1), EvidenceError, r"by name \(B=\), and not \(1,\)"),
        (lambda: asked(b=1), EvidenceError, "must be told B, and not b"),
        (lambda: asked.batch(LISTED), EvidenceError, "columns by name"),
        (lambda: asked.probability(TRUTH, B=1), QuestionError, r"say A.is_\(value\)"),
        (lambda: asked(B=1).marginal(), QuestionError, "at least"),
        (lambda: asked(B=1).draw(THREE), QuestionError, "a numpy.random.Generator"),
        (lambda: BOTH[1], QuestionError, "one value for each"),
        (lambda: BOTH["ab"], QuestionError, "one value for each"),
        (lambda: Gaussian(unvisited=MISSPELT), SpecificationError, "not 'A'"),
        (lambda: Histogram(unvisited=MISSPELT), SpecificationError, "not 'A'"),
        (lambda: Prior(0, -1), SpecificationError, "a deviation above 0"),
        (lambda: Prior(0, 1, -1), SpecificationError, "a strength of 0 or more"),
        (
            lambda: (
                Specification({P(Prox): Uniform(), P(A | Prox): Gaussian(unvisited=Nearest({"Pox": 2}))})
                .identify({"A": [1], "Prox": [1]})
                .ask(P(A | Prox))
            ),
            SpecificationError,
            "scales Pox, which it is not given; it has Prox",
        ),
        (lambda: Specification({P(A): Gaussian(MISSPELT, 1)}), SpecificationError, "'A', which is no number"),
        (
            lambda: Specification({**EVEN, P(A | B): Gaussian(lambda B: NOTHING, 1)}),
            SpecificationError,
            "None, which",
        ),
        (lambda: Switch(MISSPELT, {}), SpecificationError, "a command variable and a mapping"),
        (lambda: Switch(B, LISTED), SpecificationError, "a command variable and a mapping"),
        (lambda: Specification({P(A, B): Table({1: 0.5})}), SpecificationError, "one value for each searched"),
        (
            lambda: Specification({P(A): Laplace()}).identify(parameters={P(A): THREE}),
            SpecificationError,
            "given 3, which is no form",
        ),
        (lambda: asked.where_impossible(THREE), QuestionError, "a form, and not 3"),
        (lambda: asked.where_impossible(without=MISSPELT), QuestionError, "does not know A"),
        (lambda: asked.description.ask(P(A | B), largest=16), TooLarge, "24 bytes, more than the 16 bytes"),
        (lambda: tree(asked.description, NO_TERM), QuestionError, "wants a term"),
        (lambda: tree(asked.description, P(A | B), {"A": 1}), EvidenceError, "must be told B, and not A"),
        (lambda: Sampling(asked.description, NO_TERM), QuestionError, "wants a term"),
        (lambda: Filter(asked.description, NO_TERM), QuestionError, "a mapping from what is now"),
        (lambda: asked.description.ask(NO_TERM), QuestionError, "wants a term"),
        (lambda: asked.batch({"B": "abc"}), EvidenceError, "a column of values"),
        (lambda: asked.batch({"B": 1}), EvidenceError, "a column of values"),
        (lambda: softly(B={0: "much"}), NotAValue, "'much' of 0"),
        (lambda: asked(B=1).marginal(A, A), QuestionError, "a variable twice"),
        (lambda: asked(B=1).at(1.0), QuestionError, "no uniform number"),
        (lambda: asked(B=1).at(float("nan")), QuestionError, "no uniform number"),
        (lambda: Specification({P(A): Laplace()}).identify([]).learn({}), DataError, "no column for A"),
        (lambda: Specification({**EVEN, P(A | BIG): Laplace()}), SpecificationError, "30000000000000000 numbers"),
        (lambda: Specification({**EVEN, P(A | BIG): Histogram()}), SpecificationError, "30000000000000000 numbers"),
        (lambda: Specification({**EVEN, P(A | BIG): Gaussian()}), SpecificationError, "10000000000000000 numbers"),
        (lambda: Specification({**EVEN, P(A | BIG): Table({})}), SpecificationError, "30000000000000000 numbers"),
        (
            lambda: Specification({**EVEN, P(A | BIG): Table(lambda A, G0, G1: 1 / 3)}),
            SpecificationError,
            "the 300000000 combinations of A G0 G1",
        ),
        (lambda: Specification({P(BIG): Uniform()}).identify().ask(P(BIG)), TooLarge, "an array of 80000000000 MB"),
    ],
)
def test_a_slip_is_answered_with_a_sentence(slip: Callable[[], Any], refusal: type[BrpError], words: str) -> None:
    with pytest.raises(refusal, match=words):
        slip()


def test_an_answer_is_gone_through_by_its_values_and_not_by_itself() -> None:
    """A loop over it would ask it for 0, 1, 2 and so on."""
    with pytest.raises(TypeError, match="not iterable"):
        list(asked(B=1))  # type: ignore[call-overload]


def test_what_is_looked_at_says_what_it_is() -> None:
    """The prior of an unvisited cell and what data have made of a form are in a description's repr."""
    taught = GAUSSIAN.identify({"A": [1, 2], "Prox": [3, 3]}, name="delta-two")
    assert repr(P(A | B)) == "P(A | B)"
    assert "P(A | Prox) = Gaussian(unvisited=Nearest(), floor=0.7)" in repr(GAUSSIAN)
    assert repr(taught).startswith("Description delta-two pi-taught\n  Prox in {0..15}, 16 values\n")
    assert "<Gaussian(unvisited=Nearest(), floor=0.7) identified from 2 samples in 1 cells>" in repr(taught)


def test_the_cases_of_a_switch_are_told_apart() -> None:
    cases = Switch(B, {0: Gaussian(0, 1), 1: Gaussian(2, 1)})
    asked = Specification({P(B): Uniform(), P(A | B): cases}, name="pi").identify().ask(P(A))
    assert "P(A | 0 pi)" in str(asked)
    assert "P(A | 1 pi)" in str(asked)


def test_a_variable_may_be_named_as_the_engine_names_its_own() -> None:
    """What is known is told by keyword, and no keyword is taken."""
    for name in ("self", "value", "known", "rows", "proposition", "given", "told", "e", "r0", "np"):
        v = Variable(name, range(3))
        description = Specification({P(v): Uniform(), P(B | v): Table(np.full((2, 3), 0.5))}).identify()
        question = description.ask(P(B | v))
        assert question(**{name: 1})[0] == 0.5
        assert question.probability(B > 0, **{name: 1}) == 0.5
        assert question.explain(0, **{name: 1}).probability == 0.5
        assert question.possible(**{name: 2})
        assert description.ask(P(B | v), soft=v)(**{name: [1, 0, 0]})[1] == 0.5


def test_a_function_of_the_users_that_fails_says_where() -> None:
    with pytest.raises(ZeroDivisionError) as failed:
        Specification({P(B): Uniform(), P(A | B): Gaussian(lambda B: 1 / B, 1)})
    assert failed.value.__notes__ == ["in the mean of P(A | B), for B = 0"]
