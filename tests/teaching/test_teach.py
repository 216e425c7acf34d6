"""Lessons from the command line, and what is made of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from brp.data import names, shipped, shipped_file
from brp.programs.base import Px
from brp.programs.fusion import L
from brp.programs.obstacle import Dir, Prox, Vrot, obstacle
from brp.programs.phototaxy import pi_phototaxy1
from brp.store import load_data
from khepera_hil.teaching.lesson import BEHAVIORS, Tick
from tests.runs.cli import khepera_hil
from tests.teaching.arenas import pushing


def lesson(folder: Path, *more: str | Path, behavior: str = "avoid", out: str = "one.json") -> dict[str, Any]:
    words = ["teach", behavior, "--fast", "--seed", "5", "--duration", "10", "--out", out, "--json", *more]
    done = khepera_hil(*words, cwd=folder)
    assert done.code == 0, done.err
    return done.result


def test_a_lesson_is_a_run_and_a_data_set_that_say_the_same(tmp_path: Path) -> None:
    result = lesson(tmp_path)
    name, columns = load_data(tmp_path / "one.json", [Tick, Vrot, Dir, Prox, *Px, *L])
    assert name == "delta-avoid"
    assert columns["Tick"] == list(range(100))
    ticks = [json.loads(row) for row in (tmp_path / result["run"] / "ticks.jsonl").read_text().splitlines()]
    assert [tick["draws"]["Vrot"] for tick in ticks] == columns["Vrot"]
    assert [tick["evidence"]["Dir"] for tick in ticks] == columns["Dir"]
    raw = [tick["raw"]["N"].split(",")[1:] for tick in ticks]
    assert [[columns[v.name][k] for v in Px] for k in range(100)] == [[int(x) for x in row] for row in raw]
    # What was steered is what the wheels were told: the difference of the two is twice Vrot (section 4.1).
    assert all(tick["command"][0] - tick["command"][1] == 2 * tick["draws"]["Vrot"] for tick in ticks)


def test_the_same_lesson_twice_is_the_same_data_set(tmp_path: Path) -> None:
    lesson(tmp_path)
    lesson(tmp_path, out="again.json")
    assert (tmp_path / "one.json").read_bytes() == (tmp_path / "again.json").read_bytes()


def test_what_was_taught_can_be_joined_cut_saved_and_driven_by(tmp_path: Path) -> None:
    run = lesson(tmp_path)["run"]
    words = ["identify", "obstacle", "--data", "one.json@2-5", "one.json@5-", run]
    done = khepera_hil(
        *words, "--join", "all.json", "--out", "d.json", "--name", "delta-mine", "--json", cwd=tmp_path
    )
    assert done.code == 0, done.err
    assert done.result["data"] == 30 + 50 + 100
    learnt = done.result["terms"]["P(Vrot | Prox Dir)"]
    assert learnt["visited"] + learnt["unvisited"] == 21 * 16
    assert sum(cell["count"] for cell in learnt["cells"]) == 180
    name, columns = load_data(tmp_path / "all.json", [Vrot, Dir, Prox])
    assert name == "delta-mine"
    assert obstacle.identify(columns, name=name).ask is not None
    driven = khepera_hil(
        "--program", "avoid", "--data", "d.json", "--fast", "--duration", "3", "--json", cwd=tmp_path
    )
    assert driven.code == 0, driven.err
    manifest = json.loads((tmp_path / driven.result["run"] / "manifest.json").read_text())
    assert manifest["setting"] == {"unknown": [], "data": "d.json", "calibration": None}
    assert "delta-mine" in manifest["questions"][0]["name"]


def test_a_push_that_was_taught_pushes_and_does_without_prox(tmp_path: Path) -> None:
    """E5.3: the same description, another question, chosen at the command line."""
    arena = pushing(tmp_path)
    lesson(tmp_path, "--world", arena, "--duration", "25", behavior="push")
    for unknown in ([], ["--unknown", "Prox"]):
        words = ["--program", "push", "--data", "one.json", "--seed", "7", *unknown]
        done = khepera_hil(*words, "--world", arena, "--fast", "--duration", "25", "--json", cwd=tmp_path)
        assert done.code == 0, done.err
        folder = tmp_path / done.result["run"]
        question = json.loads((folder / "manifest.json").read_text())["questions"][0]["name"]
        known = "Dir" if unknown else "Prox Dir"
        assert question == f"P(Vrot | {known} delta-push pi-obstacle)"
        ticks = [json.loads(row) for row in (folder / "ticks.jsonl").read_text().splitlines()]
        places = [tick["moved"]["object"] for tick in ticks if "object" in tick["moved"]]
        assert places[-1][0] - 0.3 > 0.2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["teach", "juggle", "--out", "x.json"], "there is no behavior to teach 'juggle'"),
        (["teach", "push", "--port", "/dev/ttyS9", "--out", "x.json"], "--teacher scripted sees the arena"),
        (["teach", "push", "--teacher", "keyboard", "--out", "x.json"], "needs a terminal"),
        (["teach", "push", "--fast", "--teacher", "keyboard", "--out", "x.json"], "too quick for a hand"),
        (["teach", "push", "--out", "no/x.json"], "there is no folder"),
        (["teach", "push", "--world", "empty", "--fast", "--out", "x.json"], "nothing to push"),
        (["teach", "phototaxy", "--world", "empty", "--fast", "--out", "x.json"], "no lamp"),
        (["identify", "obstacle", "--data", "nothing.json"], "there is no data set 'nothing.json'"),
        (["identify", "phototaxy", "--data", "delta-push", "--force"], "0 data"),
        (["identify", "chess", "--data", "delta-push"], "there is no specification 'chess'"),
        (["identify", "obstacle", "--data", "delta-push@90-95"], "no datum of delta-push lies in these seconds"),
        (["identify", "obstacle", "--data", "."], "is no recorded run"),
        (["--program", "home", "--data", "delta-push"], "home is not taught"),
        (["--program", "push", "--unknown", "Theta1"], "--unknown Theta1: the question of push knows Prox, Dir"),
        (["--program", "phototaxy", "--unknown", "Theta1"], "nothing that it knows"),
    ],
)
def test_every_mistake_is_one_sentence(tmp_path: Path, words: list[str], said: str) -> None:
    done = khepera_hil(*words, cwd=tmp_path)
    if said == "0 data":  # every shipped lesson has all that any behavior sees
        assert done.code == 0
        return
    assert done.code == 2
    assert said in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not list(tmp_path.glob("*.json"))


def test_the_weight_of_avoidance_is_learnt_from_homing_by_hand(tmp_path: Path) -> None:
    """P(H | Prox), and H is in no datum: far from things the light leads, close to them avoidance counts more."""
    lesson(tmp_path, "--duration", "60", "--seed", "3", behavior="home")
    done = khepera_hil("identify", "home", "--data", "one.json", "--out", "d.json", "--json", cwd=tmp_path)
    assert done.code == 0, done.err
    cells = done.result["terms"]["P(H | Prox)"]["cells"]
    assert sum(cell["count"] for cell in cells) == 600
    assert cells[0]["avoidance"] < 0.3 < cells[15]["avoidance"]


def test_a_data_set_is_not_overwritten_by_accident(tmp_path: Path) -> None:
    lesson(tmp_path)
    before = (tmp_path / "one.json").read_bytes()
    done = khepera_hil("teach", "push", "--fast", "--out", "one.json", cwd=tmp_path)
    assert done.code == 2
    assert "is there already" in done.err
    assert (tmp_path / "one.json").read_bytes() == before


@pytest.mark.parametrize(
    "name", ["delta-push", "delta-avoid", "delta-follow", "delta-follow-left", "delta-phototaxy"]
)
def test_the_shipped_data_sets_are_twenty_to_thirty_seconds_of_driving(name: str) -> None:
    behavior = BEHAVIORS[name.removeprefix("delta-")]
    _, columns = load_data(shipped_file(name), [Tick, *behavior.variables])
    assert 200 <= len(columns["Vrot"]) <= 300
    assert shipped(name, behavior.specification).name == name
    # Somebody drove: the stick was moved, and more than one situation met.
    assert len(set(columns["Vrot"])) > 5
    assert behavior.specification in (obstacle, pi_phototaxy1)
    assert name in names()


def test_a_run_by_taught_data_can_be_asked_again(tmp_path: Path) -> None:
    lesson(tmp_path)
    words = ["--program", "avoid", "--data", "one.json", "--unknown", "Prox", "--fast", "--duration", "10"]
    done = khepera_hil(*words, "--seed", "2", "--json", cwd=tmp_path)
    assert done.code == 0, done.err
    again = khepera_hil("replay", done.result["run"], cwd=tmp_path)
    assert again.code == 0, again.out + again.err
    lesson(tmp_path, "--force", "--seed", "6")  # other data: other answers
    other = khepera_hil("replay", done.result["run"], cwd=tmp_path)
    assert other.code != 0
