"""What recording costs: the loop's thread with and without it, the recorder's thread, files, memory, asking again.

    python -m benchmarks.recording [--ticks N]      a minute
    python -m benchmarks.recording --hours 30       memory and bytes of a long run, written as fast as can be

The log and the queues run in the loop's thread; the viewer's file and the live view are written by followers. Paced
like a real run but ten times as fast (10 ms a tick), so that the threads meet as they do in a run.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import tempfile
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import numpy as np

from khepera_hil.commands import run
from khepera_hil.controllers import PROGRAMS
from khepera_hil.follower import Follower
from khepera_hil.reading import find
from khepera_hil.recording import Recording, Tick
from khepera_hil.replay import replay
from khepera_hil.viewer import FILE, PIECE, ROWS_FAST, ROWS_WALL, files, open_file
from khepera_hil.viewer.live import address, open_live
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
        recording = _recording(runs)
        sink = open_file(recording.folder / FILE, recording.manifest, rows=ROWS_WALL)
        recording.follow(Follower(sink, name=FILE, waits=False))
        live = open_live(recording.manifest, address(), page=False, window=False)
        recording.follow(Follower(live, name="the live view", waits=False))
        _paced("log, file and live view", ticks, recording.write)
        for sentence in recording.close({}):
            print(sentence)
        print("CPU of the recorder, ms a tick:")
        for rows in (ROWS_WALL, ROWS_FAST):
            file = open_file(Path(runs) / FILE, synthetic.manifest(), rows=rows)
            start = time.process_time()
            for tick in ticks:
                file.write(tick, 0)
            file.close()
            print(f"{rows:>4} ticks a chunk {(time.process_time() - start) / count * 1e3:12.2f}")
        _again(runs)


def long(hours: int, minutes: float) -> None:
    """Print memory and bytes while so many hours of ticks are written, hour by hour, ``minutes`` to a file."""
    print(f"{'hours':>6}{'RSS MB':>10}{'log MB':>10}{'rrd MB':>10}{'CPU s':>10}")
    with tempfile.TemporaryDirectory() as runs:
        recording = _recording(runs)
        file = open_file(recording.folder / FILE, recording.manifest, rows=ROWS_WALL, seconds=60 * minutes)
        follower = Follower(file, name=FILE, waits=True)
        recording.follow(follower)
        freed = 0.0
        ticks = synthetic.ticks(36_000 * hours)
        for hour in range(1, hours + 1):
            for _ in range(36_000):
                recording.write(next(ticks))
            log = sum(path.stat().st_size for path in recording.folder.glob("ticks*.jsonl")) / 1e6
            for path in files(recording.folder)[:-1]:
                freed += path.stat().st_size / 1e6
                os.truncate(path, 0)  # the disk of this machine need not hold a day
            shown = freed + sum(path.stat().st_size for path in files(recording.folder)) / 1e6
            print(f"{hour:6}{_rss():10.0f}{log:10.0f}{shown:10.0f}{time.process_time():10.0f}", flush=True)
        print(*recording.close({}), sep="\n")


def _again(runs: str) -> None:
    arguments = ["--program", "home", "--fast", "--duration", "600", "--seed", "8", "--runs", f"{runs}/ten"]
    with contextlib.redirect_stdout(io.StringIO()):
        run.main(arguments)
    start = time.perf_counter()
    found = replay(find("last", Path(runs) / "ten"), PROGRAMS["home"][1]().questions)
    print(
        f"asking a 10-minute run of home again ({found.ticks} ticks, {len(found.asked)} questions): "
        f"{time.perf_counter() - start:.2f} s, {'the same' if found.same else 'different'}"
    )


def _rss() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


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
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ticks", type=int, default=1000)
    parser.add_argument("--hours", type=int)
    parser.add_argument("--minutes", type=float, default=PIECE / 60, help="to a file, with --hours")
    asked = parser.parse_args()
    if asked.hours is None:
        main(asked.ticks)
    else:
        long(asked.hours, asked.minutes)
