"""The same program for every engine: conditional tables, and how each peer is asked in the fastest way it has."""

from __future__ import annotations

import string
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp import Description, Question, Term, Variable
from brp.expression import node
from brp.logs import logarithms
from brp.order import best_order

__all__ = ["Model", "drawing", "engines"]

Array = NDArray[np.float64]
Engine = Callable[..., Array]


@dataclass
class Model:
    """A conditional table for each term, its axes those of ``term.of + term.given``.

    ``asked`` is the question of the peers where they get another network than brp's description; ``copies`` are
    keywords of known variables of it that are told what another keyword is told.
    """

    tables: Mapping[Term, Array]
    asked: Question | None = None
    copies: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, description: Description) -> Model:
        """A description written out: what stands by cases, or is a question, becomes a table."""
        tables: dict[Term, Array] = {}
        for term in description.specification.terms:
            (factor,) = [f for f in description.relevant(Term(term.of)) if set(f.of) == set(term.of)]
            logs = logarithms(node(factor), term.variables)
            full = np.ascontiguousarray(np.broadcast_to(np.exp(logs), tuple(map(len, term.variables))))
            tables[term] = full / full.sum(axis=tuple(range(len(term.of))))
        return cls(tables)

    def within(self, question: Question) -> dict[Term, Array]:
        """The terms that lead to a variable of the question; the others sum to 1, for whoever does not see it."""
        defining = {v: term for term in self.tables for v in term.of}
        wanted: set[Term] = set()
        waiting = list(question.term.variables)
        while waiting:
            term = defining[waiting.pop()]
            if term not in wanted:
                wanted.add(term)
                waiting.extend(term.given)
        return {term: table for term, table in self.tables.items() if term in wanted}


def engines(model: Model, question: Question) -> dict[str, Engine]:
    """The peers that are installed and can say the question."""
    able: dict[str, Engine] = {}
    for name, make in (("einsum", _einsum), ("pyagrum", _pyagrum), ("pgmpy", _pgmpy)):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # a peer's own, when it is imported
                able[name] = _told(make(model, model.asked or question), model.copies)
        except ImportError:
            continue
        except ValueError as error:
            print(f"  {question.name}: {name} cannot say it: {error}")
    return able


def drawing(variable: Variable) -> dict[str, Callable[[Array], Callable[[], Any]]]:
    """For each peer that draws, by its own chance: from a table's numbers to what draws from it."""
    try:
        gum: Any = import_module("pyagrum")
    except ImportError:
        return {}
    own = gum.RangeVariable(variable.keyword, variable.keyword, 0, len(variable) - 1)

    def pyagrum(p: Array) -> Callable[[], Any]:
        tensor = gum.Tensor().add(own)
        tensor[:] = p
        return lambda: tensor.draw()

    return {"pyagrum": pyagrum}


def _told(engine: Engine, copies: Mapping[str, str]) -> Engine:
    """The engine, the copies told what their originals are."""
    if not copies:
        return engine
    return lambda **told: engine(**told, **{copy: told[keyword] for copy, keyword in copies.items()})


def _einsum(model: Model, question: Question) -> Engine:
    """numpy's own contraction, its path found once; known axes first in every table."""
    terms = model.within(question)
    hard = [v for v in question.known if v not in question.soft]
    free = list(dict.fromkeys(v for term in terms for v in term.variables if v not in hard))
    if len(free) > len(string.ascii_letters):
        return _einsum_by_variable(terms, question, hard)
    letter = dict(zip(free, string.ascii_letters, strict=False))
    operands: list[tuple[Array, list[tuple[str, Mapping[Any, int]]]]] = []
    inputs: list[str] = []
    for term, table in terms.items():
        known = [v for v in term.variables if v in hard]
        left = [v for v in term.variables if v not in hard]
        if not left or (np.ptp(table) == 0 and len(term.variables) == 1):
            continue  # a constant
        order = [term.variables.index(v) for v in (*known, *left)]
        operands.append((np.ascontiguousarray(table.transpose(order)), [(v.keyword, v.places) for v in known]))
        inputs.append("".join(letter[v] for v in left))
    soft = [v.keyword for v in question.soft]
    inputs += [letter[v] for v in question.soft]
    output = "".join(letter[v] for v in question.searched)
    missing = [v for v in question.searched if not any(letter[v] in part for part in inputs)]
    if missing:
        raise ValueError(f"nothing is left of {missing[0]}")
    subscripts = f"{','.join(inputs)}->{output}"
    shapes: list[Array] = [np.empty(table.shape[len(known) :]) for table, known in operands]
    shapes += [np.empty(len(v)) for v in question.soft]
    path: Any = False
    if len(shapes) > 2:
        path = np.einsum_path(subscripts, *shapes, optimize=("greedy", 50_000_000))[0]

    def ask(**told: Any) -> Array:
        rows = [table[tuple([places[told[k]] for k, places in known])] for table, known in operands]
        p: Array = np.einsum(subscripts, *rows, *[told[k] for k in soft], optimize=path)
        p /= p.sum()
        return p

    return ask


