"""The watchman's question (E10.4) for the others: by hand in numpy, and as a network that the peers can say.

The network means the same as the program. What the peers cannot say is said otherwise:

* P(Base | Px1 ... L8) and P(Theta2 | L1 ... L8) are questions of two descriptions that share L1..L8. One network
  has one L1, so that pi-base gets copies, which are told the same values.
* P(Vrot | Move H Dir Prox DirL ProxL Theta2) goes by cases; written out it is a table of 1.0e9 cells. Two more
  variables (Case: which question Vrot comes from; Lead: what Vrot is if it comes from Theta2 or DirL alone, and
  otherwise DirL) make it three tables of 1.1 million cells together.
* The other questions used as forms (of pi-behavior, pi-move, pi-home) are written out as conditional tables.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers import Model
from brp import Form, P, Question, Specification, Table, Term, Uniform, Variable
from brp.programs.base import Base, L, Px, at_base
from brp.programs.behavior import behavior
from brp.programs.fusion import Theta2, fusing
from brp.programs.home import H, command2
from brp.programs.move import Move, move
from brp.programs.object import unacquainted
from brp.programs.obstacle import avoid, follow
from brp.programs.phototaxy2 import phototaxy2
from brp.programs.speed import (
    GLARE,
    NEAR,
    Dir,
    DirL,
    Prox,
    ProxL,
    Vrot,
    Vtrans,
    Vtrans_c,
    from_the_light,
    past_it,
    speeding,
    towards_the_light,
)
from brp.programs.watchman import O, watchman

__all__ = ["by_hand", "network"]

Array = NDArray[np.float64]

Case = Variable("Case", ("still", "avoid", "follow", "seek", "light", "glare", "past"))
Lead = Variable("Lead", Vrot.values)
copies = tuple(Variable(f"{Li}_base", Li.values) for Li in L)

of_vtrans = speeding.ask(P(Vtrans | Move, Prox, ProxL, Vtrans_c))


def written(term: Term, form: Form) -> Array:
    """P(of | given) as a table, its axes those of ``term.of + term.given``."""
    uniform: dict[Any, Any] = {P(v): Uniform() for v in term.given}
    return Model.of(Specification({**uniform, term: form}).identify()).tables[term]


def ordered(question: Question, *axes: Variable) -> Array:
    """The answers of a question, contiguous, its axes in this order."""
    table = written(question.term, question)
    return np.ascontiguousarray(table.transpose([question.term.variables.index(v) for v in axes]))


def light() -> Array:
    """P(Vrot | DirL) of an approach, axes (Vrot, DirL)."""
    return written(P(Vrot | DirL), towards_the_light)


def glare() -> Array:
    """P(Vrot | Dir Prox DirL) of wandering before a light, axes in this order."""
    return written(P(Vrot | Dir, Prox, DirL), from_the_light)


def past() -> Array:
    """P(Vrot | Dir DirL) of an approach past something, axes in this order."""
    return written(P(Vrot | Dir, DirL), past_it)


def cases() -> Array:
    """P(Case | Move H ProxL), all of them 0 or 1; axes in this order."""
    p = np.zeros((len(Case), len(Move), len(H), len(ProxL)))
    at, moves = Case.places, Move.places
    for m in ("stop", "blow"):
        p[at["still"], moves[m]] = 1
    p[at["glare"], moves["wander"], :, list(GLARE)] = 1
    p[at["avoid"], moves["wander"]] = 1 - p[at["glare"], moves["wander"]]
    p[at["follow"], moves["follow"]] = 1
    avoidance, phototaxy = H.places["avoidance"], H.places["phototaxy"]
    p[at["avoid"], moves["home"], avoidance] = 1
    p[at["seek"], moves["home"], phototaxy] = 1
    p[at["light"], moves["approach"], phototaxy] = 1
    p[at["past"], moves["approach"], avoidance, list(NEAR)] = 1
    p[at["avoid"], moves["approach"], avoidance] = 1 - p[at["past"], moves["approach"], avoidance]
    return p


def still() -> Array:
    """Dirac(0) on Vrot."""
    p = np.zeros(len(Vrot))
    p[Vrot.places[0]] = 1
    return p


def by_hand() -> Callable[..., Array]:
    """E10.4 in numpy, everything that does not depend on the evidence computed beforehand.

    pi-base has two values, so that its fusion is a sum of sixteen log-ratios; pi-fusion adds eight rows of logs and
    takes out the largest. Behavior is summed out beforehand (Base, six known values and Tempo, Tour to Move). Vrot
    and Vtrans given the evidence are seven rows and six; which go together, by Move and H, is a matrix of 7 by 6.
    No object has been presented, so that P(O | Nlt Nrt Per Lrl) is the same whatever is known: a constant here. brp
    asks it each time, as it must once a tour was learnt.
    """
    base = Model.of(at_base.description)
    ratios = [
        (np.log(base.tables[P(v | Base)][:, 1]) - np.log(base.tables[P(v | Base)][:, 0])).tolist()
        for v in (*Px, *L)
    ]
    lights = Model.of(fusing)
    logs = [np.ascontiguousarray(np.log(lights.tables[P(Li | Theta2)])) for Li in L]
    hard = [v for v in behavior.known if v != Base]
    behaviors = ordered(behavior, *hard, Base, behavior.searched[0])
    moves = ordered(move, *(v for v in move.known if v != behavior.searched[0]), behavior.searched[0], Move)
    count = len(hard)
    both = np.tensordot(
        behaviors, moves, axes=([count + 1], [moves.ndim - 2])
    )  # hard, Base, last, tempo, tour, Move
    weights = np.ascontiguousarray(np.moveaxis(both, count, -2))  # ... (Base, Move)
    places = [(v.keyword, v.places) for v in (*hard, *(v for v in move.known if v != behavior.searched[0]))]
    obstacles = np.zeros((len(Dir), len(Prox), len(Case), len(Vrot)))
    obstacles[:, :, 0] = still()
    obstacles[:, :, 1] = ordered(avoid, Dir, Prox, Vrot)
    obstacles[:, :, 2] = ordered(follow, Dir, Prox, Vrot)
    seek = ordered(phototaxy2, Theta2, Vrot)
    lead = np.ascontiguousarray(light().T)
    glares = np.ascontiguousarray(np.moveaxis(glare(), 0, -1))
    passes = np.ascontiguousarray(np.moveaxis(past(), 0, -1))
    # (Prox, ProxL, Case, Move): H summed out.
    together = np.einsum("cmhl,hp->plcm", cases(), ordered(command2, H, Prox))
    speeds = ordered(of_vtrans, Prox, ProxL, Vtrans_c, Move, Vtrans)
    objects = unacquainted.ask(P(O))().p
    met = int(objects.argmax())
    assert objects[met] == 1
    shape = (len(Vrot), len(Vtrans), len(O))

    def ask(**told: Any) -> Array:
        get = told.__getitem__
        r = 0.0
        for ratio, keyword in sensors:
            r += ratio[told[keyword]]
        p_base = 1 / (1 + exp(-r)) if r > -700 else 0.0
        w = weights[tuple([steps[told[keyword]] for keyword, steps in places])]
        w = (1 - p_base) * w[0] + p_base * w[1]
        a, b, c, d, e, f, g, h = logs
        s = a[get("L1")] + b[get("L2")] + c[get("L3")] + d[get("L4")]
        s = s + e[get("L5")] + f[get("L6")] + g[get("L7")] + h[get("L8")]
        theta = np.exp(s - s.max())
        prox, near = told["Prox"], told["ProxL"]
        rows = obstacles[told["Dir"] + 10, prox].copy()
        np.dot(theta, seek, rows[3])
        rows[3] /= theta.sum()
        rows[4] = lead[told["DirL"] + 10]
        rows[5] = glares[told["Dir"] + 10, prox, told["DirL"] + 10]
        rows[6] = passes[told["Dir"] + 10, told["DirL"] + 10]
        answer = np.zeros(shape)
        answer[:, :, met] = np.dot(rows.T, np.dot(together[prox, near] * w, speeds[prox, near, told["Vtrans_c"]]))
        return answer

    sensors = [(ratio, v.keyword) for ratio, v in zip(ratios, (*Px, *L), strict=True)]
    return ask


def network() -> Model:
    """The program as a network of tables (see above), and the question that is asked of it."""
    base, lights, objects = (Model.of(each).tables for each in (at_base.description, fusing, unacquainted))
    tables: dict[Term, Array] = {**lights, **objects}
    for term, table in base.items():
        renamed = dict(zip(L, copies, strict=True))
        tables[Term(tuple(renamed.get(v, v) for v in term.of), term.given)] = table
    for question in (behavior, move, command2, of_vtrans):
        tables[question.term] = written(question.term, question)
    tables[P(Case | Move, H, ProxL)] = cases()
    p = np.zeros((len(Lead), len(Case), len(Theta2), len(DirL)))
    p += still()[:, None, None, None]
    p[:, 3] = ordered(phototaxy2, Vrot, Theta2)[:, :, None]
    p[:, 4] = light()[:, None, :]
    p[:, 5:] = np.eye(len(Lead))[:, None, None, :]  # DirL, which has the same values
    tables[P(Lead | Case, Theta2, DirL)] = p
    p = np.zeros((len(Vrot), len(Lead), len(Case), len(Dir), len(Prox)))
    p[:, :, 0] = still()[:, None, None, None]
    p[:, :, 1] = ordered(avoid, Vrot, Dir, Prox)[:, None]
    p[:, :, 2] = ordered(follow, Vrot, Dir, Prox)[:, None]
    p[:, :, 3:5] = np.eye(len(Vrot))[:, :, None, None, None]
    p[:, :, 5] = glare().transpose(0, 3, 1, 2)
    p[:, :, 6] = past().transpose(0, 2, 1)[..., None]
    tables[P(Vrot | Lead, Case, Dir, Prox)] = p
    defined = {v for term in tables for v in term.of}
    for v in watchman.known:
        if v not in defined:
            tables[P(v)] = np.full(len(v), 1 / len(v))
    known = (*watchman.known, *copies)
    asked = Specification({t: Table(p) for t, p in tables.items()}).identify().ask(Term(watchman.searched, known))
    return Model(tables, asked, {copy.keyword: Li.keyword for copy, Li in zip(copies, L, strict=True)})
