"""A follower in a process of its own, with real processes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from khepera_hil.apart import Apart
from khepera_hil.viewer import FILE, ROWS_WALL
from khepera_hil.viewer.check import damage
from tests.recording.rrd import rows

SINK = "tests.recording.sinks:Noting"
LONG = 60.0


def noted(path: Path) -> list[list[Any]]:
    """What the sink did, its opening left out."""
    return [json.loads(line) for line in path.read_text().splitlines()][1:] if path.exists() else []


def eventually(what: Callable[[], bool]) -> None:
    end = time.monotonic() + LONG
    while not what():
        assert time.monotonic() < end
        time.sleep(0.01)


def apart(path: Path, *, capacity: int = 256, deadline: float = LONG, **arguments: object) -> Apart[object]:
    return Apart(
        SINK,
        {"path": path, **arguments},
        name="the file",
        capacity=capacity,
        patience=LONG,
        deadline=deadline,
    )


def test_all_that_is_offered_comes_through_in_order(tmp_path: Path) -> None:
    path = tmp_path / "notes"
    follower = apart(path, capacity=2000)
    follower.wait_until_open()
    for item in range(1000):
        follower.offer(item)
    assert follower.close() == []
    assert follower.close() == []
    assert noted(path) == [[item, 0] for item in range(1000)] + [["close", 0]]


def test_items_of_any_size_come_through(tmp_path: Path) -> None:
    path = tmp_path / "notes"
    sizes = [0, 1, 70_000, 3_000_000, 5]
    follower = apart(path)
    for size in sizes:
        follower.offer(bytes(size))
    assert follower.close() == []
    assert noted(path)[:-1] == [[size, 0] for size in sizes]


def test_what_finds_no_room_is_dropped_and_counted_and_the_loop_does_not_wait(tmp_path: Path) -> None:
    path, gate = tmp_path / "notes", tmp_path / "gate"
    follower = apart(path, gate=gate, capacity=4)
    follower.wait_until_open()
    for _ in range(40):  # some are between the two processes, four wait here
        follower.offer(bytes(100_000))
    assert 0 < follower.dropped < 40
    gate.touch()
    told = follower.close()  # by then the other side has said what found no room there
    lost = follower.dropped
    assert 0 < lost < 40
    assert told == [f"the file lacks {lost} ticks"]
    assert len(noted(path)) == 40 - lost + 1


def test_a_sink_that_cannot_be_opened_is_told(tmp_path: Path) -> None:
    follower: Apart[int] = Apart("tests.recording.sinks:absent", {"path": tmp_path}, name="the file", patience=LONG)
    follower.wait_until_open()
    assert follower.error == "FileNotFoundError: nothing for ['path']"
    follower.offer(1)
    assert follower.close() == [
        "the file is incomplete: FileNotFoundError: nothing for ['path']",
        "the file lacks 1 ticks",
    ]


def test_a_sinks_error_is_told_once_and_what_comes_after_it_counted(tmp_path: Path) -> None:
    path = tmp_path / "notes"
    follower = apart(path, fails_at=3, capacity=1000)
    for item in range(600):
        follower.offer(item)
    assert follower.close() == ["the file is incomplete: ValueError: no more", "the file lacks 596 ticks"]
    assert noted(path) == [[0, 0], [1, 0], [2, 0], ["close", 0]]  # what it has is worth finishing


def test_a_process_that_is_killed_takes_the_file_along_and_not_the_run(tmp_path: Path) -> None:
    path = tmp_path / "notes"
    follower = apart(path)
    follower.offer(0)
    eventually(lambda: noted(path) == [[0, 0]])
    assert follower.pid is not None
    os.kill(follower.pid, signal.SIGKILL)
    while follower.error is None:
        follower.offer(1)
    assert follower.close()[0] == "the file is incomplete: its process was ended by SIGKILL"


def test_what_cannot_be_handed_over_is_told_and_the_run_goes_on(tmp_path: Path) -> None:
    follower = apart(tmp_path / "notes")
    follower.offer(lambda: None)
    follower.offer(1)
    first, second = follower.close()
    assert first.startswith("the file is incomplete: ")
    assert second == "the file lacks 2 ticks"


def test_a_process_that_cannot_be_started_is_told_and_the_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "no-such-program"))
    follower = apart(tmp_path / "notes")
    follower.wait_until_open()
    follower.offer(0)
    assert follower.close() == [
        "the file is incomplete: its process does not start: No such file or directory",
        "the file lacks 1 ticks",
    ]


def test_a_sink_that_hangs_does_not_keep_the_run_from_ending(tmp_path: Path) -> None:
    follower = apart(tmp_path / "notes", hangs=True, deadline=1.0)
    follower.wait_until_open()
    assert follower.close() == ["the file was not finished within 1 s"]


ENDS = """
import os, sys
from pathlib import Path
from khepera_hil.apart import Apart
from khepera_hil.viewer import FILE
from tests.recording import synthetic
folder = Path(sys.argv[1])
manifest = {"program": "home", **synthetic.manifest()}
arguments = {"path": folder / FILE, "manifest": manifest, "rows": int(sys.argv[2])}
follower = Apart("khepera_hil.viewer:open_file", arguments, name="it")
follower.wait_until_open()
for tick in synthetic.ticks(47):
    follower.offer(tick)
while follower.waiting:  # as the next offers would find room for them
    follower.talk(1.0)
print(follower.pid, flush=True)
sys.stdin.read()
"""


def test_of_a_killed_run_the_file_is_finished(tmp_path: Path) -> None:
    """It lacks no tick, and has its footer, which a file that is written in the run's own process has not."""
    command = [sys.executable, "-c", ENDS, str(tmp_path), str(ROWS_WALL)]
    root = Path(__file__).parents[2]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=root) as process:
        assert process.stdout is not None
        pid = int(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
    eventually(lambda: not running(pid))
    assert damage(tmp_path / FILE) is None
    assert set(rows(tmp_path / FILE, "/motors", "Scalars:scalars")) == set(range(47))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_for_everybody_lets_the_file_be_finished(tmp_path: Path, number: int) -> None:
    path = tmp_path / "notes"
    follower = apart(path)
    follower.offer(0)
    eventually(lambda: noted(path) == [[0, 0]])
    assert follower.pid is not None
    os.kill(follower.pid, number)
    follower.offer(1)
    assert follower.close() == []
    assert noted(path) == [[0, 0], [1, 0], ["close", 0]]


def running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
