"""Straight-line numpy as text while it is being written: constants, registers, lines; and what it becomes.

A line all of whose operands are small constants is not written but done, and its result is a constant.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import exp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.evidence import weigh
from brp.variables import Variable

__all__ = ["FEW", "TINY", "Run", "Source", "looked_up"]

TINY = 1e-250
"""A total below this is not trusted: something that mattered may have underflowed."""
FEW = 16
"""So few numbers are added faster by Python than by numpy."""
SHARED = 65_536
"""The bytes up to which a table is compared with those that are there already."""
DONE = 512
"""The most numbers of a constant that is worked with at once, and not each time that the function is called."""
WRITTEN = 200
"""So many variables may be told by keyword with a line of source for each."""

TOLD = re.compile(r"\b[iw][0-9]+\b")
REGISTER = re.compile(r"\br[0-9]+\b")
MADE = re.compile(r"\b[iwr][0-9]")
CONSTANT = re.compile(r"\bt[0-9]+\b")

Array = NDArray[np.float64]
Run = Callable[[Any], Array | None]
"""What is told in, probabilities out, or None."""


def either(logit: float) -> Array:
    """Two probabilities, the second ``exp(logit)`` times the first; neither loses its digits."""
    smaller = exp(-abs(logit))
    larger = 1 / (1 + smaller)
    return np.array((larger, smaller * larger) if logit < 0 else (smaller * larger, larger))


class Source:
    """Lines of a function's body over named constants; ``told`` are the names of what it is called with.

    Constants are ``t0, t1, ...``, registers ``r0, r1, ...``, what is told ``i...`` (places) and ``w...`` (weights).
    One that is made ``like`` another shares its constants.
    """

    def __init__(self, told: Sequence[str], like: Source | None = None) -> None:
        self.told = told
        self.names: dict[str, Any] = (
            {
                "np": np,
                "exp": np.exp,
                "most": np.maximum.reduce,
                "either": either,
                "TINY": TINY,
                "LEAST": -np.inf,
            }
            if like is None
            else like.names
        )
        self._tables: dict[Any, str] = {} if like is None else like._tables
        self.functions: list[str] = [] if like is None else like.functions
        self.lines: list[str] = []
        self.registers: int = 0 if like is None else like.registers
        self._indent = ""

    def line(self, text: str) -> None:
        """One more line."""
        self.lines.append(self._indent + text)

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Lines under a head: ``if w:``."""
        self.line(head)
        before, self._indent = self._indent, self._indent + "    "
        yield
        self._indent = before

    def constant(self, value: Any) -> str:
        """A name for a value."""
        name = f"t{len(self.names)}"
        self.names[name] = value
        return name

    def array(self, table: Array) -> str:
        """A table as a constant: the same one for the same numbers, as they stand in a chain of equal terms."""
        if table.nbytes > SHARED:
            return self.constant(table)
        return self._shared((table.shape, table.tobytes()), table)

    def rows(self, table: Array) -> str:
        """A table as a list of its rows, looked up by one number; the same one for the same numbers.

        Rows that are one number each are Python's.
        """
        rows = table.tolist() if table.ndim == 1 else list(table)
        if table.nbytes > SHARED:
            return self.constant(rows)
        return self._shared(("rows", table.shape, table.tobytes()), rows)

    def _shared(self, key: Any, value: Any) -> str:
        if key not in self._tables:
            self._tables[key] = self.constant(value)
        return self._tables[key]

    def known(self, name: str) -> Any:
        """The value of a constant; None of a register."""
        return self.names[name] if CONSTANT.fullmatch(name) else None

    def register(self, code: str) -> str:
        """A name for the value of an expression: a register, or a constant where only small ones are in it."""
        if self.told and not MADE.search(code):
            operands = [self.names[name] for name in CONSTANT.findall(code)]
            if all(isinstance(o, float) or (isinstance(o, np.ndarray) and o.size <= DONE) for o in operands):
                with np.errstate(all="ignore"):  # what is not to be trusted is guarded
                    value = eval(code, self.names)  # noqa: S307  (our own text)
                return self.array(value) if isinstance(value, np.ndarray) else self.constant(value)
        return self.variable(code)

    def variable(self, code: str) -> str:
        """A register in any case: what is written into later."""
        name = f"r{self.registers}"
        self.registers += 1
        self.line(f"{name} = {code}")
        return name

    def guard(self, condition: str) -> None:
        """Give up where the condition does not hold."""
        if MADE.search(condition) or not eval(condition, self.names):  # noqa: S307  (our own text)
            self.line(f"if not {condition}: return None")

    def choose(self, place: str, runs: Sequence[tuple[int, list[str]]]) -> None:
        """The lines of one run, by a variable's place; each holds from its number on. Half of them at a time."""
        if len(runs) == 1:
            for text in runs[0][1]:
                self.line(text)
            return
        half = len(runs) // 2
        with self.block(f"if {place} < {runs[half][0]}:"):
            self.choose(place, runs[:half])
        with self.block("else:"):
            self.choose(place, runs[half:])

    def function(self, name: str, result: str, lookup: Sequence[str] = ()) -> tuple[str, Run]:
        """The function of all lines that returns ``result``: its text, and itself. ``lookup`` comes first."""
        *body, result = _reused([*self.lines, result])
        used = set(TOLD.findall("\n".join([*body, result])))
        if lookup:
            body[:0] = lookup
        elif len(used) * 3 < len(self.told):
            body[:0] = [f"{name} = e[{number}]" for number, name in enumerate(self.told) if name in used]
        elif self.told:
            body.insert(0, f"{', '.join(self.told)}, = e")
        text = "\n    ".join([f"def {name}(e):", *body, f"return {result}"])
        space: dict[str, Any] = {}
        exec(compile(text, "<plan>", "exec"), self.names, space)  # noqa: S102  (our own text: straight-line numpy)
        return text, space[name]


