"""The run's folder: what is written is what is read, and what was acknowledged is there."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from khepera_hil.errors import RecordingError
from khepera_hil.reading import read_manifest, read_ticks, tick_of
from khepera_hil.recording import (
    HOST_COLUMNS,
    LOG,
    MANIFEST,
    Answer,
    Recording,
    Tick,
    log_file,
)
from tests.recording import synthetic

STARTED = datetime(2026, 3, 1, 14, 5, 9)

words = st.text(max_size=12)
names = st.text(min_size=1, max_size=8)
values = st.integers(-1000, 1000) | words
finite = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e9, max_value=1e9)
poses = st.tuples(finite, finite, finite)
any_tick = st.builds(
    Tick,
    tick=st.integers(0, 10**9),
    t=finite,
    raw=st.dictionaries(names, words, max_size=3),
    orders=st.lists(words, max_size=3),
    evidence=st.dictionaries(names, values, max_size=4),
    clipped=st.dictionaries(names, st.integers(0, 9), max_size=2),
    u=st.dictionaries(names, st.floats(0, 1, exclude_max=True), max_size=3),
    draws=st.dictionaries(names, values, max_size=3),
    command=st.none() | st.tuples(st.integers(-127, 127), st.integers(-127, 127)),
    events=st.lists(st.tuples(words, words), max_size=3),
    missed=st.integers(0, 100),
    late_ms=finite,
    work_ms=finite,
    wall=finite,
    pose=st.none() | poses,
    moved=st.dictionaries(names, poses, max_size=2),
)


def create(runs: Path, **more: Any) -> Recording:
    return Recording.create(
        runs, program="home", seed=7, manifest={**synthetic.manifest(), **more}, started=STARTED
    )


@settings(deadline=None)
@given(any_tick)
def test_a_tick_comes_back_from_its_line_as_it_was(tick: Tick) -> None:
    back = tick_of(json.loads(tick.line()))
    for column in ("tick", "raw", "orders", "evidence", "clipped", "u", "draws", "command", "events", "missed"):
        assert getattr(back, column) == getattr(tick, column), column
    assert back.t == pytest.approx(tick.t, abs=1e-6)
    assert (back.late_ms, back.work_ms) == pytest.approx((tick.late_ms, tick.work_ms), abs=1e-3)
    assert (back.pose is None) == (tick.pose is None)
    assert (back.pose or ()) == pytest.approx(tick.pose or (), abs=1e-6)
    assert back.moved.keys() == tick.moved.keys()
    assert b"\n" not in tick.line()[:-1]


def test_a_run_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    recording = create(tmp_path)
    written = list(synthetic.ticks(60))
    for tick in written:
        recording.write(tick)
    assert recording.close({"stop": "duration", "score": {"distance_m": 1.5}}) == []
    rows = list(read_ticks(recording.folder))
    assert [row["tick"] for row in rows] == list(range(60))
    for row, tick in zip(rows, written, strict=True):
        assert row["u"] == tick.u  # exact: a replay draws with it again
        assert row["raw"] == tick.raw
        assert row["answers"] == {key: answer.digest() for key, answer in tick.answers.items()}
        assert tick_of(row).command == tick.command
    manifest = read_manifest(recording.folder)
    assert manifest["ending"] == {"stop": "duration", "score": {"distance_m": 1.5}, "losses": []}
    assert (manifest["program"], manifest["seed"], manifest["run"]) == ("home", 7, recording.folder.name)
    assert set(manifest["host_columns"]) == set(HOST_COLUMNS) <= set(rows[0])
    assert manifest["questions"][0]["values"] == [list(range(-10, 11))]
    assert {"khepera-hil", "numpy", "rerun-sdk"} <= manifest["versions"].keys()


def test_the_manifest_is_there_from_the_start_and_says_nothing_of_an_ending(tmp_path: Path) -> None:
    recording = create(tmp_path)
    assert "ending" not in read_manifest(recording.folder)
    assert list(read_ticks(recording.folder)) == []
    recording.close({"stop": "signal"})
    assert read_manifest(recording.folder)["ending"]["stop"] == "signal"
    assert sorted(path.name for path in recording.folder.iterdir()) == [MANIFEST, LOG]  # no left-over beside it


def test_two_recordings_of_one_run_differ_in_the_hosts_columns_only(tmp_path: Path) -> None:
    logs = []
    for host in (0.25, 4.5):
        recording = create(tmp_path)
        for tick in synthetic.ticks(20, seed=3):
            tick.late_ms, tick.work_ms, tick.wall = host, 2 * host, 1e9 + host
            recording.write(tick)
        recording.close({})
        logs.append(list(read_ticks(recording.folder)))
    assert logs[0] != logs[1]
    for rows in logs:
        for row in rows:
            for column in HOST_COLUMNS:
                del row[column]
    assert logs[0] == logs[1]


def test_each_tick_is_one_write_of_one_whole_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = create(tmp_path)
    written: list[bytes] = []
    real = os.write

    def counting(fd: int, data: bytes) -> int:
        written.append(bytes(data))
        return real(fd, data)

    monkeypatch.setattr(os, "write", counting)
    for tick in synthetic.ticks(25):
        recording.write(tick)
    monkeypatch.undo()
    assert len(written) == 25
    assert all(line.endswith(b"\n") and line.count(b"\n") == 1 for line in written)
    assert (recording.folder / LOG).read_bytes() == b"".join(written)
    recording.close({})


def test_a_long_run_goes_on_in_further_files_and_is_read_back_as_one(tmp_path: Path) -> None:
    line = len(next(synthetic.ticks(1)).line())
    recording = Recording.create(
        tmp_path, program="home", seed=7, manifest=synthetic.manifest(), started=STARTED, segment=10 * line
    )
    for tick in synthetic.ticks(95):
        recording.write(tick)
    assert [row["tick"] for row in read_ticks(recording.folder)] == list(range(95))  # also while it goes on
    recording.close({})
    files = sorted(path.name for path in recording.folder.glob("ticks*.jsonl"))
    assert len(files) >= 9
    assert set(files) == {log_file(number) for number in range(len(files))}
    assert all((recording.folder / name).stat().st_size <= 10 * line for name in files)
    assert [row["tick"] for row in read_ticks(recording.folder)] == list(range(95))
    middle = recording.folder / log_file(4)
    kept = middle.read_bytes()
    middle.write_bytes(kept[:-1])
    with pytest.raises(RecordingError, match=r"ticks-0004\.jsonl, line \d+ is damaged: it has no end"):
        list(read_ticks(recording.folder))
    middle.unlink()
    with pytest.raises(RecordingError, match=r"ticks-0004\.jsonl is missing"):
        list(read_ticks(recording.folder))


def test_where_no_further_file_can_be_made_the_old_one_goes_on(tmp_path: Path) -> None:
    recording = Recording.create(
        tmp_path, program="home", seed=7, manifest=synthetic.manifest(), started=STARTED, segment=2000
    )
    (recording.folder / log_file(1)).touch()  # taken
    for tick in synthetic.ticks(20):
        recording.write(tick)
    recording.close({})
    (recording.folder / log_file(1)).unlink()
    assert [row["tick"] for row in read_ticks(recording.folder)] == list(range(20))


def test_a_half_last_line_is_passed_over(tmp_path: Path) -> None:
    recording = create(tmp_path)
    for tick in synthetic.ticks(5):
        recording.write(tick)
    recording.close({})
    log = recording.folder / LOG
    whole = log.read_bytes()
    last = whole.rstrip(b"\n").rfind(b"\n") + 1
    for cut in (last, last + 1, last + 40, len(whole) - 1):  # even a line that lacks only its end
        log.write_bytes(whole[:cut])
        assert [row["tick"] for row in read_ticks(recording.folder)] == [0, 1, 2, 3]


@pytest.mark.parametrize(
    "line",
    [
        b"{",
        b"[1,2]",
        b'{"tick":"3"}',
        b'{"tick":NaN}',
        b"\xff\xfe",
        b"[" * 100_000,
        b"",
        b"__import__('os')",
        b'{"tick":2,"t":"\\ud800"}',
    ],
)
def test_a_damaged_line_is_refused_with_file_and_line(tmp_path: Path, line: bytes) -> None:
    recording = create(tmp_path)
    for tick in synthetic.ticks(2):
        recording.write(tick)
    recording.close({})
    with (recording.folder / LOG).open("ab") as log:
        log.write(line + b"\n")
    with pytest.raises(RecordingError, match=r"ticks\.jsonl, line 3 is "):
        list(read_ticks(recording.folder))


@pytest.mark.parametrize("column", ["u", "pose", "command", "events", "evidence", "tick"])
def test_a_row_with_a_column_of_another_kind_is_refused(column: str) -> None:
    row = json.loads(next(synthetic.ticks(1)).line())
    row[column] = 3.5 if column != "tick" else "three"
    with pytest.raises(RecordingError, match="of the log is damaged"):
        tick_of(row)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "is not a run's folder"),
        (b"{", "is damaged"),
        (b"[]", "is not the manifest of a run"),
        (b'{"a":1}', "is not the manifest of a run"),
        (b'{"format":99}', "newer than"),
    ],
)
def test_a_folder_that_is_no_run_gets_a_sentence(tmp_path: Path, content: bytes | None, sentence: str) -> None:
    if content is not None:
        (tmp_path / MANIFEST).write_bytes(content)
    with pytest.raises(RecordingError, match=sentence):
        read_manifest(tmp_path)


def test_a_taken_name_is_never_overwritten(tmp_path: Path) -> None:
    folders = []
    for _ in range(3):
        recording = create(tmp_path)
        recording.close({})
        folders.append(recording.folder.name)
    first = "2026-03-01T14-05-09-home-7"
    assert folders == [first, f"{first}-2", f"{first}-3"]


def test_a_folder_that_cannot_be_made_gets_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(RecordingError, match=r"cannot be made in .*file.*--runs"):
        create(tmp_path / "file")


def make_nan(tick: Tick) -> None:
    tick.u["Vrot"] = float("nan")


def make_infinite(tick: Tick) -> None:
    tick.pose = (0.0, float("inf"), 0.0)


def make_object(tick: Tick) -> None:
    tick.evidence["Dir"] = object()  # type: ignore[assignment] # the mistake that is tested


@pytest.mark.parametrize(("spoil", "column"), [(make_nan, "u"), (make_infinite, "pose"), (make_object, "evidence")])
def test_what_is_no_json_is_refused_by_the_columns_name(
    tmp_path: Path, spoil: Callable[[Tick], None], column: str
) -> None:
    recording = create(tmp_path)
    tick = next(synthetic.ticks(1))
    spoil(tick)
    with pytest.raises(RecordingError, match=f"column '{column}'"):
        recording.write(tick)
    assert (recording.folder / LOG).read_bytes() == b""
    recording.close({})


def test_numpys_numbers_are_numbers(tmp_path: Path) -> None:
    evidence: dict[str, Any] = {"Dir": np.int64(-3)}
    draws: dict[str, Any] = {"Vrot": np.int32(4)}
    tick = Tick(0, np.float64(0.1), evidence=evidence, draws=draws, u={"Vrot": 0.1 + 0.2})
    row = json.loads(tick.line())
    assert (row["evidence"], row["draws"], row["u"]) == ({"Dir": -3}, {"Vrot": 4}, {"Vrot": 0.1 + 0.2})


def test_the_hash_of_an_answer_is_of_its_numbers_and_stays() -> None:
    p = np.array([[0.1, 0.2], [0.3, 0.4]])

    def digest(array: np.ndarray[Any, Any]) -> str:
        return Answer("q", ("A", "B"), ((0, 1), (0, 1)), array).digest()

    assert digest(p) == "afe9e75d1f86818f"  # b2sum -l 64 of the 32 bytes
    assert digest(np.asfortranarray(p)) == digest(p.astype(">f8")) == digest(p)
    assert digest(np.nextafter(p, 1)) != digest(p)


probabilities = st.lists(st.floats(0, 1), min_size=2, max_size=40).filter(lambda p: sum(p) > 0.01)


@given(probabilities, st.data())
def test_two_sketches_are_no_further_apart_than_their_distributions(p: list[float], data: st.DataObject) -> None:
    def answer(values: list[float]) -> Answer:
        whole = np.array(values) / sum(values)
        return Answer("q", ("A",), (tuple(range(len(values))),), whole)

    one = answer(p)
    other = answer(data.draw(st.permutations(p)))
    assert abs(one.sketch() - other.sketch()) <= np.abs(one.p - other.p).sum() + 1e-12
    assert answer(p).sketch() == one.sketch()


def test_an_answer_that_is_no_distribution_does_not_stop_the_log() -> None:
    tick = next(synthetic.ticks(1))
    tick.answers["H"] = Answer("q", ("A",), ((0, 1),), np.array([np.nan, 1.0]))
    assert json.loads(tick.line())["sketch"]["H"] is None


def test_nothing_is_written_after_the_end(tmp_path: Path) -> None:
    recording = create(tmp_path)
    recording.close({"stop": "duration"})
    recording.close({"stop": "twice"})
    with pytest.raises(RecordingError, match="is closed"):
        recording.write(next(synthetic.ticks(1)))
    assert read_manifest(recording.folder)["ending"]["stop"] == "duration"


class Ear:
    """A listener that keeps what it hears, and says that it lost something."""

    def __init__(self) -> None:
        self.heard: list[int] = []

    def offer(self, tick: Tick) -> None:
        self.heard.append(tick.tick)

    def close(self) -> list[str]:
        return [f"heard {len(self.heard)}"]


def test_listeners_hear_what_was_logged_and_their_losses_are_told(tmp_path: Path) -> None:
    recording, ear = create(tmp_path), Ear()
    recording.follow(ear)
    for tick in synthetic.ticks(3):
        recording.write(tick)
    assert recording.close({}) == ["heard 3"]
    assert ear.heard == [0, 1, 2]
    assert read_manifest(recording.folder)["ending"]["losses"] == ["heard 3"]


def child(code: str, *arguments: str) -> subprocess.Popen[str]:
    program = f"from pathlib import Path\nimport sys\nfrom tests.recording.test_recording import *\n{code}"
    return subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[2],
    )


ENDLESS = """
recording = create(Path(sys.argv[1]))
for tick in synthetic.ticks(10**9):
    recording.write(tick)
    print(tick.tick, flush=True)
