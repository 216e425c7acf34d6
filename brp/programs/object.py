"""Section 8: situation recognition. Which object the robot has just gone around, or that it is a new one.

    Nlt, Nrt in {0, ..., 24}, 25 values                                       [S8.1]
    Per in {0, ..., 9999}, 10 000 values
    Lrl in {0, ..., 999}, 1000 values
    O in {0, ..., 15}, 16 values

    P(O Nlt Nrt Per Lrl | Delta pi-object)                                    [S8.2]
    = P(O | pi-object) P(Nlt | O Delta pi-object) P(Nrt | O Delta pi-object)
      P(Per | O Delta pi-object) P(Lrl | O Delta pi-object)

    P(O | pi-object) = Uniform                                                [S8.3]

    For all oi but o0                                                         [S8.4]
    P(Nlt | oi Delta pi-object) = L1(n_Nlt(oi))
    P(Nrt | oi Delta pi-object) = L2(n_Nrt(oi))
    P(Per | oi Delta pi-object) = G1(mu(oi), sigma(oi))
    P(Lrl | oi Delta pi-object) = G2(mu(oi), sigma(oi))

    P(Nlt | o0 pi-object) = P(Nrt | o0 pi-object) = Uniform                   [S8.5]
    P(Per | o0 pi-object) = P(Lrl | o0 pi-object) = Uniform

    P(O | Nlt Nrt Per Lrl delta_n-1 pi-object)                                [E8.2]
    = 1/Sigma P(Nlt | O delta_n-1 pi-object) P(Nrt | O delta_n-1 pi-object)
              P(Per | O delta_n-1 pi-object) P(Lrl | O delta_n-1 pi-object)

Nlt and Nrt are the left and right turns of a tour around the object, Per its length, Lrl its longest straight line.
O = 0 is the class of all objects not yet presented.

Departs from S8.3 on purpose: a class that has no object yet is as uniform as O = 0 and would tie with it for every
novelty, so P(O) is uniform over O = 0 and the classes met so far. The deviation of Per is never below 5 and that of
Lrl never below 12, what one robot's tours around one object spread by: one tour alone has no deviation.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.counts import Laplace
from brp.description import Description, Specification
from brp.errors import DataError
from brp.factors import Density, Factor
from brp.forms import Form, Switch, Uniform
from brp.gaussian import Gaussian
from brp.samples import Samples, weighed
from brp.variables import P, Term, Variable

__all__ = ["Lrl", "Met", "Nlt", "Nrt", "O", "Per", "pi_object", "recognise", "recognised", "unacquainted"]

# [S8.1]
Nlt = Variable("Nlt", range(25))
Nrt = Variable("Nrt", range(25))
Per = Variable("Per", range(10_000))
Lrl = Variable("Lrl", range(1000))
O = Variable("O", range(16))  # noqa: E741  (the paper's name)


class Met(Form):
    """Uniform over the first value, which is reserved, and those that were observed."""

    free = True
    learns = True

    def __init__(self, counts: NDArray[np.float64] | None = None) -> None:
        self.counts = counts

    def identify(self, term: Term, samples: Samples) -> Met:
        """Which values were observed."""
        return Met(np.zeros(len(term.of[0]))).learn(term, samples)

    def learn(self, term: Term, samples: Samples) -> Met:
        """With more samples."""
        counts = np.zeros(len(term.of[0])) if self.counts is None else self.counts
        return Met(weighed(counts, samples[term.of[0]], samples.weights, term))

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """The same probability for each that was met, zero for the others."""
        counts = np.zeros(len(term.of[0])) if self.counts is None else self.counts
        met = counts > 0
        met[0] = True
        logs = np.where(met, -np.log(met.sum()), -np.inf)

        def log(*places: Any) -> NDArray[np.float64]:
            found: NDArray[np.float64] = logs[places]
            return found

        return Density(term.of, (), names, log, vanishes=True)

    def __repr__(self) -> str:
        return "Met()" if self.counts is None else f"<Met() with {int((self.counts > 0).sum())} values met>"


def presented(form: Form) -> Switch:
    """Uniform for a new object [S8.5], for each class of presented objects a form of its own [S8.4]."""
    return Switch(O, {0: Uniform(), **dict.fromkeys(O.values[1:], form)})


# [S8.2] at the left; [S8.3], [S8.4] and [S8.5] at the right.
pi_object = Specification(
    {
        P(O): Met(),
        P(Nlt | O): presented(Laplace()),
        P(Nrt | O): presented(Laplace()),
        P(Per | O): presented(Gaussian(unvisited="uniform", floor=5)),
        P(Lrl | O): presented(Gaussian(unvisited="uniform", floor=12)),
    },
    name="pi-object",
)

# No object has been presented. "The learning process is incremental": ``unacquainted.learn(tour | {"O": o})`` is
# the next description, o being what `recognised` says.
unacquainted = pi_object.identify([], name="delta-object")

recognise = unacquainted.ask(P(O | Nlt, Nrt, Per, Lrl))  # [E8.1]


def recognised(knowing: Description, tour: Mapping[str, int]) -> int:
    """The class of the object that ``tour`` (Nlt, Nrt, Per, Lrl) went around: a class met before, or a new one.

    A new object gets the first class that has none yet. Raises `DataError` when every class has one.
    """
    known = {v.keyword: tour[v.name] for v in (Nlt, Nrt, Per, Lrl)}
    o: int = knowing.ask(P(O | Nlt, Nrt, Per, Lrl))(**known).best()
    if o:
        return o
    met = knowing.ask(P(O))()
    free = [o for o in O.values if met[o] == 0]
    if not free:
        raise DataError(f"{known} is a new object, and all {len(O) - 1} classes of O have one")
    return int(free[0])
