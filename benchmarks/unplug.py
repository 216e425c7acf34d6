"""``python -m benchmarks.unplug``: an adapter is pulled out for five seconds, again and again, in wall time.

An emulated robot is served behind a pseudo-terminal that goes and comes back as a real adapter does (``khepera-hil
emulate --faults disconnect@...``), and a program runs on it. Measured: from the device's return to the end of the
first tick that has readings again.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from khepera_hil.reading import read_ticks, tick_of

COMMAND = (sys.executable, "-m", "khepera_hil")
LIMIT = 1.0
"""Seconds in which there are to be readings again."""


def returns(link: Path, stop: threading.Event, found: list[float]) -> None:
    """Watch for the device's returns: the moments (Unix time) at which its name leads somewhere again."""
    there = True
    while not stop.wait(0.001):
        now_there = link.exists()
        if now_there and not there:
            found.append(time.time())
        there = now_there


def measure(number: int, away: float, every: float, seed: int, program: str) -> dict[str, Any]:
    """Pull the plug ``number`` times, each ``every`` seconds; seconds from each return to readings."""
    with tempfile.TemporaryDirectory(prefix="unplug-") as folder:
        link = Path(folder) / "khepera"
        faults = f"disconnect@{every - away}+{away}/{every}"
        robot = subprocess.Popen(
            [*COMMAND, "emulate", "--pty", str(link), "--seed", str(seed), "--faults", faults],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert robot.stdout is not None
        robot.stdout.readline()
        found: list[float] = []
        stop = threading.Event()
        watching = threading.Thread(target=returns, args=(link, stop, found))
        watching.start()
        runs = Path(folder) / "runs"
        asked = ["--port", str(link), "--program", program, "--seed", str(seed), "--runs", str(runs), "--json"]
        asked += ["--duration", str(every * number + 0.2 * (every - away))]
        done = subprocess.run([*COMMAND, *asked], capture_output=True, text=True, check=False)
        stop.set()
        watching.join()
        robot.terminate()
        robot.wait(10)
        if done.returncode:
            raise SystemExit(f"the run failed ({done.returncode}): {done.stderr.strip()}")
        ticks = [tick_of(row) for row in read_ticks(next(runs.iterdir()))]
    delays = []
    for moment in found:
        # A tick's wall time is that of its begin, and readings are there when its work is done.
        ends = [tick.wall + tick.work_ms / 1000 for tick in ticks if tick.evidence]
        after = [end - moment for end in ends if end > moment]
        if after:
            delays.append(min(after))
    return {
        "unplugged": len(found),
        "back": len(delays),
        "away_s": away,
        "p50_s": round(float(np.median(delays)), 3),
        "max_s": round(max(delays), 3),
        "load": [round(load, 1) for load in os.getloadavg()],
    }


def main() -> int:
    """Measure and print; 1 where it took longer than a second."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.unplug", description=__doc__)
    parser.add_argument("--n", type=int, default=20, help="times (default: %(default)s)")
    parser.add_argument("--away", type=float, default=5.0, help="seconds (default: %(default)g)")
    parser.add_argument("--every", type=float, default=10.0, help="seconds (default: %(default)g)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--program", default="avoid")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    result = measure(asked.n, asked.away, asked.every, asked.seed, asked.program)
    print(json.dumps(result) if asked.json else json.dumps(result, indent=2))
    return int(result["max_s"] > LIMIT or result["back"] < result["unplugged"])


if __name__ == "__main__":
    sys.exit(main())
