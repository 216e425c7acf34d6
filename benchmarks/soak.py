"""``python -m benchmarks.soak``: many simulated hours of a program on a bad line.

The command line's main job is run in parts, each a process with its own seed. Of each: did it end well, are the
ticks in its log numbered without a gap, did memory and descriptors grow from the second third of its time to the
last? Deadlines that a long resynchronisation missed are counted beside. Its recording is then thrown away.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from khepera_hil.reading import read_ticks, tick_of

FAULTS = "lines=1e-3,bytes=1e-3"
PERIOD = 0.1
GROWTH = 4.0
"""MB a simulated hour, the median of the parts, that count as growth."""


def part(hours: float, seed: int, program: str, faults: str, folder: Path) -> dict[str, Any]:
    """One run: its exit code, its ticks, and what of them is missing."""
    asked = ["--program", program, "--fast", "--resume", "--faults", faults, "--seed", str(seed)]
    asked += ["--duration", str(3600 * hours), "--patience", "1e6", "--runs", str(folder), "--json"]
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        process = subprocess.Popen([sys.executable, "-m", "khepera_hil", *asked], stdout=out, stderr=err)
        samples = []
        while process.poll() is None:
            with contextlib.suppress(OSError, IndexError):  # it has just ended
                samples.append(resources(process.pid))
            time.sleep(0.25)
        out.seek(0)
        err.seek(0)
        code, said = process.returncode, err.read().strip()
        result = json.loads(out.read().splitlines()[-1]) if code == 0 else {}
    third = len(samples) // 3
    before, after = (np.median(np.array(part), axis=0) for part in (samples[third : 2 * third], samples[-third:]))
    ticks = gaps = missed = blind = 0
    longest = run_blind = 0
    for run in sorted(folder.iterdir()):
        for tick in map(tick_of, read_ticks(run)):
            gaps += tick.tick != ticks
            missed += tick.missed
            ticks = tick.tick + 1
            run_blind = 0 if tick.evidence else run_blind + 1
            blind += not tick.evidence
            longest = max(longest, run_blind)
        shutil.rmtree(run)
    return {
        "seed": seed,
        "exit": code,
        "said": said[-300:],
        "ticks": ticks,
        "due": round(3600 * hours / PERIOD),
        "gaps": gaps,
        "missed": missed,
        "without_data": blind,
        "longest_without_data": longest,
        "faults": sum(result.get("faults", {}).values()),
        "resets": result.get("robot_resets"),
        "memory_mb": [round(float(before[0]), 1), round(float(after[0]), 1)],
        "descriptors": [int(before[1]), int(after[1])],
    }


def resources(pid: int) -> tuple[float, int]:
    """MB of memory in use by a process, and descriptors that it has open."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6, len(os.listdir(f"/proc/{pid}/fd"))


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
            parts.append({**found, "hours": done})
            print(json.dumps(parts[-1]), file=sys.stderr, flush=True)
    # From the middle of the second third of a part to the middle of its last third it is a part's third.
    growth = [3 * (one["memory_mb"][1] - one["memory_mb"][0]) / min(asked.part, asked.hours) for one in parts]
    opened = [one["descriptors"][1] - one["descriptors"][0] for one in parts]
    result = {
        "hours": done,
        "ticks": sum(one["ticks"] for one in parts),
        "faults": sum(one["faults"] for one in parts),
        "without_data": sum(one["without_data"] for one in parts),
        "failed_parts": sum(one["exit"] != 0 for one in parts),
        "gaps": sum(one["gaps"] + abs(one["ticks"] + one["missed"] - one["due"]) for one in parts),
        "missed": sum(one["missed"] for one in parts),
        "memory_mb": max(one["memory_mb"][1] for one in parts),
        "memory_growth_mb_per_hour": round(float(np.median(growth)), 2),
        "descriptors_more": max(opened),
        "seconds": round(time.perf_counter() - began, 1),
    }
    print(json.dumps(result) if asked.json else json.dumps(result, indent=2))
    grew = float(np.median(growth)) > GROWTH or max(opened) > 0
    return int(bool(result["failed_parts"] or result["gaps"] or grew))


if __name__ == "__main__":
    sys.exit(main())
