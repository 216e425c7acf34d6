"""Every exact answer equals the joint distribution written out in full, on random programs."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import (
    Description,
    Dirac,
    Form,
    Gaussian,
    ImpossibleEvidence,
    P,
    Question,
    Specification,
    Switch,
    Table,
    Term,
    Uniform,
    Variable,
)
from brp.logs import logarithms
from brp.plan import compiled
from tests.brp.campaign import examples
from tests.brp.joint import Array, Joint, distributions, spread

Program = tuple[Description, Joint]


@st.composite
def programs(draw: st.DrawFn, prefix: str = "X", depth: int = 1, zeros: float | None = None) -> Program:
    """A random description and its joint: trees, loops, conjunctions, every form, Switches and subroutines."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    zeros = draw(st.sampled_from([0.0, 0.0, 0.3])) if zeros is None else zeros
    count = draw(st.integers(1, 6 if depth else 3))
    variables: list[Variable] = []
    forms: dict[Term, Form] = {}
    tables: dict[Term, Array] = {}
    while len(variables) < count:
        of = [
            Variable(f"{prefix}{len(variables) + k}", range(draw(st.integers(1, 4))))
            for k in range(draw(st.sampled_from([1, 1, 1, 2])))
        ]
        parents = draw(st.lists(st.sampled_from(variables), unique=True, max_size=3)) if variables else []
        term = Term(tuple(of), tuple(parents))
        forms[term], tables[term] = draw(form_of(term, rng, depth, zeros))
        variables.extend(of)
    order = draw(st.permutations(list(forms)))
    specification = Specification({term: forms[term] for term in order}, name="pi")
    return specification.identify(), Joint({term: tables[term] for term in forms})


@st.composite
def form_of(draw: st.DrawFn, term: Term, rng: np.random.Generator, depth: int, zeros: float) -> tuple[Form, Array]:
    of, parents = [len(v) for v in term.of], [len(v) for v in term.given]
    kinds = ["table", "table", "uniform"]
    if len(term.of) == 1:
        kinds.append("gaussian")
    if zeros:
        kinds.append("dirac")
    if term.given:
        kinds.append("switch")
        if depth:
            kinds += ["subroutine", "switch"]
    kind = draw(st.sampled_from(kinds))
    if kind == "uniform":
        return Uniform(), np.full([*of, *parents], 1 / np.prod(of))
    if kind == "gaussian":
        mean, deviation = float(rng.uniform(-1, 4)), float(rng.uniform(0.3, 3))
        weight = np.exp(-0.5 * ((term.of[0].numbers - mean) / deviation) ** 2)
        table = np.broadcast_to((weight / weight.sum()).reshape(-1, *(1 for _ in parents)), [*of, *parents])
        return Gaussian(mean, deviation), table
    if kind == "dirac":
        at = tuple(int(rng.integers(n)) for n in of)
        table = np.zeros([*of, *parents])
        table[at] = 1
        return Dirac(at if len(of) > 1 else at[0]), table
    if kind == "switch":
        command = draw(st.sampled_from(term.given))
        within = Term(term.of, tuple(v for v in term.given if v != command))
        cases: dict[Any, Form] = {}
        parts = []
        for value in command.values:
            # A case may look at fewer of the given variables than the term has.
            looks = draw(st.lists(st.sampled_from(within.given), unique=True)) if within.given else []
            if depth and draw(st.booleans()):
                cases[value], part = draw(subroutine(Term(term.of, tuple(looks)), rng))
                parts.append(
                    spread(part, (*term.of, *looks), within.variables) * np.ones([len(v) for v in within.variables])
                )
            else:
                cases[value], part = draw(form_of(within, rng, 0, zeros))
                parts.append(part)
        stacked = np.stack(parts, axis=-1)
        axes = (*within.variables, command)
        return Switch(command, cases), stacked.transpose([axes.index(v) for v in term.variables])
    if kind == "subroutine":
        return draw(subroutine(term, rng))
    table = distributions(rng, of, parents, zeros)
    return Table(table), table


