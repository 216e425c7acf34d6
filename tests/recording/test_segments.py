"""Long runs, and words over time, in the viewer's files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from khepera_hil.recording import Answer, Tick
from khepera_hil.viewer import FILE, files, open_file
from khepera_hil.viewer.check import damage
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
    return [
        (tick, value[0] if value else "")
        for tick, (_, value) in sorted(rows(path, f"/states/{name}", "StateChange:state").items())
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
