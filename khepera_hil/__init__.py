"""A service that runs Bayesian robot programs on a Khepera over its serial line, or on one that is emulated."""

__version__ = "0.1.0"