def _reused(lines: Sequence[str]) -> list[str]:
    """The same lines with as few registers as possible: what is needed no more is overwritten, its memory freed.

    Large arrays then take turns in memory that the processor has at hand, where every new one would cost a
    page fault for each of its pages.
    """
    last = {name: number for number, text in enumerate(lines) for name in REGISTER.findall(text)}
    names: dict[str, str] = {}
    spare: list[str] = []
    count = 0
    made: list[str] = []
    for number, text in enumerate(lines):
        met = dict.fromkeys(REGISTER.findall(text))
        # What is read here for the last time may be written over in this very line.
        spare += [names[name] for name in met if name in names and last[name] == number]
        for name in met:
            if name not in names:
                if not spare:
                    spare.append(f"r{count}")
                    count += 1
                names[name] = spare.pop()
        made.append(REGISTER.sub(lambda found: names[found[0]], text))
    return made


def looked_up(source: Source, places: dict[Variable, str], weights: dict[Variable, str]) -> list[str]:
    """Lines from what is told by keyword, ``e``, to places and weights.

    Weights that are plainly in order are taken as they are. `weigh` has the last word about all others.
    """
    lines = [f"if len(e) != {len(source.told)}: raise KeyError"]
    if len(source.told) > WRITTEN:  # a loop compiles faster than as many lines
        hard = source.constant([(v.keyword, v.places) for v in places])
        softly = source.constant([(v.keyword, v) for v in weights])
        source.names["weigh"] = weigh
        every = f"*[steps[e[k]] for k, steps in {hard}], *[weigh(v, e[k]) for k, v in {softly}]"
        return [*lines, f"e = [{every}]", f"{', '.join(source.told)}, = e"]
    lines += [f"{name} = {source.constant(v.places)}[e[{v.keyword!r}]]" for v, name in places.items()]
    for v, name in weights.items():
        source.names |= {"weigh": weigh, "ndarray": np.ndarray, "float64": np.dtype(np.float64)}
        lines.append(f"{name} = e[{v.keyword!r}]")
        fits = f"type({name}) is ndarray and {name}.dtype is float64 and {name}.shape == ({len(v)},)"
        if len(v) <= FEW:
            parts = [f"{name}_{place}" for place in range(len(v))]
            positive = " and ".join(f"{part} >= 0" for part in parts)
            fine = f"{positive} and 1e-9 < {' + '.join(parts)} < 1e9"
            listed = f"{', '.join(parts)}, = {name}.tolist()"
        else:
            listed, fine = f"l = {name}.tolist()", "min(l) >= 0 and 1e-9 < sum(l) < 1e9"
        again = f"{name} = weigh({source.constant(v)}, {name})"
        lines += [f"if {fits}:", f"    {listed}", f"    if not ({fine}): {again}", f"else: {again}"]
    return lines
