"""Questions: names, formulas, evidence, impossibility, and rightness where numbers get small."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brp import (
    Dirac,
    EvidenceError,
    Form,
    Gaussian,
    ImpossibleEvidence,
    NotAValue,
    P,
    QuestionError,
    Specification,
    SpecificationError,
    Switch,
    Table,
    Term,
    TermError,
    TooLarge,
    Uniform,
    Variable,
)

A = Variable("A", range(3))
B = Variable("B", range(2))
C = Variable("C", ("red", "green"))
Before = Variable("Behavior_t-1", ("idle", "patrol"))


def test_terms_are_values_and_print_as_the_paper_writes_them() -> None:
    assert P(A | B, C) == P(A | [B, C]) == P(A | (B, C)) == Term((A,), (B, C))
    assert len({P(A | B), P(A | B), P(A)}) == 2
    assert str(P(A, B | C, Before)) == "P(A B | C Behavior_t-1)"
    assert P([A, B] | C) == P(A, B | C)
    assert Variable("A", [0, 1, 2]) == A == Variable("A", np.arange(3))
    word: Any = "A"
    for wrong in (
        lambda: P(),
        lambda: P(A | A),
        lambda: P(A | B | C),
        lambda: P(word),
        lambda: Variable("1", [0]),
    ):
        with pytest.raises(TermError):
            wrong()


def test_a_question_prints_its_data_set_and_specification_in_the_order_asked() -> None:
    specification = Specification({P(A): Uniform(), P(B): Uniform(), P(C | A, B): Uniform()}, name="pi-obstacle")
    push = specification.identify(name="delta-push")
    assert push.ask(P(C | B, A)).name == "P(C | B A delta-push pi-obstacle)"
    assert specification.identify().ask(P(C | A, B)).name == "P(C | A B pi-obstacle)"
    assert push.ask(P(C | A)) is push.ask(P(C | A))
    with pytest.raises(QuestionError, match=r"identify\(\) makes it a description"):
        specification.ask(P(C))


def test_the_simplification_says_what_it_did() -> None:
    rows = [[0.2, 0.5], [0.3, 0.4], [0.5, 0.1]]
    specification = Specification(
        {P(B): Uniform(), P(A | B): Table(rows), P(C | A): Table([[0.1, 0.2, 0.3], [0.9, 0.8, 0.7]])}, name="pi"
    )
    question = specification.identify().ask(P(A | B))
    assert str(question) == "P(A | B pi)"
    assert str(question.simplified).splitlines() == [
        "left to compute: P(A | B pi)",
        "uniform, dropped: P(B | pi)",
        "sums to 1, vanished: P(C | A pi)",
        "largest array: 3 numbers; 3 multiplications",
    ]
    assert [str(factor) for factor in question.simplified.flat] == ["P(B | pi)"]
    backwards = specification.identify().ask(P(B | C))
    assert str(backwards) == "P(B | C pi)\n= 1/Σ × Σ_{A} [ P(A | B pi) × P(C | A pi) ]"
    assert str(backwards.simplified).splitlines() == [
        "left to compute: 1/Σ × Σ_{A} [ P(A | B pi) × P(C | A pi) ]",
        "uniform, dropped: P(B | pi)",
        "summed, in this order: A",
        "largest array: 2 numbers; 8 multiplications",
    ]
    assert backwards.simplified.order == (A,)
    known = specification.identify().ask(P(C | A, B))
    assert [str(factor) for factor in known.simplified.constant] == ["P(A | B pi)"]


def test_the_simplification_names_every_term_that_it_dropped_or_moved() -> None:
    D, E = Variable("D", range(2)), Variable("E", range(2))
    forms: dict[Term, Form] = {
        P(B): Table([0.2, 0.8]),
        P(A | B): Table([[0.2, 0.5], [0.3, 0.4], [0.5, 0.1]]),
        P(D | B): Table([[1, 0], [0, 1]]),
        P(C | A): Table([[0.1, 0.2, 0.3], [0.9, 0.8, 0.7]]),
        P(E | B): Table([[0.1, 0.2], [0.9, 0.8]]),
    }
    asked = Specification(forms, name="pi").identify().ask(P(C, E | D, B))
    assert str(asked.simplified).splitlines() == [
        "left to compute: 1/Σ × P(D | B pi) × P(E | B pi) × Σ_{A} [ P(A | B pi) × P(C | A pi) ]",
        "constant, dropped: P(B | pi)",
        "constant, kept since it may be zero: P(D | B pi)",
        "outside the sum: P(E | B pi)",
        "summed, in this order: A",
        "largest array: 4 numbers; 10 multiplications",
    ]
    alone = Specification(forms, name="pi").identify().ask(P(A | B))
    assert "sums to 1, vanished: P(D | B pi), P(C | A pi), P(E | B pi)" in str(alone.simplified)


def test_a_name_with_a_minus_is_known_with_an_underscore() -> None:
    question = Specification({P(Before): Uniform(), P(C | Before): Table(np.eye(2))}).identify().ask(P(C | Before))
    assert question(Behavior_t_1="patrol").best() == "green"


def test_evidence_that_does_not_fit_is_refused_at_once() -> None:
    question = (
        Specification({P(A): Uniform(), P(B): Uniform(), P(C | A, B): Uniform()}, name="pi")
        .identify()
        .ask(P(C | A, B))
    )
    with pytest.raises(NotAValue, match=r"A = 3 is not one of its values \(0..2\), in P\(C \| A B pi\)"):
        question(A=3, B=0)
    with pytest.raises(NotAValue, match=r"A = \[1\]"):
        question(A=[1], B=0)
    with pytest.raises(EvidenceError, match="must be told B"):
        question(A=1)
    with pytest.raises(EvidenceError, match="does not know C; it knows A B"):
        question(A=1, B=0, C="red")
    assert question(A=np.int64(1), B=np.int8(0)).p.tolist() == [0.5, 0.5]


def test_a_question_about_a_foreign_variable_is_refused() -> None:
    description = Specification({P(A): Uniform()}, name="pi").identify()
    with pytest.raises(QuestionError, match="pi has no variable B; it has A"):
        description.ask(P(A | B))


def test_impossible_evidence_names_the_terms_that_exclude_it() -> None:
    specification = Specification(
        {
            P(A): Table([0.5, 0.5, 0.0]),
            P(B | A): Dirac(lambda A: min(A, 1)),
            P(C | A): Table({0: {"red": 1}, 1: {"green": 1}, 2: {"red": 1}}),
        },
        name="pi",
    )
    description = specification.identify()
    with pytest.raises(ImpossibleEvidence, match=r"A = 2 is impossible .*: P\(A \| pi\) excludes it") as alone:
        description.ask(P(C | A))(A=2)
    assert alone.value.terms == ("P(A | pi)",)
    with pytest.raises(ImpossibleEvidence, match="together exclude it") as together:
        description.ask(P(A | B, C))(B=0, C="green")
    assert together.value.terms == ("P(B | A pi)", "P(C | A pi)")


def test_a_constant_term_that_may_be_zero_is_not_forgotten() -> None:
    """B has nothing to do with A, and B = 1 never happens."""
    description = Specification({P(A): Table([0.2, 0.3, 0.5]), P(B): Table([1.0, 0.0])}).identify()
    assert description.ask(P(A | B))(B=0).p.tolist() == pytest.approx([0.2, 0.3, 0.5])
    with pytest.raises(ImpossibleEvidence):
        description.ask(P(A | B))(B=1)


def test_a_question_too_large_is_refused_before_anything_is_allocated() -> None:
    big = [Variable(f"V{i}", range(1000)) for i in range(4)]
    description = Specification({P(v): Gaussian(3, 2) for v in big}, name="pi").identify()
    tracemalloc.start()
    with pytest.raises(TooLarge, match=r"8000000 MB, more than the 256 MB allowed, and [0-9.e+]+ multiplications"):
        description.ask(P(*big))
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()
    assert description.ask(P(big[0]))().best() == 3


def test_a_subroutine_must_fit_the_term_that_it_stands_for() -> None:
    question = Specification({P(A): Uniform(), P(B | A): Uniform()}, name="pi").identify().ask(P(B | A))
    with pytest.raises(SpecificationError, match=r"answers about B, and P\(A\) wants A"):
        Specification({P(A): question})
    with pytest.raises(SpecificationError, match=r"must know A, which P\(B \| C\) does not give"):
        Specification({P(C): Uniform(), P(B | C): question})
    with pytest.raises(SpecificationError, match="A cannot be renamed C: their values differ"):
        question.renamed({A: C})


def test_a_subroutine_is_no_evidence_about_what_it_knows() -> None:
    """P(B | A) of the inner description is normalised for every A, whatever the inner description thinks of A."""
    inner = Specification({P(B): Uniform(), P(A | B): Table([[0.8, 0.1], [0.1, 0.1], [0.1, 0.8]])}).identify()
    outer = Specification({P(A): Uniform(), P(B | A): inner.ask(P(B | A))}).identify()
    np.testing.assert_allclose(outer.ask(P(A))().p, np.full(3, 1 / 3), rtol=1e-12)
    np.testing.assert_allclose(outer.ask(P(B | A))(A=0).p, [8 / 9, 1 / 9], rtol=1e-12)


def test_a_subroutines_own_variable_is_not_one_of_the_same_name_around_it() -> None:
    """Not even one that vanished while the subroutine was simplified: A here, which no case depends on."""
    even = Specification({P(A): Uniform(), P(C): Table([0.1, 0.9])}, name="pi-even").identify()
    forms: dict[Term, Form] = {
        P(B): Uniform(),
        P(A | B): Table(lambda A: (A + 1) / 6),
        P(C | B, A): Switch(B, dict.fromkeys(B.values, even.ask(P(C | A)))),
    }
    inner = Specification(forms, name="pi-inner").identify()
    around: dict[Term, Form] = {P(A): Table([0.5, 0.3, 0.2]), P(B): Uniform(), P(C | B): inner.ask(P(C | B))}
    answer = Specification(around).identify().ask(P(A, C))()
    np.testing.assert_allclose(answer.p, np.outer([0.5, 0.3, 0.2], [0.1, 0.9]), rtol=1e-12)


def test_eight_contradictory_sensors_are_unlikely_and_not_impossible() -> None:
    """Deviation 10 of 512: every product of eight probabilities underflows, the answer does not."""
    Theta = Variable("Theta", range(36))
    light = [Variable(f"L{i}", range(512)) for i in range(8)]
    forms = {P(Theta): Uniform()} | {
        P(v | Theta): Gaussian(mean=lambda Theta, i=i: 511 * abs((Theta - 4.5 * i) % 36 - 18) / 18, deviation=10)
        for i, v in enumerate(light)
    }
    question = Specification(forms).identify().ask(P(Theta | light))
    rng = np.random.default_rng(2)
    theta = np.arange(36)
    for _ in range(20):
        readings = rng.integers(0, 512, 8)
        logs = np.zeros(36)
        for i, reading in enumerate(readings):
            mean = 511 * np.abs((theta - 4.5 * i) % 36 - 18) / 18
            exponent = -0.5 * ((np.arange(512)[:, None] - mean) / 10) ** 2
            logs += exponent[reading] - np.log(np.exp(exponent).sum(axis=0))
        expected = np.exp(logs - logs.max())
        answer = question(**{f"L{i}": reading for i, reading in enumerate(readings)})
        np.testing.assert_allclose(answer.p, expected / expected.sum(), rtol=1e-10, atol=1e-50)


def test_a_hidden_markov_model_over_ten_thousand_steps_is_answered() -> None:
    steps, states = 10_000, 4
    rng = np.random.default_rng(4)
    move = rng.dirichlet(np.ones(states), size=states).T
    see = rng.dirichlet(np.full(5, 0.3), size=states).T
    X = [Variable(f"X{t}", range(states)) for t in range(steps)]
    Y = [Variable(f"Y{t}", range(5)) for t in range(steps)]
    forms: dict[Term, Form] = {P(X[0]): Uniform()}
    transition, observation = Table(move), Table(see)
    forms |= {P(X[t] | X[t - 1]): transition for t in range(1, steps)}
    forms |= {P(Y[t] | X[t]): observation for t in range(steps)}
    question = Specification(forms).identify().ask(P(X[-1] | Y))
    seen = rng.integers(0, 5, steps)
    belief = np.full(states, 1 / states)
    for t in range(steps):
        belief = (move @ belief if t else belief) * see[seen[t]]
        belief /= belief.sum()
    answer = question(**{f"Y{t}": value for t, value in enumerate(seen)})
    np.testing.assert_allclose(answer.p, belief, rtol=1e-9)


def test_a_switch_never_becomes_a_table_over_all_that_its_cases_know() -> None:
    """Six inputs of 60 values would be 4.7e10 cells; as cases it is a few numbers."""
    inputs = [Variable(f"S{i}", range(60)) for i in range(6)]
    Which = Variable("Which", range(6))
    Out = Variable("Out", range(60))
    cases: dict[int, Form] = {}
    for i, v in enumerate(inputs):
        one = Specification({P(v): Uniform(), P(Out | v): Dirac(_same(v.keyword))}).identify()
        cases[i] = one.ask(P(Out | v))
    forms: dict[Term, Form] = {P(v): Uniform() for v in inputs}
    forms[P(Which)] = Table([0.1, 0.2, 0.3, 0.2, 0.1, 0.1])
    forms[P(Out | Which, *inputs)] = Switch(Which, cases)
    description = Specification(forms).identify()
    known = {v.keyword: 10 * i for i, v in enumerate(inputs)}
    answer = description.ask(P(Out | inputs))(**known)
    np.testing.assert_allclose(answer.p[::10], [0.1, 0.2, 0.3, 0.2, 0.1, 0.1], rtol=1e-12)
    which = description.ask(P(Which | Out, *inputs))(Out=20, **known)
    assert which[2] == 1
    named = description.ask(P(Out | Which, *inputs))(Which=3, **known)
    assert named[30] == 1


def _same(name: str) -> Callable[..., int]:
    scope: dict[str, Any] = {}
    exec(f"def same({name}): return {name}", scope)  # noqa: S102  (a function whose parameter has a computed name)
    same: Callable[..., int] = scope["same"]
    return same


def test_importing_brp_needs_numpy_and_nothing_else() -> None:
    program = (
        "import sys; import numpy; before = set(sys.modules); import brp, brp.programs.home; "
        "print(*{m.split('.')[0] for m in set(sys.modules) - before} - set(sys.stdlib_module_names))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) <= {"brp", "numpy"}
