"""The viewer's file, read back with the viewer's own reader: everything is there, and it is what was answered."""

from __future__ import annotations

import signal
import subprocess
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from khepera_hil.errors import RecordingError
from khepera_hil.follower import Follower
from khepera_hil.recording import LOG, Answer, Recording, Tick
from khepera_hil.viewer import FILE, ROWS_FAST, ROWS_WALL, open_file, remake
from khepera_hil.viewer.columns import bars
from khepera_hil.viewer.scene import hatching
from tests.recording import synthetic
from tests.recording.rrd import entities, heights, rows

COUNT = 130


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded run of 13 s, as the service records it."""
    recording = Recording.create(
        tmp_path_factory.mktemp("runs"),
        program="home",
        seed=7,
        manifest=synthetic.manifest(),
        started=datetime(2026, 3, 1, 14, 5, 9),
    )
    sink = open_file(recording.folder / FILE, recording.manifest, rows=ROWS_FAST)
    recording.follow(Follower(sink, name=FILE, waits=True))
    for tick in synthetic.ticks(COUNT):
        recording.write(tick)
    assert recording.close({"stop": "duration"}) == []
    return recording.folder


@pytest.mark.parametrize("key", ["Vrot", "Vrot avoidance", "Vrot phototaxy"])
def test_every_distribution_of_every_tick_is_in_the_file(folder: Path, key: str) -> None:
    entity = "/distributions/" + rr.escape_entity_path_part(key) + "/p"
    found = rows(folder / FILE, entity, "BarChart:values")
    assert sorted(found) == list(range(COUNT))
    for tick in synthetic.ticks(COUNT):
        time, value = found[tick.tick]
        assert time == pytest.approx(tick.t, abs=1e-9)
        np.testing.assert_array_equal(heights(value), tick.answers[key].p.astype(np.float32))


def test_a_variable_of_few_words_has_a_bar_for_each(folder: Path) -> None:
    for i, word in enumerate(synthetic.H):
        found = rows(folder / FILE, f"/distributions/H/{word}", "BarChart:values")
        for tick in synthetic.ticks(COUNT):
            assert heights(found[tick.tick][1]) == tick.answers["H"].p[i : i + 1].astype(np.float32)


def test_the_draw_is_marked_where_it_fell(folder: Path) -> None:
    needles = rows(folder / FILE, "/distributions/Vrot/drawn", "BarChart:values")
    drawn = rows(folder / FILE, "/summary/Vrot/drawn", "Scalars:scalars")
    for tick in synthetic.ticks(COUNT):
        assert synthetic.VROT[int(np.argmax(heights(needles[tick.tick][1])))] == tick.draws["Vrot"]
        assert drawn[tick.tick][1] == [tick.draws["Vrot"]]


def test_readings_commands_variables_and_the_loops_columns_are_in_the_file(folder: Path) -> None:
    def numbers(entity: str) -> dict[int, Any]:
        return {tick: value for tick, (_, value) in rows(folder / FILE, entity, "Scalars:scalars").items()}

    proximity, light = numbers("/sensors/proximity"), numbers("/sensors/light")
    motors, late, counts = numbers("/motors"), numbers("/loop/ms"), numbers("/loop/counts")
    theta = numbers("/variables/Theta1")
    for tick in synthetic.ticks(COUNT):
        assert proximity[tick.tick] == [float(word) for word in tick.raw["N"].split(",")[1:]]
        assert light[tick.tick] == [float(word) for word in tick.raw["O"].split(",")[1:]]
        assert tuple(motors[tick.tick]) == tick.command
        assert late[tick.tick] == [tick.late_ms, tick.work_ms]
        assert counts[tick.tick] == [tick.missed, 0]
        assert theta[tick.tick] == [tick.evidence["Theta1"]]
    poses = rows(folder / FILE, "/world/robot", "Transform3D:translation")
    moved = rows(folder / FILE, "/world/block/box", "Transform3D:translation")
    for tick in synthetic.ticks(COUNT):
        assert tick.pose is not None
        assert poses[tick.tick][1][0][:2] == pytest.approx(tick.pose[:2], abs=1e-6)
    assert sorted(moved) == [0, *range(101, COUNT)]  # where it stands at first, then whenever it was moved


def test_events_have_their_time_and_level(folder: Path) -> None:
    texts = [
        (batch["tick"].to_pylist(), batch["TextLog:text"].to_pylist(), batch["TextLog:level"].to_pylist())
        for chunk in rr.chunk.RrdReader(str(folder / FILE)).stream().filter(content="/events")
        for batch in [chunk.to_record_batch()]
    ]
    found = [(tick, level[0], text[0]) for batch in texts for tick, text, level in zip(*batch, strict=True)]
    assert (0, "INFO", "running") in found
    assert (97, "WARN", "1 deadline skipped: the tick before took too long") in found
    assert len(found) == sum(len(tick.events) for tick in synthetic.ticks(COUNT))


def test_both_timelines_and_the_layout_are_in_the_file(folder: Path) -> None:
    reader = rr.chunk.RrdReader(str(folder / FILE))
    assert len(reader.blueprints()) == 1
    (recording,) = reader.recordings()
    assert recording.recording_id == folder.name
    for chunk in reader.stream().filter(is_static=False):
        assert {"tick", "run_time", "wall_clock"} <= set(chunk.to_record_batch().schema.names), chunk.entity_path


def test_a_tick_without_an_answer_clears_the_panel(tmp_path: Path) -> None:
    path = tmp_path / FILE
    sink = open_file(path, {"program": "home", **synthetic.manifest()}, rows=4)
    for tick in synthetic.ticks(6):
        if tick.tick == 3:  # the robot did not answer, so nothing was asked
            tick.raw, tick.answers, tick.draws, tick.evidence, tick.command = {}, {}, {}, {}, None
        sink.write(tick, 2)
    sink.close()
    found = rows(path, "/distributions/Vrot/p", "BarChart:values")
    assert [tick for tick, (_, value) in found.items() if value is None] == [3]
    assert np.isnan(rows(path, "/sensors/proximity", "Scalars:scalars")[3][1]).all()
    assert rows(path, "/world/robot/proximity", "LineStrips2D:strips")[3][1] is None
    assert rows(path, "/loop/counts", "Scalars:scalars")[5][1] == [0, 2]


def test_a_question_of_several_variables_shows_each_and_keeps_the_whole(tmp_path: Path) -> None:
    path, values = tmp_path / FILE, ((0, 1, 2), ("left", "right"))
    question = {"key": "AB", "name": "P(A B)", "variables": ["A", "B"], "values": values, "main": True}
    p = np.array([[0.1, 0.2], [0.3, 0.1], [0.25, 0.05]])
    sink = open_file(path, {"program": "two", "questions": [question]}, rows=2)
    sink.write(
        Tick(0, 0.0, answers={"AB": Answer("P(A B)", ("A", "B"), values, p)}, draws={"A": 2, "B": "left"}), 0
    )
    sink.close()

    def shown(entity: str, component: str = "BarChart:values") -> NDArray[np.float32]:
        return heights(rows(path, entity, component)[0][1])

    np.testing.assert_array_equal(shown("/distributions/AB/joint", "Tensor:data"), p.astype(np.float32))
    np.testing.assert_array_equal(shown("/distributions/AB/A/p"), p.sum(axis=1).astype(np.float32))
    np.testing.assert_array_equal(shown("/distributions/AB/B/left"), p[:, :1].sum(axis=0).astype(np.float32))
    assert np.argmax(shown("/distributions/AB/A/drawn")) == 2


def test_the_file_is_made_anew_from_the_log_as_far_as_the_log_has_it(folder: Path, tmp_path: Path) -> None:
    for name in ("manifest.json", LOG):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    remake(tmp_path)
    for entity in ("/sensors/proximity", "/motors", "/summary/Vrot/drawn", "/variables/Dir"):
        whole, anew = (rows(place / FILE, entity, "Scalars:scalars") for place in (folder, tmp_path))
        assert anew == whole
    remake(tmp_path, synthetic.ticks(COUNT))  # the answers computed again
    assert entities(tmp_path / FILE) == entities(folder / FILE)
    entity = "/distributions/Vrot/p"
    assert rows(tmp_path / FILE, entity, "BarChart:values") == rows(folder / FILE, entity, "BarChart:values")


def test_a_damaged_log_leaves_the_old_file(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_bytes((folder / "manifest.json").read_bytes())
    (tmp_path / LOG).write_bytes((folder / LOG).read_bytes() + b"rubbish\n")
    (tmp_path / FILE).write_bytes(b"old")
    with pytest.raises(RecordingError, match=f"line {COUNT + 1} is damaged"):
        remake(tmp_path)
    assert (tmp_path / FILE).read_bytes() == b"old"
    assert {path.name for path in tmp_path.iterdir()} == {"manifest.json", LOG, FILE}


KILLED = """
import sys
from pathlib import Path
from khepera_hil.viewer import open_file
from tests.recording import synthetic
sink = open_file(Path(sys.argv[1]), {"program": "home", **synthetic.manifest()}, rows=int(sys.argv[2]))
for tick in synthetic.ticks(100):
    sink.write(tick, 0)
