"""How a plan computes makes no difference to what it answers: cases side by side, orders, registers, constants."""

from __future__ import annotations

import re
import tracemalloc
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import (
    Description,
    Form,
    ImpossibleEvidence,
    P,
    Question,
    Specification,
    Switch,
    Table,
    Term,
    TooLarge,
    Uniform,
    Variable,
)
from brp.expression import Leaf, Product
from brp.order import _Search, best_order
from brp.plan import compiled
from brp.programs.lamp import L, Level, Theta2, lamp
from brp.programs.object import Lrl, Nlt, Nrt, Per, recognise, unacquainted
from brp.programs.watchman import pi_watchman, watchman
from tests.brp.campaign import examples
from tests.brp.joint import Array, Joint, distributions
from tests.brp.test_answers import check

Program = tuple[Description, Joint, Term]


@st.composite
def mixtures(draw: st.DrawFn) -> Program:
    """P(S1 S2 ... | K1 K2), summed over a command variable that weighs cases; some of them by zero."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    zeros = draw(st.sampled_from([0.0, 0.3, 0.6]))
    size = st.integers(1, 4)
    known = [Variable(f"K{k}", range(draw(size))) for k in range(2)]
    command = Variable("C", range(draw(st.integers(2, 4))))
    hidden = Variable("U", range(draw(size)))
    searched = [Variable(f"S{k}", range(draw(size))) for k in range(draw(st.integers(1, 3)))]
    forms: dict[Term, Form] = {P(v): Uniform() for v in known}
    tables: dict[Term, Array] = {P(v): np.full(len(v), 1 / len(v)) for v in known}

    def table(term: Term) -> Array:
        return distributions(rng, [len(v) for v in term.of], [len(v) for v in term.given], zeros)

    for term in (P(hidden | known[0]), P(command | known)):
        tables[term] = table(term)
        forms[term] = Table(tables[term])
    for v in searched:
        given = [command, *draw(st.lists(st.sampled_from([*known, hidden]), unique=True))]
        term = P(v | given)
        within = P(v | given[1:]) if len(given) > 1 else P(v)
        parts = [table(within) for _ in command.values]
        if draw(st.booleans()):
            parts[-1] = parts[0]  # two cases alike
        forms[term] = Switch(command, {c: Table(part) for c, part in zip(command.values, parts, strict=True)})
        tables[term] = np.stack(parts, axis=1)
    asked = Term(tuple(draw(st.permutations(searched))), tuple(draw(st.permutations(known))))
    return Specification(forms, name="pi").identify(), Joint(tables), asked


@examples(100)
@given(st.data())
def test_cases_side_by_side_answer_as_the_joint_written_out_in_full(data: st.DataObject) -> None:
    description, joint, asked = data.draw(mixtures())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brp.tables.FOLD", data.draw(st.sampled_from([0, 3, 300_000])))
        check(description.ask(asked), joint)


def test_a_case_that_weighs_nothing_is_not_computed_and_does_not_matter() -> None:
    """Case 1 knows something impossible; where nothing leads to it the answer is case 0's."""
    K, C, X, Y, Z = (Variable(name, range(2)) for name in ("K", "C", "X", "Y", "Z"))
    never = Specification({P(X): Table([1, 0]), P(K | X): Table([[1, 0], [0, 1]])}).identify().ask(P(X | K))
    description = Specification(
        {
            P(K): Uniform(),
            P(C | K): Table([[1, 1], [0, 0]]),
            P(X | C, K): Switch(C, {0: Table([[0.25, 0.5], [0.75, 0.5]]), 1: never}),
            P(Y | C): Switch(C, {0: Table([0.1, 0.9]), 1: Uniform()}),
            P(Z): Uniform(),
        }
    ).identify()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brp.tables.FOLD", 0)
        asked = description.ask(P(X, Y | K))
    assert asked._run({"K": 1}) is not None, "the plan itself answers, and does not leave it to logarithms"
    np.testing.assert_allclose(asked(K=1).p, np.outer([0.5, 0.5], [0.1, 0.9]), rtol=1e-15)


def test_the_watchman_computes_the_homing_only_where_it_may_home() -> None:
    """Its source has the search for the light under the weight of the Move that needs it."""
    lines = watchman.source.splitlines()
    (light,) = [line for line in lines if "most(" in line]
    assert light.startswith("        "), "under a condition"
    assert "np.zeros" in watchman.source


