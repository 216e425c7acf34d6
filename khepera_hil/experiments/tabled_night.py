"""One short night of a watchman that has other tables, and what it came to.

The night and all chance in it come from the seed alone: two watchmen with the same seed meet the same fires, and
draw with the same uniform numbers until their tables make them decide otherwise.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from brp import Description
from khepera_hil.controllers.base import Setting
from khepera_hil.controllers.watchman import Watchman
from khepera_hil.experiments.cases import Result
from khepera_hil.experiments.nights import night
from khepera_hil.experiments.stability_exact import Situation
from khepera_hil.experiments.tally import Tally
from khepera_hil.experiments.trial import Trial, drive
from khepera_hil.recording import Tick

__all__ = ["BASE", "WORLD", "met", "nightly"]

WORLD = "furnished"
BASE = (0.18, 0.18)
"""The far corner of the base's square, m."""

_BEGINS = (0.25, 1.0)
"""Charges that a night may begin with."""

_OBSERVED = ("Vigil", "Energy", "Fire", "Identify")


@dataclass
class _Beside:
    """What the `Tally` does not count."""

    watchman: Watchman
    charge: float = 0.0
    charged: int = 0
    burning: int = 0
    """Ticks times fires that burn."""
    situations: Counter[str] = field(default_factory=Counter)
    _lit: set[str] = field(default_factory=set)

    def hear(self, tick: Tick) -> None:
        for name, pose in tick.moved.items():
            if name.startswith("fire"):
                # What is not there lies beside the floor.
                (self._lit.add if pose[0] >= 0 else self._lit.discard)(name)
        self.burning += len(self._lit)
        if self.watchman.energy.charge is not None:
            self.charge += self.watchman.energy.charge
            self.charged += 1
        if tick.draws:
            told = [str(tick.evidence[name]) for name in _OBSERVED]
            base = tick.answers["Base"]
            told.append(str(bool(base.values[0][int(base.p.argmax())])))
            told.append(str(tick.evidence["Behavior_t-1"]))
            self.situations[" ".join(told)] += 1


def nightly(seed: int, seconds: float, description: Description | None) -> Result:
    """A night of so many seconds in `WORLD`; None: with the tables as printed.

    The battery begins at a charge that the seed draws, so that short nights meet every level of Energy. The result
    has the `Tally`'s figures but for its chi-squares, the ``score``, the mean ``charge`` of the battery
    (0 to 1), ``burning`` (seconds that fires burned, added up) and ``situations`` (ticks, by what was known).
    """
    plan = night(seed, seconds, WORLD)
    heard: list[tuple[Tally, _Beside]] = []

    def make(witness: Any) -> Watchman:
        watchman = Watchman(Setting(taught=description))
        heard.append((Tally(witness, watchman, plan, BASE), _Beside(watchman)))
        return watchman

    def watch(tick: Tick, trial: Trial) -> bool:
        trial.ticks.clear()
        for one in heard[0]:
            one.hear(tick)
        return False

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "night.toml"
        path.write_text(f'{plan.text}\n[[event]]\nat_s = 0\nkind = "battery"\ncharge = {_charge(seed):.3f}\n')
        ran = drive(make, world=WORLD, seed=seed, duration=seconds, watch=watch, options={"scenario": str(path)})
    tally, beside = heard[0]
    figures = tally.figures()
    del figures["chi2"]
    return {
        **figures,
        "charge": beside.charge / beside.charged if beside.charged else 1.0,
        "burning": beside.burning / 10,
        "situations": dict(beside.situations),
        "score": dict(ran.score),
    }


def _charge(seed: int) -> float:
    rng = np.random.default_rng(np.random.SeedSequence([seed, 0x636861726765]))
    return float(rng.uniform(*_BEGINS))


def met(result: Result) -> dict[tuple[Situation, str], int]:
    """Ticks of a night in each situation, with each Behavior_t-1."""
    found: dict[tuple[Situation, str], int] = {}
    for text, ticks in result["situations"].items():
        vigil, energy, fire, identify, base, last = text.split()
        found[(vigil == "True", energy, base == "True", fire == "True", identify == "True"), last] = int(ticks)
    return found