print("written", flush=True)
sys.stdin.read()
"""


# A file that was never closed has no footer; that the reader says so is no fault.
@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_a_killed_process_leaves_a_file_that_lacks_the_last_second_only(tmp_path: Path) -> None:
    """At the hundredth tick the sink has its file flushed, so all that was sent by then is in it."""
    path = tmp_path / FILE
    command = [sys.executable, "-c", KILLED, str(path), str(ROWS_WALL)]
    root = Path(__file__).parents[2]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=root) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"written\n"
        process.send_signal(signal.SIGKILL)
    found = rows(path, "/distributions/Vrot/p", "BarChart:values")
    assert set(found) >= set(range(100 - ROWS_WALL))
    assert set(rows(path, "/motors", "Scalars:scalars")) >= set(range(100 - ROWS_WALL))


charts = st.lists(
    st.none() | hnp.arrays(np.float64, st.integers(1, 40), elements=st.floats(0, 1)), min_size=1, max_size=8
)


@settings(deadline=None)
@given(charts)
def test_bars_keep_their_numbers_and_shapes(some: list[NDArray[np.float64] | None]) -> None:
    (column,) = bars(some)
    for row, value in zip(some, column.as_arrow_array().to_pylist(), strict=True):
        if row is None:
            assert value == []
        else:
            np.testing.assert_array_equal(heights(value), row.astype(np.float32))


convex = st.lists(st.floats(0, 2 * np.pi), min_size=3, max_size=8, unique=True).map(sorted)


@settings(deadline=None)
@given(convex, st.floats(0.01, 1))
def test_a_polygons_strokes_stay_within_it(angles: list[float], size: float) -> None:
    points = size * np.column_stack([np.cos(angles), np.sin(angles)])
    if np.ptp(points[:, 1]) < 1e-6:
        return
    strokes, half = hatching(points)
    edges = np.roll(points, -1, axis=0) - points
    for end in strokes.reshape(-1, 2).astype(np.float64):
        offset = end - points
        cross = edges[:, 0] * offset[:, 1] - edges[:, 1] * offset[:, 0]  # counter-clockwise: inside is left
        assert (cross > -1e-6).all()
    assert len(strokes) <= 24
    assert half == pytest.approx(np.ptp(points[:, 1]) / 48)
