"""The layout inside the file, seen by a real viewer without a screen: every panel shows without complaint."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brp.programs.watchman import watchman
from khepera_hil.recording import Answer, Tick
from khepera_hil.viewer import ROWS_FAST, open_file
from khepera_hil.viewer.picture import headless
from khepera_hil.viewer.program import software_rendering
from tests.recording import synthetic

pytestmark = pytest.mark.skipif(
    not software_rendering(),
    reason="no viewer without a screen here: it needs mesa-vulkan-drivers and libvulkan1",
)


def look(path: Path, at: float) -> tuple[bytes, list[str], set[str]]:
    """Picture, names of the panels, timelines; no panel may complain."""
    with headless([path], (1600, 900)) as client:
        client.set_time("run_time", duration=at, play_state="paused")
        picture = client.take_screenshot()
        state = client.get_state()
    assert picture.startswith(b"\x89PNG")
    assert [(view.name, view.reports) for view in state.views if view.reports] == []
    return picture, [view.name for view in state.views], {line.name for line in state.recordings[0].timelines}


@pytest.mark.parametrize("world", [True, False])
def test_every_panel_of_the_layout_shows_without_complaint(tmp_path: Path, world: bool) -> None:
    path = tmp_path / "run.rrd"
    sink = open_file(path, {"program": "home", "seed": 7, **synthetic.manifest(world)}, rows=ROWS_FAST)
    for tick in synthetic.ticks(60, world=world):
        sink.write(tick, 0)
    sink.close()
    _, names, timelines = look(path, 4.0)
    assert timelines == {"run_time", "tick", "wall_clock"}
    for start in (
        "Vrot (red: drawn)",
        "H: 0 avoidance, 1 phototaxy",
        "Events",
        "States",
        "Wheels",
        "Proximity",
        "Vrot, the last 30 s",
        "Arena furnished" if world else "Robot",
    ):
        assert any(name.startswith(start) for name in names), names


def test_a_program_of_words_and_joint_draws_shows_too(tmp_path: Path) -> None:
    """The watchman's question, whose variables are words, truths and numbers of all sizes."""
    path, rng = tmp_path / "run.rrd", np.random.default_rng(3)
    shape = (
        watchman.name,
        tuple(v.name for v in watchman.searched),
        tuple(tuple(v.values) for v in watchman.searched),
    )
    manifest = {
        "program": "watchman",
        "questions": [{"key": "Motors", "name": shape[0], "variables": shape[1], "values": shape[2], "main": True}],
        "evidence": {v.name: list(v.values) for v in watchman.known if len(v) < 100},
    }
    sink = open_file(path, manifest, rows=ROWS_FAST)
    for k in range(20):
        evidence: dict[str, Any] = {v.name: v.values[int(rng.integers(len(v)))] for v in watchman.known}
        answer = watchman(**{v.keyword: evidence[v.name] for v in watchman.known})
        draws = dict(zip(shape[1], answer.draw(rng), strict=True))
        sink.write(Tick(k, k / 10, evidence=evidence, answers={"Motors": Answer(*shape, answer.p)}, draws=draws), 0)
    sink.close()
    _, names, _ = look(path, 1.0)
    assert any(name.startswith("Vtrans") for name in names)


def test_review_makes_the_picture_of_a_run_at_a_time(tmp_path: Path, copy: Path, say: Callable[..., Any]) -> None:
    said = say("review", copy, "--picture", tmp_path / "at.png", "--at", "6", "--size", "1280x720")
    assert said.code == 0, said.err
    assert "there is no viewer's file; making it anew" in said.err
    assert (tmp_path / "at.png").read_bytes()[16:24] == (1280).to_bytes(4, "big") + (720).to_bytes(4, "big")
    again = say("review", copy, "--picture", tmp_path / "end.png", "--size", "1280x720")
    assert (again.code, again.err) == (0, ""), "now it is there"
    assert (tmp_path / "end.png").read_bytes() != (tmp_path / "at.png").read_bytes()


def test_where_nothing_can_draw_it_says_what_is_needed(
    tmp_path: Path, copy: Path, monkeypatch: pytest.MonkeyPatch, say: Callable[..., Any]
) -> None:
    nothing = {"VK_ICD_FILENAMES": "/nothing.json", "VK_DRIVER_FILES": "/nothing.json"}
    monkeypatch.setattr("khepera_hil.viewer.program.software_rendering", lambda: nothing)
    said = say("review", copy, "--picture", tmp_path / "x.png")
    assert said.code == 1
    assert "mesa-vulkan-drivers" in said.err
    assert not (tmp_path / "x.png").exists()
