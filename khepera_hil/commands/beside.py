"""The experiments beside the paper's own, which ``khepera-hil paper`` runs too: their options, and what these ask.

They are not among ``all``: one is long, the other needs a description that was learnt.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from types import MappingProxyType

from brp.programs.behavior import pi_behavior_taught
from khepera_hil.commands.parser import number
from khepera_hil.errors import UsageError
from khepera_hil.experiments import learnt, stability
from khepera_hil.experiments.experiment import Experiment
from khepera_hil.experiments.stability_design import BY, Design
from khepera_hil.teaching.dataset import taught

__all__ = ["BESIDE", "add_beside"]


def add_beside(parser: argparse.ArgumentParser) -> None:
    """Their options."""
    add = parser.add_argument_group("stability, learnt").add_argument
    add("--by", choices=BY, default="all", help="stability: what is perturbed together (default: %(default)s)")
    add(
        "--amount",
        type=number(0.001, 1000, "times"),
        default=0.5,
        metavar="A",
        help="stability: odds are times, or divided by, 1 + A (default: %(default)s)",
    )
    add(
        "--open-zeros",
        type=number(1e-9, 0.1, "a probability"),
        default=0.0,
        metavar="P",
        help="stability: zeros are opened as well, each to this probability (default: they stay)",
    )
    add(
        "--only",
        action="append",
        default=[],
        metavar="PART",
        help="stability: a table (4), a column (4:recharge) or an entry (4:recharge:low); again: more",
    )
    add("--pairs", type=_pairs, metavar="N", help="stability: pairs of nights a seed (default: 10 of all, else 1)")
    add(
        "--minutes",
        type=number(0.05, 600, "minutes"),
        default=6.0,
        metavar="M",
        help="stability and learnt: that a night lasts (default: %(default)g)",
    )
    add("--data", metavar="DATA", help="learnt: a description that was identified, or the folder of a recorded run")


def _stability(asked: argparse.Namespace) -> Experiment:
    design = Design(
        asked.amount, asked.open_zeros, asked.by, tuple(asked.only), asked.pairs, round(60 * asked.minutes, 1)
    )
    design.entries()  # refuses here what cannot be perturbed
    return stability.experiment(design)


def _learnt(asked: argparse.Namespace) -> Experiment:
    if asked.data is None:
        raise UsageError(
            "learnt wants --data: what khepera-hil identify behavior has written, or the folder of a watchman's run"
        )
    return learnt.experiment(taught(asked.data, pi_behavior_taught), round(60 * asked.minutes, 1))


BESIDE: Mapping[str, tuple[str, Callable[[argparse.Namespace], Experiment]]] = MappingProxyType(
    {
        "stability": ("how the watchman depends on the numbers in tables 2 to 7 (section 9.5)", _stability),
        "learnt": ("a watchman with learnt tables beside the published one (section 9.5)", _learnt),
    }
)
"""By name: what each is about, and the experiment that the options ask for."""


def _pairs(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 10_000:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of pairs from 1 to 10000")
    return int(text)