@st.composite
def subroutine(draw: st.DrawFn, term: Term, rng: np.random.Generator) -> tuple[Form, Array]:
    """A question of another description with hidden variables of its own, over renamed variables."""
    new = {v: Variable(v.name + "s", v.values) for v in term.variables}
    hidden = Variable("X0", range(3))  # the name of a variable outside, on purpose
    known, searched = [new[v] for v in term.given], [new[v] for v in term.of]
    tables: dict[Term, Array] = {}
    forms: dict[Term, Form] = {}
    nested = draw(st.sampled_from([0, 0, 0, 1]))  # its terms may be subroutines of their own

    def add(term: Term) -> None:
        forms[term], tables[term] = draw(form_of(term, rng, nested, 0.0))

    if draw(st.booleans()):  # inverse: what is known depends on what is searched, and there is a division
        add(P(*searched))
        add(P(hidden | searched))
        for v in known:
            add(P(v | (*searched, hidden)))
    else:
        for v in known:
            add(P(v))
        add(P(hidden | known))
        add(Term(tuple(searched), (*known, hidden)))
    inner = Specification(forms, name="pi-inner").identify()
    asked = Term(tuple(searched), tuple(known))
    form = inner.ask(asked).renamed({v: k for k, v in new.items()})
    return form, Joint(tables).conditional(asked)


@st.composite
def questions(draw: st.DrawFn, program: Program) -> Term:
    roles = [(v, draw(st.sampled_from("skkuu"))) for v in program[0].variables]
    searched = [v for v, role in roles if role == "s"] or [roles[0][0]]
    known = [v for v, role in roles if role == "k" and v not in searched]
    return Term(tuple(draw(st.permutations(searched))), tuple(draw(st.permutations(known))))


def check(question: Question, joint: Joint) -> None:
    """All evidence, as the question answers it, by a plan that is no table, and by logarithms."""
    wanted = joint.conditional(question.term)
    plan = compiled(question.simplified.start, question.known, question.searched)
    for values in product(*(v.values for v in question.known)):
        at = tuple(v.place(value) for v, value in zip(question.known, values, strict=True))
        expected = wanted[(slice(None),) * len(question.searched) + at]
        known = {v.keyword: value for v, value in zip(question.known, values, strict=True)}
        if np.isnan(expected).any():
            with pytest.raises(ImpossibleEvidence) as refused:
                question(**known)
            assert refused.value.terms
            assert plan.run(at) is None
            continue
        np.testing.assert_allclose(question(**known).p, expected, rtol=1e-12, atol=1e-15)
        logs = logarithms(question.simplified.start, question.searched, dict(zip(question.known, at, strict=True)))
        np.testing.assert_allclose(np.exp(logs) * np.ones(expected.shape), expected, rtol=1e-12, atol=1e-15)
        run = plan.run(at)
        assert run is not None
        np.testing.assert_allclose(run.reshape(expected.shape), expected, rtol=1e-12, atol=1e-15)


@examples(200)
@given(st.data())
def test_a_question_answers_as_the_joint_written_out_in_full(data: st.DataObject) -> None:
    program = data.draw(programs())
    description, joint = program
    for _ in range(3):
        check(description.ask(data.draw(questions(program))), joint)


@examples(60)
@given(st.data())
def test_a_plan_that_may_fold_nothing_answers_the_same(data: st.DataObject) -> None:
    program = data.draw(programs())
    term = data.draw(questions(program))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brp.tables.FOLD", 0)
        patch.setattr("brp.tables.LEAF", data.draw(st.sampled_from([0, 10, 10**6])))
        patch.setattr("brp.plan.SUMS", 1)
        patch.setattr("brp.order.DEAR", data.draw(st.sampled_from([0, 10**6])))
        patch.setattr("brp.logs.BLOCK", data.draw(st.sampled_from([0, 10**6])))
        check(program[0].ask(term), program[1])


def test_logarithms_know_what_only_tells_the_cases_of_a_question_apart() -> None:
    a, b, c = (Variable(name, range(2)) for name in "ABC")
    inner = Specification(
        {
            P(a): Table([0.3, 0.7]),
            P(b): Uniform(),
            P(c | (a, b)): Switch(b, {0: Table([[0.2, 0.6], [0.8, 0.4]]), 1: Table([[0.9, 0.5], [0.1, 0.5]])}),
        },
        name="inner",
    ).identify(name="delta")
    outer = Specification({P(b): Table([0.4, 0.6]), P(c): Uniform(), P(a | (b, c)): inner.ask(P(a | (b, c)))})
    question = outer.identify().ask(P((b, c) | a))
    for place in range(2):
        logs = logarithms(question.simplified.start, question.searched, {a: place})
        np.testing.assert_allclose(np.exp(logs), question(A=place).p, rtol=1e-12)
