"""The experiments from the command line."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from khepera_hil.experiments.arenas import OBJECTS, beside, lamp_somewhere, pocket, pushable, written
from khepera_hil.experiments.figures import table
from khepera_hil.experiments.registry import EXPERIMENTS
from khepera_hil.experiments.section8 import PRESENTATIONS, TWINS, _order
from khepera_hil.teaching.view import BODY, nearest_point
from khepera_hil.world import World
from tests.recording.rrd import entities
from tests.runs.cli import khepera_hil

ASKED = ["push", "avoid", "follow", "phototaxy", "fusion", "home", "table1", "lesson3"]
ASKED += [f"fig{number}" for number in range(4, 12)]


def test_every_experiment_that_was_asked_for_is_there(tmp_path: Path) -> None:
    assert set(ASKED) <= set(EXPERIMENTS)
    listed = khepera_hil("paper", "--list", cwd=tmp_path)
    assert listed.code == 0
    for name in EXPERIMENTS:
        assert f"  {name} " in listed.out


def test_figures_are_printed_and_are_one_json_object(tmp_path: Path) -> None:
    names = ["lesson3", "fig5", "fig6", "fig9", "fig10", "lesson6", "fig11"]
    done = khepera_hil("paper", *names, "--json", cwd=tmp_path)
    assert done.code == 0, done.err
    assert json.loads(done.out) == done.result  # that, and nothing else
    figures = done.result["figures"]
    for figure in figures.values():
        assert set(figure) == {"value", "low", "high", "n", "target", "met"}
        assert figure["met"] is not False
    assert figures["fig6: most probable bearing of a light at 10 degrees"]["value"] == 10
    assert figures["lesson3: log2 of the joint's size, 36 x 512^8"]["value"] == pytest.approx(math.log2(36) + 72)
    for name in names:
        for path in done.result["experiments"][name]["files"]:
            assert (tmp_path / path).stat().st_size > 500
        # A recording with a layout of its own, and every figure in it.
        recording = tmp_path / f"runs/paper/{name}/{name}.rrd"
        reader = rr.chunk.RrdReader(str(recording))
        assert len(reader.recordings()) == len(reader.blueprints()) == 1
        page = text_of(recording, "/page")
        for figure in figures:
            if figure.startswith(f"{name}: "):
                assert figure.removeprefix(f"{name}: ").replace(" | ", " given ") in page
    assert (tmp_path / "runs/paper/fig9/fig9.svg").read_text().startswith("<svg")
    bars = entities(tmp_path / "runs/paper/fig9/fig9.rrd")
    assert {"/charts/0", "/charts/1", "/charts/2/avoidance", "/charts/2/phototaxy", "/charts/3"} <= bars
    assert any(path.startswith("/above/0/now") for path in entities(tmp_path / "runs/paper/fig11/fig11.rrd"))


def test_every_name_of_the_list_has_figures() -> None:
    """Of a whole campaign's results; here of few, or of none where it is computed."""
    for name in ASKED:
        experiment = EXPERIMENTS[name]
        if not experiment.cases([1]):
            assert experiment.report([], []).figures, name


def test_docs_have_the_computed_figures_as_they_are_printed() -> None:
    text = (Path(__file__).parents[2] / "docs/paper.md").read_text("utf-8")
    for experiment in EXPERIMENTS.values():
        if not experiment.cases([1]):
            for line in table(experiment.report([], []).figures)[2:]:
                assert line in text, line


def text_of(recording: Path, entity: str) -> str:
    chunks = rr.chunk.RrdReader(str(recording)).stream().filter(content=entity)
    return "".join(
        str(text)
        for chunk in chunks
        if "TextDocument:text" in (batch := chunk.to_record_batch()).schema.names
        for text in batch["TextDocument:text"].to_pylist()
    )


def test_trials_are_run_shown_and_repeat(tmp_path: Path) -> None:
    first = khepera_hil("paper", "phototaxy", "--seeds", "1", "--json", cwd=tmp_path)
    assert first.code == 0, first.err
    files = first.result["experiments"]["phototaxy"]["files"]
    assert [Path(path).name for path in files] == ["run.rrd", "above.svg", "phototaxy.rrd", "phototaxy.svg"]
    assert {"/above/0/way", "/above/0/robot", "/page"} <= entities(tmp_path / files[2])
    fresh = khepera_hil("paper", "phototaxy", "--seeds", "1", "--json", "--fresh", "--no-show", cwd=tmp_path)
    assert fresh.result["figures"] == first.result["figures"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "say which experiment"),
        (["chess"], "there is no experiment 'chess'"),
        (["push", "--seeds", "0"], "'0' is no number from 1"),
    ],
)
def test_mistakes_are_told(tmp_path: Path, words: list[str], said: str) -> None:
    done = khepera_hil("paper", *words, cwd=tmp_path)
    assert done.code == 2
    assert said in done.err


@pytest.mark.parametrize("name", list(OBJECTS))
@pytest.mark.parametrize("side", [1, -1])
def test_the_robot_starts_beside_every_object(name: str, side: int) -> None:
    for seed in range(3):
        with written(beside(OBJECTS[name], side, np.random.default_rng([seed, 1]))) as path:
            world = World(path, seed)
        shape = next(shape for shape in world.shapes() if shape["name"] == name)
        x, y, theta = world.pose()
        px, py = nearest_point(shape, tuple(shape["pose"]), (x, y, theta))
        gap = math.hypot(px - x, py - y) - BODY - (0 if "polygon" in shape else shape["radius"])
        assert 0.0195 <= gap <= 0.0325
        # At its side: the thing lies across the robot's heading, to the right when side is 1.
        across = math.cos(theta) * (py - y) - math.sin(theta) * (px - x)
        assert -side * across > 0.9 * math.hypot(px - x, py - y)


def test_the_other_arenas_can_be_furnished() -> None:
    for seed in range(5):
        chance = np.random.default_rng(seed)
        thing = {"shape": "disc", "radius_mm": 25, "height_mm": 40, "mass_g": 40}
        for text in (pushable(thing, chance), lamp_somewhere(chance)[0], pocket(200, 120, 30, chance)):
            with written(text) as path:
                World(path, seed)


def test_a_perfect_robot_knows_all_objects_but_the_twins() -> None:
    """The presentations of table 1 with tours that are always the same: 13 of 13, and all recognised."""
    tours: dict[str, list[dict[str, int] | None]] = {
        name: [{"Nlt": 0, "Nrt": 4, "Per": 400 + 40 * (place - (name == TWINS[1])), "Lrl": 50}] * PRESENTATIONS
        for place, name in enumerate(OBJECTS)
    }
    said = _order(3, tours)
    met: set[str] = set()
    for name, taken in said:
        if name not in TWINS:
            assert taken == (name if name in met else "new")
        met.add(name)
    assert len(said) == 75
    # The one of the two that came first stands for both.
    twins = [taken for name, taken in said if name in TWINS]
    assert twins[0] == "new"
    assert len(set(twins[1:])) == 1
