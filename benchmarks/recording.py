"""What recording costs: the loop's thread with and without it, the recorder's thread, the file.

    python -m benchmarks.recording [ticks]

The log and the queue run in the loop's thread; the viewer's file is written by the follower's. Paced like a
real run but ten times as fast (10 ms a tick), so that the two threads meet as they do in a run.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import numpy as np

from khepera_hil.follower import Follower
from khepera_hil.recording import Recording, Tick
from khepera_hil.viewer import FILE, ROWS_FAST, ROWS_WALL, open_file
from tests.recording import synthetic

PERIOD = 0.01


def main(count: int = 1000) -> None:
    """Print one line for each way to record."""
    ticks = list(synthetic.ticks(count))
    print(f"{count} ticks, 4 questions of 65 values in all; ms a tick in the loop's thread")
    print(f"{'':34}{'p50':>8}{'p99':>8}{'max':>8}{'late p99':>10}")
    with tempfile.TemporaryDirectory() as runs:
        _paced("without recording", ticks, lambda tick: None)
        log = _recording(runs)
        _paced("log", ticks, log.write)
        log.close({})
        for name, rows in (("log and viewer's file, wall clock", ROWS_WALL), ("same, larger chunks", ROWS_FAST)):
            recording = _recording(runs)
            sink = open_file(recording.folder / FILE, recording.manifest, rows=rows)
            recording.follow(Follower(sink, name=FILE, waits=False))
            _paced(name, ticks, recording.write)
            for sentence in recording.close({}):
                print(sentence)
            size = (recording.folder / FILE).stat().st_size
            text = (recording.folder / "ticks.jsonl").stat().st_size
            print(
                f"{'':34}per hour at 10 Hz: log {text / count * 0.036:.0f} MB, {FILE} {size / count * 0.036:.0f} MB"
            )
        print("CPU of the recorder, ms a tick:")
        for rows in (ROWS_WALL, ROWS_FAST):
            sink = open_file(Path(runs) / FILE, synthetic.manifest(), rows=rows)
            start = time.process_time()
            for tick in ticks:
                sink.write(tick, 0)
            sink.close()
            print(f"{rows:>4} ticks a chunk {(time.process_time() - start) / count * 1e3:12.2f}")


def _recording(runs: str) -> Recording:
    return Recording.create(runs, program="home", seed=1, manifest=synthetic.manifest(), started=datetime.now())


def _paced(name: str, ticks: list[Tick], record: Callable[[Tick], None]) -> None:
    cost, late = np.empty(len(ticks)), np.empty(len(ticks))
    start = time.perf_counter() + PERIOD
    for i, tick in enumerate(ticks):
        time.sleep(max(0.0, start + i * PERIOD - time.perf_counter()))
        begin = time.perf_counter()
        late[i] = begin - (start + i * PERIOD)
        record(tick)
        cost[i] = time.perf_counter() - begin
    p50, p99 = np.percentile(cost, [50, 99]) * 1e3
    print(f"{name:34}{p50:8.3f}{p99:8.3f}{cost.max() * 1e3:8.3f}{np.percentile(late, 99) * 1e3:10.3f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