def _einsum_by_variable(terms: Mapping[Term, Array], question: Question, hard: Sequence[Variable]) -> Engine:
    """More variables than it has letters: a contraction for each that is summed, in an order found once."""
    if question.soft:
        raise ValueError("soft evidence on so many variables")
    known = [(v.keyword, v.places) for v in hard]
    operands: list[tuple[Array, list[int]]] = []
    pool: dict[int, tuple[Variable, ...]] = {}
    for term, table in terms.items():
        told = [v for v in term.variables if v in hard]
        left = tuple(v for v in term.variables if v not in hard)
        if left:
            order = [term.variables.index(v) for v in (*told, *left)]
            pool[len(operands)] = left
            operands.append((np.ascontiguousarray(table.transpose(order)), [hard.index(v) for v in told]))
    unknown = [v for v in dict.fromkeys(v for left in pool.values() for v in left) if v not in question.searched]
    steps: list[tuple[str, list[int]]] = []
    for variable in [*best_order([frozenset(left) for left in pool.values()], unknown), None]:
        bucket = [k for k, left in pool.items() if variable is None or variable in left]
        free = list(dict.fromkeys(v for k in bucket for v in pool[k]))
        letter = dict(zip(free, string.ascii_letters, strict=False))
        made = tuple(v for v in free if v != variable) if variable is not None else question.searched
        subscripts = ",".join("".join(letter[v] for v in pool.pop(k)) for k in bucket)
        steps.append((f"{subscripts}->{''.join(letter[v] for v in made)}", bucket))
        pool[len(operands) + len(steps) - 1] = made

    def ask(**told: Any) -> Array:
        places = [steps[told[k]] for k, steps in known]
        made: list[Array] = [table[tuple([places[k] for k in of])] for table, of in operands]
        for subscripts, bucket in steps:
            made.append(np.einsum(subscripts, *[made[k] for k in bucket]))
        p = made[-1]
        answer: Array = p / p.sum()
        return answer

    return ask


def _pyagrum(model: Model, question: Question) -> Engine:
    """pyAgrum's LazyPropagation, its evidence changed in place."""
    gum: Any = import_module("pyagrum")
    net = gum.BayesNet()
    terms = model.within(question)
    for term in terms:
        for v in term.of:
            net.add(gum.RangeVariable(v.keyword, v.keyword, 0, len(v) - 1))
    for term, table in terms.items():
        if len(term.of) > 1:
            raise ValueError(f"{term} has several variables left of its bar")
        for v in term.given:
            net.addArc(v.keyword, term.of[0].keyword)
        flat = table.transpose([*range(1, table.ndim), 0])
        cpt = net.cpt(term.of[0].keyword)
        names = [v.keyword for v in (*term.given, *term.of)]
        wanted = list(reversed(cpt.names))
        cpt[:] = np.ascontiguousarray(flat.transpose([names.index(name) for name in wanted]))
    engine = gum.LazyPropagation(net)
    targets = [v.keyword for v in question.searched]
    if len(targets) > 1:
        engine.addJointTarget(set(targets))
    else:
        engine.setTargets(set(targets))
    places = [(v.keyword, v.places) for v in question.known if v not in question.soft]
    soft = [v.keyword for v in question.soft]
    start: dict[str, Any] = dict.fromkeys((k for k, _ in places), 0)
    start |= {v.keyword: [1.0] * len(v) for v in question.soft}
    engine.setEvidence(start)

    def ask(**told: Any) -> Array:
        for keyword, steps in places:
            engine.chgEvidence(keyword, steps[told[keyword]])
        for keyword in soft:
            engine.chgEvidence(keyword, told[keyword].tolist())
        if len(targets) == 1:
            p: Array = engine.posterior(targets[0]).toarray()
            return p
        found = engine.jointPosterior(set(targets))
        axes = list(reversed(found.names))
        joint: Array = found.toarray().transpose([axes.index(keyword) for keyword in targets])
        return joint

    return ask


def _pgmpy(model: Model, question: Question) -> Engine:
    """pgmpy's variable elimination."""
    import logging

    from pgmpy.factors.discrete import TabularCPD
    from pgmpy.inference import VariableElimination
    from pgmpy.models import DiscreteBayesianNetwork

    logging.getLogger("pgmpy").setLevel(logging.ERROR)
    net = DiscreteBayesianNetwork()
    for term, table in model.within(question).items():
        if len(term.of) > 1:
            raise ValueError(f"{term} has several variables left of its bar")
        of = term.of[0]
        net.add_node(of.keyword)
        net.add_edges_from((v.keyword, of.keyword) for v in term.given)
        columns = table.reshape(len(of), -1)
        given = {"evidence": [v.keyword for v in term.given], "evidence_card": [len(v) for v in term.given]}
        net.add_cpds(TabularCPD(of.keyword, len(of), columns, **(given if term.given else {})))
    engine = VariableElimination(net)
    targets = [v.keyword for v in question.searched]
    places = [(v.keyword, v.places) for v in question.known if v not in question.soft]
    soft: list[Variable] = list(question.soft)

    def ask(**told: Any) -> Array:
        evidence = {keyword: steps[told[keyword]] for keyword, steps in places}
        virtual = [TabularCPD(v.keyword, len(v), told[v.keyword].reshape(-1, 1)) for v in soft]
        found = engine.query(targets, evidence=evidence, virtual_evidence=virtual or None, show_progress=False)
        p: Array = found.values
        return p

    return ask