@st.composite
def chains_and_loops(draw: st.DrawFn) -> tuple[list[frozenset[Variable]], list[Variable]]:
    variables = [Variable(f"V{k}", range(draw(st.integers(2, 9)))) for k in range(draw(st.integers(2, 6)))]
    scopes = draw(st.lists(st.sets(st.sampled_from(variables), min_size=1, max_size=3), min_size=1, max_size=7))
    met = set().union(*scopes)
    unknown = [v for v in variables if v in met and draw(st.booleans())]
    return [frozenset(scope) for scope in scopes], unknown


@examples(100)
@given(st.data())
def test_the_search_finds_the_cheapest_of_all_orders(data: st.DataObject) -> None:
    scopes, unknown = data.draw(chains_and_loops())
    search = _Search(scopes, unknown, 100_000)
    search.exhaustively()
    every = _Search(scopes, unknown, 0)
    for order in permutations(range(len(unknown))):
        every.try_order(order)
    assert search.cost == every.cost
    assert sorted(best_order(scopes, unknown), key=str) == sorted(unknown, key=str)


def test_a_search_is_never_worse_than_the_greedy_order_whatever_the_budget() -> None:
    rng = np.random.default_rng(5)
    variables = [Variable(f"V{k}", range(10)) for k in range(12)]
    for _ in range(20):
        scopes = [frozenset(variables[int(k)] for k in rng.choice(12, 3, replace=False)) for _ in range(14)]
        met = frozenset().union(*scopes)
        unknown = [v for v in variables[2:] if v in met]
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("brp.order.DEAR", np.inf)
            greedy = best_order(scopes, unknown)
            patch.setattr("brp.order.DEAR", 0)
            found = best_order(scopes, unknown)
            assert found == best_order(scopes, unknown), "the same question, the same order"
        costs = []
        for order in (greedy, found):
            cost = _Search(scopes, unknown, 0)
            cost.try_order([cost.number[v] for v in order])
            costs.append(cost.cost)
        assert costs[1] <= costs[0]


@pytest.mark.parametrize("width", [2, 3])
def test_a_grid_answers_as_its_rows_one_after_the_other(width: int) -> None:
    """A grid of 20 values, by the forward pass over a whole row at a time; its order is searched."""
    n, height = 6, 4
    rng = np.random.default_rng(width)
    X = [[Variable(f"X{r}_{c}", range(n)) for c in range(width)] for r in range(height)]
    forms: dict[Term, Form] = {}
    for r in range(height):
        for c in range(width):
            parents = [X[r - 1][c]] * (r > 0) + [X[r][c - 1]] * (c > 0)
            forms[P(X[r][c] | parents) if parents else P(X[r][c])] = Table(
                distributions(rng, [n], [n] * len(parents), 0)
            )
    description = Specification(forms).identify()
    asked = P(X[2][1] | X[0][0], X[-1][-1])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brp.order.DEAR", 0)
        patch.setattr("brp.tables.FOLD", 0)
        searched = description.ask(asked)
    letters = {v: chr(97 + k) for k, v in enumerate(v for row in X for v in row)}
    tables = [(form.table, term) for term, form in forms.items() if isinstance(form, Table)]
    subscripts = ",".join("".join(letters[v] for v in term.variables) for _, term in tables)
    full = np.einsum(
        f"{subscripts}->{letters[X[2][1]]}{letters[X[0][0]]}{letters[X[-1][-1]]}",
        *(np.asarray(table) for table, _ in tables),
        optimize="greedy",
    )
    wanted = full / full.sum(axis=0)
    for first in range(n):
        for last in range(n):
            answer = searched(**{X[0][0].keyword: first, X[-1][-1].keyword: last})
            np.testing.assert_allclose(answer.p, wanted[:, first, last], rtol=1e-12)


