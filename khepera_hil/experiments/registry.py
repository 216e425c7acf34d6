"""All experiments, in the paper's order."""

from collections.abc import Mapping
from types import MappingProxyType

from khepera_hil.experiments import section5, watchman
from khepera_hil.experiments.experiment import Experiment

__all__ = ["EXPERIMENTS"]

EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType(
    {experiment.name: experiment for experiment in (*section5.EXPERIMENTS, watchman.experiment())}
)
