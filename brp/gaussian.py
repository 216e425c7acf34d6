"""The Gaussian form: a mean and a standard deviation for each value of what is given, over a discrete variable.

"The free parameters ... can then be identified by computing the means and standard deviations of Vrot for each
position of the obstacle" (section 5.3). The paper does not say what a position that was never seen answers; here it
is stated in the form: the nearest position seen, a prior, or uniform.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from brp.errors import SpecificationError, Unidentified
from brp.factors import Density, Factor
from brp.forms import Form
from brp.functions import Function, tabulate
from brp.samples import Samples
from brp.variables import Term, Variable, cells

__all__ = ["Gaussian", "Nearest", "Prior", "Taught"]

Parameter = Callable[..., float] | float
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Nearest:
    """A cell that no sample visited answers as the nearest one that was visited.

    Distance is Euclidean in the values (in the places, for words), each variable stretched by its ``scale`` (by
    name; 1 unless told). ``within`` is a function of some of the given variables, by name: the nearest cell is
    looked for among those for which it returns the same, and among all of them only when none of these was
    visited. Measured on taught behaviours: nothing else that was tried works as well.
    """

    scale: Mapping[str, float] = field(default_factory=dict)
    within: Callable[..., Any] | None = None


@dataclass(frozen=True)
class Prior:
    """A mean and a deviation that count as ``strength`` samples in every cell, and alone where there are none."""

    mean: float
    deviation: float
    strength: float = 0.0


class Gaussian(Form):
    """G(mu, sigma) over a numeric variable, normalised on its values.

    ``Gaussian()`` is free: data identify a mean and a deviation for every combination of what is given. A cell that
    no sample visited answers as ``unvisited`` says (`Nearest`, `Prior` or ``"uniform"``), and no deviation is
    below ``floor`` (in the variable's unit; one sample alone would have none). Or ``mean`` and ``deviation`` are
    numbers or functions of some of the given variables, by name.
    """

    def __init__(
        self,
        mean: Parameter | None = None,
        deviation: Parameter | None = None,
        *,
        unvisited: Nearest | Prior | Literal["uniform"] = Nearest(),
        floor: float = 0.7,
    ) -> None:
        if (mean is None) != (deviation is None):
            raise SpecificationError("a Gaussian is given both its mean and its deviation, or neither")
        if not floor > 0:
            raise SpecificationError("a Gaussian's floor must be above 0; for one certain value use Dirac")
        self.mean = mean
        self.deviation = deviation
        self.unvisited = unvisited
        self.floor = floor
        self.free = mean is None

    def identify(self, term: Term, samples: Samples) -> Form:
        """Count, mean and deviation of each cell."""
        if self.mean is not None:
            return self
        of = _only(term)
        shape = tuple(map(len, term.given))
        values = of.numbers[samples[of]]
        cell = np.zeros(len(values), dtype=np.intp)
        for variable in term.given:
            cell = cell * len(variable) + samples[variable]

        def each(weights: Array) -> Array:
            return np.bincount(cell, weights, minlength=cells(term.given)).astype(np.float64)

        count = each(np.ones(len(values)))
        mean = np.divide(each(values), count, out=np.zeros_like(count), where=count > 0)
        squares = each((values - mean[cell]) ** 2)
        return Taught(self, count.reshape(shape), mean.reshape(shape), squares.reshape(shape))

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """From the given mean and deviation; a free one answers only what its prior says."""
        if self.mean is None or self.deviation is None:
            return self.identify(term, Samples({}, 0)).factor(term, names)
        _only(term)
        means, mean = tabulate(self.mean, term.given, f"the mean of {term}")
        deviations, deviation = tabulate(self.deviation, term.given, f"the deviation of {term}")
        used = tuple(v for v in term.given if v in means or v in deviations)
        mean, deviation = (
            np.broadcast_to(array.reshape([len(v) if v in has else 1 for v in used]), tuple(map(len, used)))
            for array, has in ((mean, means), (deviation, deviations))
        )
        if not (np.isfinite(mean).all() and np.isfinite(deviation).all() and (deviation > 0).all()):
            raise SpecificationError(f"{term} has a mean that is no number or a deviation that is not above 0")
        return _density(term, used, names, mean, deviation)

    def __repr__(self) -> str:
        if self.mean is None:
            return f"Gaussian(unvisited={self.unvisited!r}, floor={self.floor})"
        return f"Gaussian({self.mean!r}, {self.deviation!r})"


class Taught(Form):
    """A Gaussian with identified parameters: count, mean and sum of squared differences of each cell.

    The arrays have an axis for each given variable, in the term's order.
    """

    def __init__(self, form: Gaussian, count: Array, mean: Array, squares: Array) -> None:
        self.form = form
        self.count = count
        self.sample_mean = mean
        self.squares = squares

    def parameters(self, term: Term) -> tuple[Array, Array]:
        """The mean and the deviation that each cell answers with; nan and infinity where it is uniform."""
        visited = self.count > 0
        mean = self.sample_mean.copy()
        deviation = np.sqrt(np.divide(self.squares, self.count, out=np.zeros_like(mean), where=visited))
        rule = self.form.unvisited
        if isinstance(rule, Prior):
            mean, deviation = self._with(rule)
        elif isinstance(rule, Nearest):
            if not visited.any():
                raise Unidentified(f"no data has identified {term}: call identify(samples) with some")
            nearest = _nearest(visited, term.given, rule, f"the border of {term}")
            mean, deviation = mean[nearest], deviation[nearest]
        else:
            mean[~visited], deviation[~visited] = np.nan, np.inf
        return mean, np.maximum(deviation, self.form.floor)

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """The identified Gaussians."""
        return _density(term, term.given, names, *self.parameters(term))

    def _with(self, prior: Prior) -> tuple[Array, Array]:
        weight = self.count + prior.strength
        none = weight == 0
        share = np.divide(self.count, weight, out=np.zeros_like(weight), where=~none)
        mean = prior.mean + share * (self.sample_mean - prior.mean)
        # Squared differences about the joint mean: within the samples, within the prior, between the two.
        between = self.count * (1 - share) * (self.sample_mean - prior.mean) ** 2
        squares = self.squares + prior.strength * prior.deviation**2 + between
        variance = np.divide(squares, weight, out=np.full_like(weight, prior.deviation**2), where=~none)
        return mean, np.sqrt(variance)

    def __repr__(self) -> str:
        visited = int((self.count > 0).sum())
        return f"<{self.form!r} identified from {int(self.count.sum())} samples in {visited} cells>"


def _only(term: Term) -> Variable:
    if len(term.of) != 1 or not term.of[0].numeric:
        raise SpecificationError(f"a Gaussian is for one numeric variable left of the bar, and not for {term}")
    return term.of[0]


def _density(
    term: Term, given: tuple[Variable, ...], names: tuple[str, ...], mean: Array, deviation: Array
) -> Density:
    x = term.of[0].numbers
    flat = np.isinf(deviation)
    centre, width = np.where(flat, 0.0, mean), np.where(flat, 1.0, deviation)

    def exponent(value: Any, at: Any) -> Array:
        scaled = (x[value] - centre[at]) / width[at]
        return np.where(flat[at], 0.0, -0.5 * scaled * scaled)

    # The largest exponent comes out of the sum first: far from every value, all of the terms would underflow.
    each = exponent(np.arange(len(x)).reshape(-1, *(1 for _ in given)), ...)
    largest = each.max(axis=0)
    total = largest + np.log(np.exp(each - largest).sum(axis=0))

    def log(value: Any, *at: Any) -> Array:
        logs: Array = exponent(value, at) - total[at]
        return logs

    return Density(term.of, given, names, log, vanishes=False)


def _nearest(
    visited: NDArray[np.bool_], given: tuple[Variable, ...], rule: Nearest, what: str
) -> tuple[NDArray[np.intp], ...]:
    """For every cell the visited one that answers for it, as an index array for each given variable."""
    axes = [
        (v.numbers if v.numeric else np.arange(len(v), dtype=np.float64)) * rule.scale.get(v.name, 1.0)
        for v in given
    ]
    mesh = np.meshgrid(*axes, indexing="ij")
    at = np.stack([axis.ravel() for axis in mesh], axis=1) if axes else np.zeros((1, 0))
    seen = np.flatnonzero(visited)
    region = _regions(given, rule, what)
    distance = ((at[:, None, :] - at[None, seen, :]) ** 2).sum(axis=2)
    elsewhere = region[:, None] != region[None, seen]
    distance[elsewhere & ~elsewhere.all(axis=1)[:, None]] = np.inf
    answer = seen[distance.argmin(axis=1)].reshape(visited.shape)
    return tuple(np.unravel_index(answer, visited.shape)) if given else ()


def _regions(given: tuple[Variable, ...], rule: Nearest, what: str) -> NDArray[np.intp]:
    shape = tuple(map(len, given))
    if rule.within is None:
        return np.zeros(shape, dtype=np.intp).ravel()
    function = Function(rule.within, given, what)
    numbers: dict[Any, int] = {}
    rows = np.array([numbers.setdefault(row, len(numbers)) for row in function.rows()], dtype=np.intp)
    rows = rows.reshape([len(v) if v in function.used else 1 for v in given])
    return np.broadcast_to(rows, shape).ravel()
