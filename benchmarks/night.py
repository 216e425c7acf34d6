"""The watchman's inference in a tick: late, early, between, and with the whole distribution as its memory.

``python -m benchmarks.night [--seconds S] [--json FILE]``: the evidence is that of a run of the scenario ``night``,
asked again and again; all questions of a tick are asked, their draws made, and what is remembered drawn.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from brp import Value
from brp.programs.beacon import locate_beacon
from brp.programs.watchman import pi_watchman
from khepera_hil.controllers.watchman import Watchman
from khepera_hil.controllers.watchman_mind import EARLY, LATE, Mind, filled
from khepera_hil.controllers.watchman_whole import WholeMind
from khepera_hil.experiments.trial import drive

TARGET = 2.0  # ms, at the 99th percentile


def main() -> None:
    """Print a table; write the figures where they are wanted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=120, help="of the night whose evidence is asked")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    run = drive(Watchman(), world="watchman", seed=4, duration=asked.seconds, options={"scenario": "night"})
    evidence = [dict(tick.evidence) for tick in run.ticks if tick.evidence]
    watching = pi_watchman(locate=locate_beacon).identify()
    ways: dict[str, Callable[[dict[str, Value], np.random.Generator], Any]] = {}
    for name, early in (("late", LATE), ("early", EARLY), ("Move drawn", ("Move",))):
        ways[name] = _thinking(Mind(watching, early))
    whole = WholeMind()
    ways["whole memory"] = lambda known, rng: whole.think(known, rng, arrived=False)
    figures: dict[str, float] = {}
    print(f"inference of a tick, ms, {len(evidence)} ticks of a night (to reach, late: p99 < {TARGET:g})")
    for name, think in ways.items():
        for clock, which in ((time.perf_counter, "wall"), (time.thread_time, "processor")):
            p50, p99, most = np.percentile(_timed(think, evidence, clock), [50, 99, 100])
            figures |= {f"{name} {which} p50_ms": float(p50), f"{name} {which} p99_ms": float(p99)}
            print(f"  {name:14} {which:10} p50 {p50:7.3f}  p99 {p99:7.3f}  max {most:7.3f}")
    if asked.json is not None:
        asked.json.write_text(json.dumps(figures) + "\n")


def _thinking(mind: Mind) -> Callable[[dict[str, Value], np.random.Generator], Any]:
    def think(known: dict[str, Value], rng: np.random.Generator) -> None:
        filled(known, mind.think(known, rng).answers["Base"])

    return think


def _timed(
    think: Callable[[dict[str, Value], np.random.Generator], Any],
    evidence: list[dict[str, Value]],
    clock: Callable[[], float],
) -> Any:
    """Milliseconds of each tick, after one round to warm up. On a busy machine the wall's are others' as well."""
    rng = np.random.default_rng(0)
    times = np.empty(len(evidence))
    for _ in range(2):
        for place, known in enumerate(evidence):
            began = clock()
            think(known, rng)
            times[place] = 1e3 * (clock() - began)
    return times


if __name__ == "__main__":
    main()
