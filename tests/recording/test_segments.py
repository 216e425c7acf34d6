"""Long runs, and words over time, in the viewer's files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from khepera_hil.lifecycle import Lifecycle
from khepera_hil.recording import Answer, Tick
from khepera_hil.viewer import FILE, files, open_file
from khepera_hil.viewer.check import damage
from khepera_hil.viewer.states import SERVICE, SERVICE_STATES
from tests.recording import synthetic
from tests.recording.rrd import entities, rows


def test_a_long_run_is_in_pieces_that_are_one_recording_and_each_can_be_opened(tmp_path: Path) -> None:
    manifest = {"program": "home", "run": "long", **synthetic.manifest()}
    sink = open_file(tmp_path / FILE, manifest, rows=7, seconds=5.0)
    for tick in synthetic.ticks(230):
        sink.write(tick, 0)
    sink.close()
    pieces = files(tmp_path)
    assert [path.name for path in pieces] == [FILE, *(f"run-{i:04d}.rrd" for i in range(1, 5))]
    found: list[int] = []
    for path in pieces:
        assert damage(path) is None
        reader = rr.chunk.RrdReader(str(path))
        assert [recording.recording_id for recording in reader.recordings()] == ["long"]
        assert len(reader.blueprints()) == 1
        assert "/world/floor" in entities(path)
        found += sorted(rows(path, "/motors", "Scalars:scalars"))
    assert found == list(range(230)), "every tick once, in order"


def test_a_later_piece_begins_with_things_where_they_were_moved_to(tmp_path: Path) -> None:
    sink = open_file(tmp_path / FILE, {"program": "home", **synthetic.manifest()}, rows=10, seconds=15.0)
    moved: dict[str, Any] = {}
    for tick in synthetic.ticks(320):
        moved |= tick.moved
        sink.write(tick, 0)
    sink.close()
    entity = "/world/block/box"
    first = rows(files(tmp_path)[2], entity, "Transform3D:translation")
    assert list(first) == [300]
    assert first[300][1][0][:2] == pytest.approx(moved["box"][:2], abs=1e-6)


def states(path: Path, name: str) -> list[tuple[int, str]]:
    return changes(path, f"/states/{name}")


def changes(path: Path, entity: str) -> list[tuple[int, str]]:
    return [
        (tick, value[0] if value else "")
        for tick, (_, value) in sorted(rows(path, entity, "StateChange:state").items())
    ]


def test_words_are_states_that_change_when_they_do_known_drawn_or_most_probable(tmp_path: Path) -> None:
    question = {
        "key": "Behavior",
        "name": "P(Behavior | Energy Vigil)",
        "variables": ["Behavior"],
        "values": [["idle", "patrol", "recharge"]],
        "main": True,
    }
    asked = {**question, "key": "H", "variables": ["H"], "values": [["avoidance", "phototaxy"]], "main": False}
    evidence = {"Energy": ["low", "high"], "Vigil": [False, True], "Prox": [0, 1]}
    manifest = {"program": "night", "questions": [question, asked], "evidence": evidence}
    sink = open_file(tmp_path / FILE, manifest, rows=3)
    for k in range(12):
        p = np.array([0.9, 0.1]) if k >= 6 else np.array([0.2, 0.8])
        known: dict[str, Any] = {"Energy": "low" if k < 4 else "high", "Vigil": k >= 8, "Prox": 1}
        sink.write(
            Tick(
                k,
                k / 10,
                evidence={} if k == 10 else known,
                answers={"H": Answer("", ("H",), (("avoidance", "phototaxy"),), p)},
                draws={"Behavior": "patrol" if k < 9 else "recharge"},
            ),
            0,
        )
    sink.close()
    path = tmp_path / FILE
    assert states(path, "Behavior") == [(0, "patrol"), (9, "recharge")]
    assert states(path, "H") == [(0, "phototaxy"), (6, "avoidance")]
    assert states(path, "Energy") == [(0, "low"), (4, "high"), (10, ""), (11, "high")]
    assert states(path, "Vigil") == [(0, "False"), (8, "True"), (10, ""), (11, "True")]
    assert "/states/Prox" not in entities(path)
    assert set(rows(path, "/variables/Prox", "Scalars:scalars")) == set(range(12)) - {10}


def test_orders_and_the_link_have_their_places(tmp_path: Path) -> None:
    sink = open_file(tmp_path / FILE, {"program": "home", **synthetic.manifest()}, rows=3)
    for tick in synthetic.ticks(6):
        if tick.tick == 4:
            tick.raw["?"] = "noise"
        sink.write(tick, 0)
    sink.close()
    texts = rows(tmp_path / FILE, "/link", "Scalars:scalars")
    assert texts[3][1][0] > 20
    assert texts[4][1][1] == 5
    assert "/orders" in entities(tmp_path / FILE)


def test_the_services_state_has_a_lane_in_which_every_state_has_a_colour(tmp_path: Path) -> None:
    assert set(SERVICE_STATES) == {state.id for state in Lifecycle.states}
    sink = open_file(tmp_path / FILE, {"program": "home", **synthetic.manifest()}, rows=3, seconds=1.5)
    for tick in synthetic.ticks(30):
        tick.state = "degraded" if 4 <= tick.tick < 9 else "running"
        sink.write(tick, 0)
    sink.close()
    first, second = files(tmp_path)
    assert changes(first, SERVICE) == [(0, "running"), (4, "degraded"), (9, "running")]
    assert changes(second, SERVICE) == [(15, "running")], "each piece says how it begins"


def test_a_flame_is_drawn_where_it_burns(tmp_path: Path) -> None:
    candle = {"name": "candle", "kind": "flame", "pose": [-0.1, 1.2, 0.0], "height": 0.02, "radius": 0.006}
    arena = {"name": "one", "size": [1.0, 1.0], "shapes": [candle]}
    sink = open_file(tmp_path / FILE, {"program": "home", "world": arena}, rows=3)
    for tick in range(20):
        moved = {7: (0.6, 0.2, 0.0), 14: (-0.1, 1.2, 0.0)}.get(tick)
        sink.write(Tick(tick, tick / 10, moved={} if moved is None else {"candle": moved}), 0)
    sink.close()
    found = rows(tmp_path / FILE, "/world/flame/candle", "Transform3D:translation")
    assert sorted(found) == [0, 7, 14]
    assert found[7][1][0][:2] == pytest.approx((0.6, 0.2), abs=1e-6)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are counted in /proc")
def test_a_piece_that_is_finished_leaves_nothing_of_itself_behind(tmp_path: Path) -> None:
    def threads() -> int:
        return len(list(Path("/proc/self/task").iterdir()))

    sink = open_file(tmp_path / FILE, {"program": "home", **synthetic.manifest()}, rows=5, seconds=1.0)
    counts = []
    for tick in synthetic.ticks(140):
        if tick.tick % 10 == 5:
            counts.append(threads())
        sink.write(tick, 0)
    sink.close()
    assert len(files(tmp_path)) == 14
    assert counts[-1] <= counts[1] + 2, counts  # each piece that stayed would have four
