"""The Gaussian form: a mean and a standard deviation for each value of what is given, over a discrete variable.

"The free parameters ... can then be identified by computing the means and standard deviations of Vrot for each
position of the obstacle" (section 5.3). The paper does not say what a position that was never seen answers; here it
is stated in the form: the nearest position seen, a prior, or uniform.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from brp.errors import DataError, SpecificationError, Unidentified
from brp.factors import Density, Factor
from brp.forms import Form
from brp.functions import tabulate
from brp.nearest import Nearest, nearest
from brp.samples import Samples, empty, weighed
from brp.variables import Term, Variable

__all__ = ["Gaussian", "Nearest", "Prior", "Taught"]

Parameter = Callable[..., float] | float
Array = NDArray[np.float64]

NEAREST = Nearest()
REACH = 9.0
"""Deviations; what lies beyond has less than 1e-17 of the whole."""
CHUNK = 1_000_000
"""How many exponents are held at a time while their sums are taken."""


@dataclass(frozen=True)
class Prior:
    """A mean and a deviation that count as ``strength`` samples in every cell, and alone where there are none."""

    mean: float
    deviation: float
    strength: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.mean) and 0 < self.deviation < math.inf and 0 <= self.strength < math.inf):
            raise SpecificationError(f"{self!r} wants a deviation above 0 and a strength of 0 or more samples")


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
        unvisited: Nearest | Prior | Literal["uniform"] = NEAREST,
        floor: float = 0.7,
    ) -> None:
        if (mean is None) != (deviation is None):
            raise SpecificationError("a Gaussian is given both its mean and its deviation, or neither")
        if not floor > 0:
            raise SpecificationError("a Gaussian's floor must be above 0; for one certain value use Dirac")
        if unvisited != "uniform" and not isinstance(unvisited, Nearest | Prior):
            raise SpecificationError(
                f'a Gaussian\'s unvisited is Nearest(), a Prior or "uniform", not {unvisited!r}'
            )
        self.mean = mean
        self.deviation = deviation
        self.unvisited = unvisited
        self.floor = floor
        self.free = self.learns = mean is None

    def identify(self, term: Term, samples: Samples) -> Form:
        """Count, mean and deviation of each cell."""
        if self.mean is not None:
            return self
        _only(term)
        nothing = empty(term)
        return Taught(self, nothing, nothing, nothing).learn(term, samples)

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
    """A Gaussian with identified parameters: what is sufficient to know of the samples of each cell.

    ``count`` is their number (the sum of their weights), ``first`` and ``second`` the sums of their differences
    from the variable's middle value and of the squares of these. The arrays have an axis for each given variable,
    in the term's order. Sums of whole numbers are exact, so the order of the samples makes no difference, and
    removing one leaves what was there before it.
    """

    learns = True

    def __init__(self, form: Gaussian, count: Array, first: Array, second: Array) -> None:
        self.form = form
        self.count = count
        self.first = first
        self.second = second

    def learn(self, term: Term, samples: Samples) -> Taught:
        """The sums with more samples; refuses to remove what was never there."""
        of = _only(term)
        difference = of.numbers[samples[of]] - self.origin(term)
        at, weights = samples.cells(term.given), samples.weights
        count = weighed(self.count, at, weights, term)
        first, second = self.first.copy(), self.second.copy()
        np.add.at(first.reshape(-1), at, weights * difference)
        np.add.at(second.reshape(-1), at, weights * difference * difference)
        if (weights < 0).any():
            first[count == 0] = second[count == 0] = 0.0
            if (count * second - first**2 < -1e-9 * (1 + first**2)).any():
                raise DataError(f"{term} cannot forget a datum that it never learnt")
        return Taught(self.form, count, first, second)

    @staticmethod
    def origin(term: Term) -> float:
        """The value from which differences are taken: near the samples, so that their squares stay small."""
        of = _only(term)
        return float(of.values[len(of) // 2])

    def parameters(self, term: Term) -> tuple[Array, Array]:
        """The mean and the deviation that each cell answers with; nan and infinity where it is uniform."""
        visited = self.count > 0
        mean, variance = self._moments(term)
        deviation = np.sqrt(variance)
        rule = self.form.unvisited
        if isinstance(rule, Prior):
            mean, deviation = self._with(rule, mean, variance)
        elif isinstance(rule, Nearest):
            if not visited.any():
                raise Unidentified(f"no data has identified {term}: call identify(samples) with some")
            answers = nearest(visited, term.given, rule, f"the border of {term}")
            mean, deviation = mean[answers], deviation[answers]
        else:
            mean, deviation = np.where(visited, mean, np.nan), np.where(visited, deviation, np.inf)
        return mean, np.maximum(deviation, self.form.floor)

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """The identified Gaussians."""
        return _density(term, term.given, names, *self.parameters(term))

    def _moments(self, term: Term) -> tuple[Array, Array]:
        """Mean and variance of the samples of each cell; zero where there are none."""
        count = np.where(self.count > 0, self.count, 1.0)
        variance = np.maximum(0.0, count * self.second - self.first**2) / count**2
        return np.where(self.count > 0, self.origin(term) + self.first / count, 0.0), variance

    def _with(self, prior: Prior, mean: Array, variance: Array) -> tuple[Array, Array]:
        weight = self.count + prior.strength
        none = weight == 0
        share = np.divide(self.count, weight, out=np.zeros_like(weight), where=~none)
        # Squared differences about the joint mean: within the samples, within the prior, between the two.
        between = self.count * (1 - share) * (mean - prior.mean) ** 2
        squares = self.count * variance + prior.strength * prior.deviation**2 + between
        joint = np.divide(squares, weight, out=np.full_like(weight, prior.deviation**2), where=~none)
        return prior.mean + share * (mean - prior.mean), np.sqrt(joint)

    def __repr__(self) -> str:
        visited = int((self.count > 0).sum())
        return f"<{self.form!r} identified from {self.count.sum():g} samples in {visited} cells>"


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

    totals: list[Array] = []

    def log(value: Any, *at: Any) -> Array:
        if not totals:
            totals.append(_totals(x, centre, width, flat))
        logs: Array = exponent(value, at) - totals[0][at]
        return logs

    return Density(term.of, given, names, log, vanishes=False, light=True)


def _totals(x: Array, centre: Array, width: Array, flat: NDArray[np.bool_]) -> Array:
    """The logarithm of the sum over all values, for each cell; a few cells at a time.

    Where values rise in even steps only those within `REACH` deviations of the value nearest to the mean are looked
    at: all others together are less than the sum's rounding.
    """
    total = np.empty(centre.size)
    middle, deviation, uniform = centre.ravel(), width.ravel(), flat.ravel()
    steps = np.diff(x)
    near = len(x)
    if len(x) > 1 and (steps == steps[0]).all():
        near = min(near, 2 * math.ceil(REACH * float(deviation.max(initial=0.0)) / abs(steps[0])) + 1)
    step = max(1, CHUNK // near)
    for start in range(0, centre.size, step):
        part = slice(start, start + step)
        if near < len(x):
            nearest_place = np.clip(np.rint((middle[part] - x[0]) / steps[0]), 0, len(x) - 1).astype(np.intp)
            places = np.clip(nearest_place - near // 2, 0, len(x) - near) + np.arange(near)[:, None]
        else:
            places = np.arange(len(x))[:, None]
        scaled = (x[places] - middle[part]) / deviation[part]
        each = np.where(uniform[part], 0.0, -0.5 * scaled * scaled)
        # The largest exponent comes out of the sum first: far from every value, all of the terms would underflow.
        largest = each.max(axis=0)
        total[part] = largest + np.log(np.exp(each - largest).sum(axis=0))
    total[uniform] = np.log(len(x))
    return total.reshape(centre.shape)
