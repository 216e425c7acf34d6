"""What a question is told: a value for each known variable, weights for what is known only softly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.distribution import Distribution
from brp.errors import EvidenceError, NotAValue
from brp.variables import Variable, text

__all__ = ["Evidence", "Signature", "weigh"]


@dataclass(frozen=True)
class Evidence:
    """The places of the known values, and the weights of what is known softly."""

    places: Mapping[Variable, int]
    weights: Mapping[Variable, NDArray[np.float64]]

    @property
    def logs(self) -> dict[Variable, NDArray[np.float64]]:
        """The logarithms of the weights."""
        with np.errstate(divide="ignore"):
            return {v: np.log(weights) for v, weights in self.weights.items()}

    def __str__(self) -> str:
        said = [f"{v} = {v.values[place]}" for v, place in self.places.items()]
        said += [f"{v} as told" for v in self.weights]
        return ", ".join(said) or "nothing known"


@dataclass(frozen=True)
class Signature:
    """What a question must be told; ``name`` is the question's, for refusals."""

    name: str
    known: tuple[Variable, ...]
    soft: tuple[Variable, ...]

    def read(self, told: Mapping[str, Any]) -> Evidence:
        """The evidence; raises `EvidenceError` or `NotAValue` with a sentence that names what does not fit."""
        wanted = {v.keyword: v for v in self.known}
        missing = [v for keyword, v in wanted.items() if keyword not in told]
        extra = [keyword for keyword in told if keyword not in wanted]
        if missing:
            instead = f", and not {text(extra)}" if extra else ""
            raise EvidenceError(f"{self.name} must be told {text(v.keyword for v in missing)}{instead}")
        if extra:
            knows = text(self.known) or "nothing"
            raise EvidenceError(f"{self.name} does not know {text(extra)}; it knows {knows}")
        try:
            return Evidence(
                {v: v.place(told[v.keyword]) for v in self.known if v not in self.soft},
                {v: weigh(v, told[v.keyword]) for v in self.soft},
            )
        except EvidenceError as error:
            raise type(error)(f"{error}, in {self.name}") from None


def weigh(variable: Variable, said: Any) -> NDArray[np.float64]:
    """What is said of a variable as weights, whose scale does not matter, shape ``(len(variable),)``.

    ``said`` is a distribution over the variable, a mapping from values to weights, a weight for each value, or a
    value, which then is certain.
    """
    if type(said) is np.ndarray and said.dtype == np.float64 and said.shape == (len(variable.values),):
        weights = said  # first, for whoever asks ten times a second
    elif isinstance(said, Distribution):
        if said.variables != (variable,):
            raise EvidenceError(f"{variable} was told a distribution over {text(said.variables)}")
        weights = said.p
    elif isinstance(said, Mapping):
        weights = np.zeros(len(variable))
        for value, weight in said.items():
            try:
                weights[variable.place(value)] = weight
            except (TypeError, ValueError):
                raise NotAValue(f"{variable} was told {weight!r} of {value}, which is no weight") from None
    elif isinstance(said, str) or not hasattr(said, "__len__"):
        weights = np.zeros(len(variable))
        weights[variable.place(said)] = 1
    else:
        try:
            weights = np.asarray(said, dtype=np.float64)
        except (TypeError, ValueError):
            raise NotAValue(f"{variable} was told {said!r}, which are no weights for {variable.domain}") from None
        if weights.shape != (len(variable),):
            raise EvidenceError(
                f"{variable} was told {weights.size} weights, and has {len(variable)} values ({variable.domain})"
            )
    listed = weights.tolist()  # for the few values of a variable this is quicker than numpy
    total = sum(listed)
    if not (0 < total < inf) or min(listed) < 0:
        raise EvidenceError(f"{variable} was told weights that are no distribution: {listed}")
    return weights if 1e-9 < total < 1e9 else weights / weights.max()
