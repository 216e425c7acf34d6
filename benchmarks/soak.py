"""``python -m benchmarks.soak``: many simulated hours of a program on a bad line, in one process.

The command line's main job is run in parts, one after the other, each with its own seed. After each part: did it
end well, are the ticks in its log without a gap, have memory and descriptors grown? Its recording is then thrown
away.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import io
import json
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from khepera_hil.__main__ import main as khepera_hil
from khepera_hil.reading import read_ticks, tick_of

FAULTS = "lines=1e-3,bytes=1e-3"
PERIOD = 0.1
GROWTH = 4.0
"""MB an hour of the fitted line through the parts' ends, from the second part on, that count as growth."""


def part(hours: float, seed: int, program: str, faults: str, folder: Path) -> dict[str, Any]:
    """One run: its exit code, its ticks, and what of them is missing."""
    asked = ["--program", program, "--fast", "--resume", "--faults", faults, "--seed", str(seed)]
    asked += ["--duration", str(3600 * hours), "--patience", "1e6", "--runs", str(folder), "--json"]
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = khepera_hil(asked)
    result = json.loads(out.getvalue().splitlines()[-1]) if code == 0 else {}
    ticks = gaps = blind = 0
    longest = run_blind = 0
    for run in sorted(folder.iterdir()):
        for tick in map(tick_of, read_ticks(run)):
            gaps += tick.tick != ticks or tick.missed
            ticks = tick.tick + 1
            run_blind = 0 if tick.evidence else run_blind + 1
            blind += not tick.evidence
            longest = max(longest, run_blind)
        shutil.rmtree(run)
    return {
        "seed": seed,
        "exit": code,
        "said": err.getvalue().strip()[-300:],
        "ticks": ticks,
        "due": round(3600 * hours / PERIOD),
        "gaps": gaps,
        "without_data": blind,
        "longest_without_data": longest,
        "faults": sum(result.get("faults", {}).values()),
        "resets": result.get("robot_resets"),
    }


def resources() -> tuple[float, int]:
    """MB of memory in use, and descriptors open."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6, len(os.listdir("/proc/self/fd"))


def main() -> int:
    """Run the parts and print what came of each; 1 where anything failed, is missing or grew."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description=__doc__)
    parser.add_argument("--hours", type=float, default=30.0, help="simulated, in all (default: %(default)g)")
    parser.add_argument("--part", type=float, default=1.0, help="hours of a part (default: %(default)g)")
    parser.add_argument("--seed", type=int, default=0, help="of the first part; later ones count on")
    parser.add_argument("--program", default="home")
    parser.add_argument("--faults", default=FAULTS, help="(default: %(default)s)")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    began = time.perf_counter()
    parts: list[dict[str, Any]] = []
    done = 0.0
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        while done < asked.hours - 1e-9:
            hours = min(asked.part, asked.hours - done)
            found = part(hours, asked.seed + len(parts), asked.program, asked.faults, Path(folder))
            done += hours
            memory, descriptors = resources()
            parts.append({**found, "hours": done, "memory_mb": round(memory, 1), "descriptors": descriptors})
            print(json.dumps(parts[-1]), file=sys.stderr, flush=True)
    growth = 0.0
    if len(parts) > 3:
        x, y = np.array([(one["hours"], one["memory_mb"]) for one in parts[1:]]).T
        growth = float(np.polyfit(x, y, 1)[0])
    result = {
        "hours": done,
        "ticks": sum(one["ticks"] for one in parts),
        "faults": sum(one["faults"] for one in parts),
        "without_data": sum(one["without_data"] for one in parts),
        "failed_parts": sum(one["exit"] != 0 for one in parts),
        "gaps": sum(one["gaps"] + abs(one["ticks"] - one["due"]) for one in parts),
        "memory_mb": [parts[0]["memory_mb"], parts[-1]["memory_mb"]],
        "memory_growth_mb_per_hour": round(growth, 3),
        "descriptors": sorted({one["descriptors"] for one in parts}),
        "seconds": round(time.perf_counter() - began, 1),
    }
    print(json.dumps(result) if asked.json else json.dumps(result, indent=2))
    grew = growth > GROWTH or parts[-1]["descriptors"] > parts[0]["descriptors"]
    return int(bool(result["failed_parts"] or result["gaps"] or grew))


if __name__ == "__main__":
    sys.exit(main())
