"""What a run tells of behaviors: what was labelled, where its base is, whether there is enough to learn from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from brp import BrpError
from brp.programs.base import Base, at_base
from brp.programs.behavior import Behavior
from khepera_hil.errors import UsageError

__all__ = ["FEWEST", "based", "enough", "said"]

FEWEST = 100
"""Data that there must be: ten seconds of a run."""


def said(evidence: Mapping[str, Any]) -> bool:
    """Whether Behavior was an operator's word in a tick: then it was known, and not drawn."""
    return Behavior.name in evidence


def based(values: Mapping[str, Any]) -> dict[str, Any]:
    """Base as the sixteen readings have it; nothing where they are not there, or are none."""
    try:
        return {Base.name: at_base(**{v.keyword: values[v.name] for v in at_base.known}).best()}
    except (BrpError, KeyError, TypeError):
        return {}


def enough(columns: Mapping[str, Sequence[Any]]) -> Counter[Any]:
    """How often each behavior was met. Raises UsageError for data of which nothing can be learnt."""
    met = Counter(columns[Behavior.name])
    total = sum(met.values())
    if total < FEWEST:
        raise UsageError(
            f"{total} data are too few to learn behaviors from: at least {FEWEST} are needed, more is better"
        )
    if len(met) < 2:
        only = next(iter(met))
        raise UsageError(f"all {total} data are of one behavior, {only}: there is nothing to decide between")
    return met
