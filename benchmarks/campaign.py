"""How much more two workers do than one: ``python -m benchmarks.campaign``.

The same trials (avoiding in the furnished arena, so many seconds of the robot's time, through the bytes of its
serial line) by one worker and by two, in turn, ``--rounds`` times: trials a second, from the first case handed out
to the last result on the disk, the processes' start included. ``--dask`` measures the same on dask's local cluster,
which is started before the clock is. ``beside`` is what else was running (load over a minute, before it began).
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from khepera_hil.experiments.campaign import run
from khepera_hil.experiments.cases import Case
from khepera_hil.experiments.drives import avoid


def rate(cases: list[Case], workers: int, scheduler: str | None) -> float:
    """Trials a second."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        run("benchmark", avoid, cases, Path(folder), workers=workers, scheduler=scheduler)
        return len(cases) / (time.perf_counter() - began)


def measured(cases: list[Case], rounds: int, dask: bool) -> dict[str, Any]:
    """Rates by one and by two, and how many times the one is the other."""
    rates: dict[int, list[float]] = {1: [], 2: []}
    with ExitStack() as stack:
        address: dict[int, str | None] = {1: None, 2: None}
        if dask:
            from distributed import LocalCluster

            for workers in rates:
                cluster = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0")
                address[workers] = stack.enter_context(cluster).scheduler_address
        for number in range(rounds + 1):
            for workers, found in rates.items():
                some = cases[:2] if number == 0 else cases  # the first is a rehearsal: imports, caches
                one = rate(some, workers, address[workers])
                if number:
                    found.append(one)
                    print(f"{workers} {'dask ' if dask else ''}workers: {one:.3f} a second", file=sys.stderr)
    times = [two / one for one, two in zip(rates[1], rates[2], strict=True)]
    return {"one": rates[1], "two": rates[2], "times": times, "median": statistics.median(times)}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        "python -m benchmarks.campaign",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--trials", type=int, default=16)
    parser.add_argument("--seconds", type=float, default=60.0, help="of the robot's time, each")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--dask", action="store_true")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    beside = os.getloadavg()[0]
    cases: list[Case] = [
        {"behavior": "avoid", "by": "specified", "seed": seed, "seconds": asked.seconds}
        for seed in range(1, asked.trials + 1)
    ]
    found = {**measured(cases, asked.rounds, asked.dask), "trials": asked.trials, "beside": beside}
    if asked.json:
        print(json.dumps(found))
        return
    one, two = statistics.median(found["one"]), statistics.median(found["two"])
    print(f"one worker {one:.3f} trials a second, two {two:.3f} (medians of {asked.rounds}, {asked.trials} each)")
    spread = f"{min(found['times']):.2f} to {max(found['times']):.2f}"
    print(f"two do {found['median']:.2f} times the work of one ({spread}); load before {beside:.1f}")


if __name__ == "__main__":
    main()