def test_a_sum_is_joined_with_another_only_where_that_costs_less() -> None:
    """Weights over two variables pass a big table once; two big tables are summed one after the other."""
    A, B, C, D = (Variable(name, range(30)) for name in "ABCD")
    rng = np.random.default_rng(0)

    def over(term: Term) -> Form:
        return Table(distributions(rng, [30] * len(term.of), [30] * len(term.given), 0))

    weights = {P(A): over(P(A)), P(B): over(P(B)), P(C | A, B): over(P(C | A, B))}
    asked = Specification(weights).identify().ask(P(C))
    (inside,) = asked.simplified.start.children
    assert set(getattr(inside, "variables", ())) == {A, B}
    assert isinstance(inside.children[0], Product)
    chain = {P(A): over(P(A)), P(B | A): over(P(B | A)), P(C | B): over(P(C | B)), P(D | C): over(P(D | C))}
    asked = Specification(chain).identify().ask(P(D | A))
    (inside,) = asked.simplified.start.children
    assert len(getattr(inside, "variables", ())) == 1
    assert all(not isinstance(child, Leaf) or child.density.of == (D,) for child in inside.children[0].children)


def test_what_is_known_but_makes_no_difference_is_not_looked_up() -> None:
    """P(O | Nlt Nrt Per Lrl) is a constant before any tour, and is asked after one."""
    tour = {"Nlt": 0, "Nrt": 4, "Per": 725, "Lrl": 54, "O": 1}
    after = pi_watchman(unacquainted.learn(tour).ask(recognise.term)).identify().ask(watchman.term)
    places = {f"i{watchman.known.index(v)}" for v in (Nlt, Nrt, Per, Lrl)}

    def looked_up(question: Question) -> set[str]:
        body = "\n".join(line for line in question.source.splitlines() if "[e[" not in line)
        return {place for place in places if re.search(rf"\b{place}\b", body)}

    assert looked_up(watchman) == set()
    assert looked_up(after) == places


def test_what_is_impossible_in_one_of_several_independent_parts_is_impossible() -> None:
    """P(A B | K) is P(A | K) times P(B): the part that K excludes is a table with a gap."""
    A, B, K, S = (Variable(name, range(size)) for name, size in (("A", 2), ("B", 2), ("K", 3), ("S", 2)))
    description = Specification(
        {P(A): Table([0.5, 0.5]), P(K): Table([0.25, 0.75, 0]), P(B, S): Table([[0.1, 0.2], [0.3, 0.4]])}
    ).identify()
    question = description.ask(P(A, B | K, S), soft=S)
    with pytest.raises(ImpossibleEvidence, match=r"P\(K\) excludes it"):
        question(K=2, S=[1, 1])
    np.testing.assert_allclose(question(K=1, S=[1, 1]).p, np.outer([0.5, 0.5], [0.3, 0.7]))


def test_a_table_that_is_one_number_whatever_is_known_is_a_constant() -> None:
    """The last case of the Switch does not depend on what it knows."""
    A, C, K = Variable("A", [0]), Variable("C", range(3)), Variable("K", range(2))
    cases = {0: Table([[0.2], [0.8]]), 1: Table([[0.1], [0.9]]), 2: Uniform()}
    description = Specification(
        {P(A): Table([1.0]), P(C): Table([0.5, 0.5, 0]), P(K | C, A): Switch(C, cases)}
    ).identify()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brp.tables.FOLD", 0)
        question = description.ask(P(A | C, K))
    assert question(C=1, K=0).p.tolist() == [1.0]
    with pytest.raises(ImpossibleEvidence):
        question(C=2, K=0)


def test_the_largest_array_is_the_largest_that_is_made() -> None:
    """Three factors around one variable: two of them are multiplied before they are summed with the third."""
    A, B, C, D = (Variable(name, range(50)) for name in "ABCD")

    def over(term: Term) -> Form:
        return Table(np.full([50] * len(term.variables), 1 / 50))

    terms = (P(A), P(B | A), P(C | A), P(D | A))
    description = Specification({term: over(term) for term in terms}).identify()
    asked = description.ask(P(B, C, D))
    assert asked.simplified.largest == 50**3
    with pytest.raises(TooLarge):
        description.ask(P(B, C, D), largest=8 * 50**3 - 1)
    tracemalloc.start()
    compiled(asked.simplified.start, (), asked.searched).run(())
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 4 * 8 * 50**3


def test_questions_of_one_description_have_their_tables_together() -> None:
    description = lamp()
    description.ask(P(Theta2 | L))
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    for Li in L:
        description.ask(P(Theta2 | [other for other in L if other is not Li]))
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    table = 8 * len(L[0]) * len(Theta2) * len(Level)
    assert grown < 2 * table, f"{grown / table:.1f} tables more for eight questions that look up the same eight"
