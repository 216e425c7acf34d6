"""``python -m benchmarks.wall``: structural faults in wall time, on a real pseudo-terminal with a real pyserial.

The emulated robot is served by a thread of this process, so that what it sends can be overheard, before the faults,
on the same clock. Its ambient light sensors are noisy in every frame, so an answer to O is as good as numbered: one
that was accepted must be one that the robot sent after it was asked, no earlier one and no other.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.witness import overhear
from khepera_hil.clock import WallClock
from khepera_hil.disturbed import Disturbed
from khepera_hil.endpoints import Endpoint, pseudo_terminal
from khepera_hil.errors import LinkLost, PortError, RobotError
from khepera_hil.faults import Faults
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import open_port
from khepera_hil.serve import serve
from khepera_hil.uart import FIFO_16550
from khepera_hil.world import World

__all__ = ["campaign"]

FAULTS = "lines=0.1,frame=0.003,disconnect@7+1/20"
BAUD = 38400


@contextlib.contextmanager
def _served(endpoint: Endpoint, robot: Disturbed) -> Iterator[None]:
    stop, ender = os.pipe()
    thread = threading.Thread(target=lambda: serve([(endpoint, robot)], stop=stop))
    thread.start()
    try:
        yield
    finally:
        os.write(ender, b"x")
        thread.join()
        os.close(stop)
        os.close(ender)


def campaign(seconds: float, *, seed: int = 0, faults: str = FAULTS) -> dict[str, Any]:
    """Ask O again and again for so long; what was accepted, and what of it the robot had not said since."""
    line = Faults(faults, seed)
    sent: list[tuple[float, tuple[int, ...]]] = []
    overhear(line, lambda letter, values: sent.append((time.monotonic(), tuple(int(value) for value in values))))
    robot = Disturbed(World("furnished", seed), BAUD, faults=line, fifo=FIFO_16550)
    accepted = stale = wrong = asked = sessions = 0
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="wall-") as folder:
        name = Path(folder) / "khepera"
        with pseudo_terminal(name, BAUD) as endpoint, _served(endpoint, robot):
            khepera: Khepera | None = None
            while time.monotonic() < end:
                try:
                    if khepera is None:
                        khepera = Khepera(Link(open_port(str(name), BAUD), WallClock(), baud=BAUD))
                        sessions += 1
                    if not khepera.link.synchronised:
                        khepera.link.begin()
                    began = time.monotonic()
                    asked += 1
                    values = khepera.light()
                except RobotError:
                    continue
                except LinkLost:
                    khepera = None
                    continue
                except PortError:
                    time.sleep(0.01)  # it is unplugged
                    continue
                accepted += 1
                moments = [moment for moment, said in sent if said == values]
                wrong += not moments
                stale += bool(moments) and max(moments) < began
                del sent[:-200]
            if khepera is not None:
                khepera.link.close()
    return {
        "seconds": seconds,
        "faults": line.counts.total(),
        "by_kind": dict(line.counts),
        "asked": asked,
        "accepted": accepted,
        "stale": stale,
        "wrong": wrong,
        "sessions": sessions,
    }


def main() -> int:
    """Run it and print what came of it; 1 where anything stale or wrong was accepted."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.wall", description=__doc__)
    parser.add_argument("--seconds", type=float, default=300.0, help="(default: %(default)g)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--faults", default=FAULTS, help="(default: %(default)s)")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    result = campaign(given.seconds, seed=given.seed, faults=given.faults)
    print(json.dumps(result) if given.json else json.dumps(result, indent=2))
    return int(bool(result["stale"] or result["wrong"]))


if __name__ == "__main__":
    sys.exit(main())
