"""All experiments, in the paper's order."""

from collections.abc import Mapping
from types import MappingProxyType

from khepera_hil.experiments import lookalike, section5, section6, section7, section8, watchman
from khepera_hil.experiments.experiment import Experiment

__all__ = ["EXPERIMENTS"]

_ALL = (
    *section5.EXPERIMENTS,
    *section6.EXPERIMENTS,
    *section7.EXPERIMENTS,
    *section8.EXPERIMENTS,
    *lookalike.EXPERIMENTS,
    watchman.experiment(),
)

EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType({experiment.name: experiment for experiment in _ALL})
