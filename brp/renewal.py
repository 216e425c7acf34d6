"""A question's simplification, kept when its description learns: the same plan over other numbers.

What the symbolic phase decides depends on which variables a term has and on whether it may be zero, not on its
numbers. Where these are as before, the expression is copied with the new densities in the old ones' places.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Any

from brp.expression import Leaf, Node, postorder
from brp.factors import Cases, Density, Factor
from brp.simplification import Simplified

__all__ = ["Plan", "renewed"]


@dataclass(frozen=True)
class Plan:
    """A question's simplification and the factors that it was made of."""

    simplified: Simplified
    factors: tuple[Factor, ...]


def renewed(plan: Plan, factors: Sequence[Factor]) -> Simplified | None:
    """The plan's simplification over ``factors``, each in its predecessor's place; None when it would differ."""
    new: dict[int, Factor] = {}
    for old, young in zip(plan.factors, factors, strict=True):
        for one, other in _pairs(old, young):
            if one is other:
                continue
            if type(one) is not type(other) or one.scope != other.scope or one.vanishes != other.vanishes:
                return None
            new[id(one)] = other
    memo: dict[int, Node] = {}
    for here in postorder(plan.simplified.start):
        # The scopes are the same, so a copy with other children needs nothing else to be worked out again.
        made = memo[id(here)] = copy(here)
        made.children = tuple(memo[id(child)] for child in here.children)
        if isinstance(made, Leaf):
            density = new.get(id(made.density), made.density)
            assert isinstance(density, Density)
            made.density = density
    changes: dict[str, Any] = {"start": memo[id(plan.simplified.start)]}
    for field in fields(plan.simplified):
        value = getattr(plan.simplified, field.name)
        if isinstance(value, tuple) and any(isinstance(part, Factor) for part in value):
            changes[field.name] = tuple(new.get(id(part), part) for part in value)
    return replace(plan.simplified, **changes)


def _pairs(old: Factor, young: Factor) -> Iterator[tuple[Factor, Factor]]:
    """A factor and its successor; of cases, each branch and its successor as well."""
    yield old, young
    if isinstance(old, Cases) and isinstance(young, Cases):
        for one, other in zip(old.branches, young.branches, strict=True):
            yield from _pairs(one, other)
