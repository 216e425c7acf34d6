"""The engine beside its peers: microseconds a query on the paper's own questions, and on chains and grids.

    python -m benchmarks.engine [--json FILE] [--only NAME ...] [--seconds S]

All engines answer the same evidence, drawn anew for each query, and take turns; keyword evidence goes in, a
normalised array comes out. Answers are compared to 1e-9 before anything is timed. ``numpy`` is written by hand for
the one question and keeps brp's promises (logarithms, normalised, keywords); ``einsum`` has its path cached. The
peers are an extra (``pip install khepera-hil[peers]``) and are left out when they are not there. The watchman's
network, for those that cannot say the program, is in `benchmarks.watchman`.
"""

from __future__ import annotations

import argparse
import gc
import importlib.util
import json
import math
import os
import platform
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from benchmarks.by_hand import of_chain, of_grid
from benchmarks.peers import Model, drawing, engines
from benchmarks.watchman import by_hand, network
from brp import Description, P, Question, Specification, Table, Uniform, Variable

Array = NDArray[np.float64]
Engine = Callable[..., Array]

PAPER = ("fusion", "out_of_order", "home", "behavior", "watchman")
COMPARED = 5
"""So many answers of each engine are compared with brp's before anything is timed."""

WATCHMAN = (
    "einsum, pyagrum and pgmpy get a network of the same meaning: L1..L8 twice, the cases of Vrot by two more "
    "variables (1.36 million cells in all); numpy takes P(O | ...) for the constant that it is before any tour"
)


@dataclass
class Case:
    """One question, and who can answer it."""

    name: str
    question: Question
    model: Model | None = None
    hand: Engine | None = None
    compile_ms: float = 0.0
    fits: Callable[[dict[str, Any]], bool] = lambda told: True
    note: str = ""
    engines: dict[str, Engine] = field(default_factory=dict)

    def evidence(self, rng: np.random.Generator) -> dict[str, Any]:
        """Known values drawn evenly; weights for what is known softly."""
        while True:
            told: dict[str, Any] = {}
            for v in self.question.known:
                told[v.keyword] = rng.dirichlet(np.ones(len(v))) if v in self.question.soft else _drawn(v, rng)
            if self.fits(told):
                return told


def _drawn(variable: Variable, rng: np.random.Generator) -> Any:
    return variable.values[int(rng.integers(len(variable)))]


def _normalised(p: Array) -> Array:
    answer: Array = p / p.sum()
    return answer


def _compiled(question: Question) -> tuple[Question, float]:
    """The question compiled once more, its tables warm, and the milliseconds that this took."""
    gc.collect()
    start = time.perf_counter()
    fresh = Question(
        question.description, question.term, question.largest, soft=question.soft, rules=question.rules
    )
    return fresh, (time.perf_counter() - start) * 1e3


