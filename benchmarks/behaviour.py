"""How well the programs do on the emulated robot, over many seeds.

    python -m benchmarks.behaviour [--seeds 20] [--json FILE]

Each run is the command line itself, in simulated time: what is counted here anyone can repeat seed by seed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

CASES = {"home": 120.0, "avoid": 600.0, "phototaxy": 120.0}
"""Seconds of the robot's time for each program."""


def run(program: str, duration: float, world: str, runs: str, seed: int) -> dict[str, Any]:
    """One run's result, as ``--json`` prints it."""
    words = ["--program", program, "--world", world, "--duration", str(duration), "--seed", str(seed)]
    done = subprocess.run(
        [sys.executable, "-m", "khepera_hil", *words, "--fast", "--json", "--runs", runs],
        capture_output=True,
        text=True,
        check=True,
    )
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def main() -> None:
    """Run them all and print a line each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    parser.add_argument("--world", default="furnished")
    parser.add_argument("--program", choices=list(CASES), action="append")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    figures: dict[str, Any] = {}
    for program in asked.program or list(CASES):
        with tempfile.TemporaryDirectory() as runs, ThreadPoolExecutor(os.cpu_count()) as pool:
            seeds = range(asked.first, asked.first + asked.seeds)
            results = list(pool.map(partial(run, program, CASES[program], asked.world, runs), seeds))
        scores = [result["score"] for result in results]
        reached = sorted(s["base_reached_s"] for s in scores if s["base_reached_s"] is not None)
        gentle = sum(score["contact_longest_s"] <= 0.5 for score in scores)
        figures[program] = {
            "n": len(scores),
            "base_reached": len(reached),
            "base_reached_median_s": reached[len(reached) // 2] if reached else None,
            "no_contact_over_half_second": gentle,
            "contacts_over_half_second": sum(score["contacts_over_half_second"] for score in scores),
            "contact_longest_s": max(score["contact_longest_s"] for score in scores),
            "distance_m": sum(score["distance_m"] for score in scores),
            "failed_seeds": [
                result["seed"]
                for result, score in zip(results, scores, strict=True)
                if (score["base_reached_s"] is None if program == "home" else score["contact_longest_s"] > 0.5)
            ],
        }
        print(f"{program} in {asked.world}, {CASES[program]:g} s: {json.dumps(figures[program])}")
    if asked.json:
        asked.json.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
