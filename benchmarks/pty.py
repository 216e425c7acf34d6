"""``python -m benchmarks.pty``: the night watchman over a pseudo-terminal, in wall time, ten times a second.

An emulated robot is served behind a pseudo-terminal by ``khepera-hil emulate``, with the events of the scenario
``night``, and ``khepera-hil`` runs the program on it as it would on a robot: two processes, a real pyserial, the
wire's own pace. Printed: ticks, deadlines missed, ticks without readings, how late the ticks came and how long they
worked, and how busy the machine was beside. It should be a quiet one.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from khepera_hil.reading import read_ticks, tick_of
from khepera_hil.recording import Tick

COMMAND = (sys.executable, "-m", "khepera_hil")
PERIOD = 0.1
START = 30.0
"""Seconds that the run may take until it obeys orders."""


def measure(seconds: float, seed: int, program: str) -> dict[str, Any]:
    """One run of so many seconds."""
    before, began = os.getloadavg(), _busy()
    with tempfile.TemporaryDirectory(prefix="pty-") as folder:
        link, runs = Path(folder) / "khepera", Path(folder) / "runs"
        served = ["emulate", "--pty", str(link), "--scenario", "night", "--seed", str(seed)]
        with subprocess.Popen([*COMMAND, *served], stdout=subprocess.PIPE, text=True) as robot:
            assert robot.stdout is not None
            robot.stdout.readline()
            asked = ["--port", str(link), "--program", program, "--seed", str(seed), "--runs", str(runs)]
            asked += ["--duration", str(seconds)]
            ran = subprocess.Popen([*COMMAND, *asked], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            if program == "watchman":
                _order(runs, ran)
            _, said = ran.communicate()
            robot.terminate()
        if ran.returncode:
            raise SystemExit(f"the run failed ({ran.returncode}): {said.strip()}")
        ticks = [tick_of(row) for row in read_ticks(next(runs.iterdir()))]
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "program": program,
        "seconds": seconds,
        "seed": seed,
        **_figures(ticks, seconds),
        "processor_s": round(used.ru_utime + used.ru_stime, 1),
        "machine_busy": _share(began, _busy()),
        "load": [round(before[0], 1), round(os.getloadavg()[0], 1)],
        "cores": os.cpu_count(),
    }


def _figures(ticks: Sequence[Tick], seconds: float) -> dict[str, Any]:
    late, work = ([getattr(tick, name) for tick in ticks] for name in ("late_ms", "work_ms"))
    return {
        "ticks": len(ticks),
        "due": round(seconds / PERIOD),
        "missed": sum(tick.missed for tick in ticks),
        "without_data": sum(not tick.evidence for tick in ticks),
        "late_ms": _spread(late),
        "work_ms": _spread(work),
    }


def _spread(values: Sequence[float]) -> dict[str, float]:
    p50, p99, most = np.percentile(values, [50, 99, 100])
    return {"p50": round(float(p50), 3), "p99": round(float(p99), 3), "max": round(float(most), 3)}


def _order(runs: Path, ran: subprocess.Popen[str]) -> None:
    """The vigil is on as soon as the run takes orders; its operator is not the scenario's."""
    give_up = time.monotonic() + START
    order = [*COMMAND, "order", "vigil", "on", "--runs", str(runs)]
    while ran.poll() is None and time.monotonic() < give_up:
        if subprocess.run(order, capture_output=True, check=False).returncode == 0:
            return
        time.sleep(0.2)


def _busy() -> tuple[float, float]:
    """Ticks of all cores since the machine started: those in which it worked, and all."""
    fields = [float(field) for field in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]]
    return sum(fields) - fields[3] - fields[4], sum(fields)


def _share(began: tuple[float, float], ended: tuple[float, float]) -> float:
    """How much of all cores was in use, by us too, between two moments."""
    return round((ended[0] - began[0]) / max(ended[1] - began[1], 1.0), 3)


def main() -> int:
    """Run it and print what came of it; 1 where a tick was missed or a tick had no readings."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pty", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="(default: %(default)g)")
    parser.add_argument("--seed", type=int, default=4)
    parser.add_argument("--program", default="watchman", help="(default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="on one line")
    asked = parser.parse_args()
    result = measure(asked.seconds, asked.seed, asked.program)
    print(json.dumps(result) if asked.json else json.dumps(result, indent=2))
    return int(bool(result["missed"] or result["without_data"]))


if __name__ == "__main__":
    sys.exit(main())