def paper() -> Iterator[Case]:
    """The five questions of the paper."""
    from brp.programs import behavior as section9
    from brp.programs import fusion, watchman
    from brp.programs import home as section7

    light = Model.of(fusion.fusing)
    logs = [np.ascontiguousarray(np.log(table)) for term, table in light.tables.items() if term.given]

    def locate(L1: int, L2: int, L3: int, L4: int, L5: int, L6: int, L7: int, L8: int) -> Array:
        a, b, c, d, e, f, g, h = logs
        s = a[L1] + b[L2] + c[L3] + d[L4] + e[L5] + f[L6] + g[L7] + h[L8]
        p = np.exp(s - s.max())
        return _normalised(p)

    yield Case("fusion", fusion.locate, light, locate)

    first = np.ascontiguousarray(np.exp(logs[0]).T)

    def broken(L2: int, L3: int, L4: int, L5: int, L6: int, L7: int, L8: int) -> Array:
        _, b, c, d, e, f, g, h = logs
        s = b[L2] + c[L3] + d[L4] + e[L5] + f[L6] + g[L7] + h[L8]
        p = np.dot(np.exp(s - s.max()), first)
        return _normalised(p)

    yield Case("out_of_order", fusion.out_of_order(1), light, broken)

    program = Model.of(section7.homing)
    turn = program.tables[P(section7.Vrot | section7.Dir, section7.Prox, section7.Theta1, section7.H)]
    avoid = np.ascontiguousarray(turn[..., 0, 0].transpose(1, 2, 0))
    seek = np.ascontiguousarray(turn[:, 0, 0, :, 1].T)
    weight = np.ascontiguousarray(program.tables[P(section7.H | section7.Prox)].T)

    def home(Dir: int, Prox: int, Theta1: int) -> Array:
        w = weight[Prox]
        p: Array = w[0] * avoid[Dir + 10, Prox] + w[1] * seek[(Theta1 + 170) // 10]
        return p

    yield Case("home", section7.home, program, home)

    known = section9.behavior.known
    forms: dict[Any, Any] = {P(v): Uniform() for v in known}
    forms[P(section9.Behavior | known)] = section9.behavior
    level = Specification(forms, name="pi-watchman").identify()
    asked = level.ask(P(section9.Behavior | known), soft=section9.Base)
    tables = Model.of(level)
    table = tables.tables[P(section9.Behavior | known)]
    axes = [v.keyword for v in known]
    rows = np.ascontiguousarray(np.moveaxis(table, (0, 1 + axes.index("Base")), (-1, -2)))
    places = [(v.keyword, v.places) for v in known if v.keyword != "Base"]

    def behave(**told: Any) -> Array:
        p: Array = np.dot(told["Base"], rows[tuple([place[told[keyword]] for keyword, place in places])])
        return _normalised(p)

    yield Case("behavior", asked, tables, behave)
    yield Case("watchman", watchman.watchman, network(), by_hand(), note=WATCHMAN)


def chain(length: int) -> Case:
    """20 values; the ends known, the middle searched."""
    rng = np.random.default_rng(length)
    X = [Variable(f"X{t}", range(20)) for t in range(length)]
    tables: dict[Any, Array] = {P(X[0]): rng.dirichlet(np.ones(20))}
    tables |= {P(X[t] | X[t - 1]): rng.dirichlet(np.ones(20), size=20).T for t in range(1, length)}
    return _random(f"chain_{length}", tables, P(X[length // 2] | X[0], X[-1]), of_chain(X, tables))


def grid(width: int) -> Case:
    """``width`` by 8, 20 values, each given the one above and the one at its left; two corners known."""
    rng = np.random.default_rng(width)
    X = [[Variable(f"X{r}_{c}", range(20)) for c in range(width)] for r in range(8)]
    tables: dict[Any, Array] = {}
    for r in range(8):
        for c in range(width):
            parents = [X[r - 1][c]] * (r > 0) + [X[r][c - 1]] * (c > 0)
            of = rng.dirichlet(np.ones(20), size=(20,) * len(parents))
            tables[P(X[r][c] | parents) if parents else P(X[r][c])] = np.moveaxis(of, -1, 0)
    return _random(f"grid_{width}", tables, P(X[4][width // 2] | X[0][0], X[7][width - 1]), of_grid(X, tables))


def _random(name: str, tables: dict[Any, Array], asked: Any, hand: Engine) -> Case:
    description: Description = Specification({t: Table(p) for t, p in tables.items()}, name=name).identify()
    return Case(name, description.ask(asked), Model(tables), hand)


def measure(case: Case, seconds: float) -> dict[str, dict[str, float]]:
    """Median and 99th percentile of every engine, in microseconds; the engines take turns."""
    rng = np.random.default_rng(1)
    question, case.compile_ms = _compiled(case.question)

    def ours(**told: Any) -> Array:
        return question(**told).p

    able: dict[str, Engine] = {"brp": ours}
    if case.hand is not None:
        able["numpy"] = case.hand
    if case.model is not None:
        able |= engines(case.model, question)
    compared = [case.evidence(rng) for _ in range(COMPARED)]
    for name in list(able):
        try:
            for told in compared:
                np.testing.assert_allclose(able[name](**told), ours(**told), rtol=1e-9, atol=1e-9)
        except Exception as error:  # noqa: BLE001  (a peer may fail in any way; it is left out, and said so)
            print(f"  {case.name}: {name} is left out: {str(error).strip().splitlines()[0][:90]}")
            del able[name]
    spent = dict.fromkeys(able, 0.0)
    times: dict[str, list[float]] = {name: [] for name in able}
    while any(spent[name] < seconds and len(times[name]) < 20_000 for name in able):
        rows = [case.evidence(rng) for _ in range(20)]
        for name, engine in able.items():
            if spent[name] >= seconds:
                continue
            for row in rows:
                start = time.perf_counter()
                engine(**row)
                took = time.perf_counter() - start
                times[name].append(took)
                spent[name] += took
                if spent[name] >= seconds:
                    break
    return {name: _spread(t) for name, t in times.items()}


def draws() -> dict[str, dict[str, dict[str, float]]]:
    """A first draw from an answer of 36 values, and a later one from the same answer."""
    from brp import Distribution

    rng = np.random.default_rng(2)
    X = Variable("X", range(36))
    peers = drawing(X)
    times: dict[str, dict[str, list[float]]] = {"draw": {}, "draw_again": {}}

    def take(question: str, engine: str, draw: Callable[[], Any]) -> None:
        start = time.perf_counter()
        draw()
        times[question].setdefault(engine, []).append(time.perf_counter() - start)

    for _ in range(5000):
        p = rng.dirichlet(np.ones(36))
        answer = Distribution((X,), p)
        take("draw", "brp", lambda answer=answer: answer.draw(rng))  # type: ignore[misc]  # a default binds it
        take("draw", "numpy", lambda p=p: X.values[int(p.cumsum().searchsorted(rng.random(), "right"))])  # type: ignore[misc]
        for name, of in peers.items():
            take("draw", name, of(p))
        answer.draw(rng)  # makes the list that later ones search
        take("draw_again", "brp", lambda answer=answer: answer.draw(rng))  # type: ignore[misc]
    return {question: {name: _spread(t) for name, t in of.items()} for question, of in times.items()}


def _spread(times: Sequence[float]) -> dict[str, float]:
    """Median and 99th percentile, in microseconds."""
    return {"median_us": float(np.median(times)) * 1e6, "p99_us": float(np.percentile(times, 99)) * 1e6}


def batch(question: Question) -> dict[str, dict[str, float]]:
    """A query in a batch: of 10 000, or of as many as make an answer of 100 MB."""
    rng = np.random.default_rng(3)
    count = min(10_000, 12_500_000 // math.prod(map(len, question.searched)))
    rows = {
        v.keyword: rng.dirichlet(np.ones(len(v)), size=count)
        if v in question.soft
        else np.array(v.values)[rng.integers(len(v), size=count)]
        for v in question.known
    }
    question.batch(rows)
    times = []
    for _ in range(5):
        start = time.perf_counter()
        question.batch(rows)
        times.append((time.perf_counter() - start) / count)
    return {"brp": _spread(times)}


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.engine", description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="write {question: {engine: {median_us, p99_us}}}")
    parser.add_argument("--only", nargs="*", help="these questions only")
    parser.add_argument("--seconds", type=float, default=1.0, help="for each engine and question")
    asked = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # one core for all
    machine = f"{platform.machine()}, Python {platform.python_version()}, numpy {np.__version__}"
    print(f"{machine}, one core; us, median (99th percentile)")
    for peer in ("pyagrum", "pgmpy"):
        if importlib.util.find_spec(peer) is None:
            print(f"  {peer} is not installed (the extra `peers`)")
    warnings.filterwarnings("ignore", module="pgmpy|pyagrum|benchmarks.peers")  # the peers' own
    makers: list[tuple[str, Callable[[], Case]]] = [(case.name, lambda case=case: case) for case in paper()]  # type: ignore[misc]  # a default binds the case
    makers += [(f"chain_{n}", lambda n=n: chain(n)) for n in (10, 200, 1000)]  # type: ignore[misc]
    makers += [(f"grid_{n}", lambda n=n: grid(n)) for n in (2, 3, 4)]  # type: ignore[misc]
    results: dict[str, dict[str, dict[str, float]]] = {}
    for name, make in makers:
        if asked.only and name not in asked.only:
            continue
        case = make()
        results[name] = measure(case, asked.seconds)
        _show(name, results[name], f"compiled in {case.compile_ms:.1f} ms; {case.note}".rstrip("; "))
        if name in PAPER:
            results[f"batch_{name}"] = batch(case.question)
            _show(f"batch_{name}", results[f"batch_{name}"], "a query in a batch")
    for name, row in draws().items() if not asked.only or "draw" in asked.only else ():
        results[name] = row
        _show(name, row, "of 36 values")
    if asked.json:
        with open(asked.json, "w", encoding="utf-8") as file:
            json.dump(results, file, indent=2)


def _show(name: str, row: dict[str, dict[str, float]], note: str) -> None:
    shown = "   ".join(f"{engine} {t['median_us']:.2f} ({t['p99_us']:.1f})" for engine, t in row.items())
    print(f"{name:18} {shown}   {note}")


if __name__ == "__main__":
    main()
