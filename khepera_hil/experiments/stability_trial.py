"""One night of the stability experiment. Apart from what is made of it, so that other words or pictures do not have
the nights measured anew."""

from __future__ import annotations

from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.stability_design import signs_of
from khepera_hil.experiments.stability_tables import described, perturbed
from khepera_hil.experiments.tabled_night import nightly

__all__ = ["trial"]


def trial(case: Case) -> Result:
    """With the tables as printed, or perturbed."""
    signs = signs_of(case)
    tables = perturbed(signs, float(case["amount"]), float(case.get("opened", 0.0))) if signs else None
    return nightly(int(case["seed"]), float(case["seconds"]), None if tables is None else described(tables))