"""


def test_a_killed_process_loses_no_acknowledged_tick(tmp_path: Path) -> None:
    with child(ENDLESS, str(tmp_path)) as process:
        assert process.stdout is not None
        heard = [int(process.stdout.readline()) for _ in range(200)]
        process.send_signal(signal.SIGKILL)
        heard += [int(line) for line in process.stdout if line.endswith("\n")]
    (folder,) = tmp_path.iterdir()
    logged = [row["tick"] for row in read_ticks(folder)]
    assert logged == list(range(len(logged)))
    assert set(heard) <= set(logged)
    assert "ending" not in read_manifest(folder)


FULL = """
import resource
recording = create(Path(sys.argv[1]))
room = int(10.5 * len(next(synthetic.ticks(1)).line()))
for attempt in range(2):
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.RLIM_INFINITY))
    try:
        for tick in synthetic.ticks(100):
            recording.write(tick)
    except RecordingError as error:
        print(error)
    room = (recording.folder / LOG).stat().st_size
"""


def test_a_full_disk_gets_a_sentence_and_leaves_whole_lines(tmp_path: Path) -> None:
    """The file may not grow beyond some ten lines and a half: one write is short; the next finds no room at all."""
    with child(FULL, str(tmp_path)) as process:
        out, err = process.communicate()
    assert process.returncode == 0, err
    sentences = out.splitlines()
    assert len(sentences) == 2
    assert "bytes were taken" in sentences[0]
    assert "File too large" in sentences[1]
    for sentence in sentences:
        assert sentence.startswith("tick ")
        assert LOG in sentence
        assert "make room there" in sentence
    (folder,) = tmp_path.iterdir()
    assert (folder / LOG).read_bytes().endswith(b"\n")
    assert len(list(read_ticks(folder))) >= 8


def test_the_log_and_the_queue_know_nothing_of_the_viewer() -> None:
    code = (
        "import sys, khepera_hil.recording, khepera_hil.follower, khepera_hil.viewer\n"
        "sys.exit(sum(name in sys.modules for name in ('rerun', 'pyarrow')))"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[2], check=False).returncode == 0
