"""Asking again: the same program answers the same, to the bit; what is not the same is named."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brp import Question
from brp.programs.obstacle import Dir, Prox, Vrot, obstacle
from brp.programs.watchman import watchman
from brp.store import save, save_data
from khepera_hil.controllers import PROGRAMS, Decision
from khepera_hil.otherwise import with_program
from khepera_hil.perception import Need, Readings
from khepera_hil.reading import Run, find
from khepera_hil.recording import LOG, Answer, Recording, Tick
from khepera_hil.replay import TOLERANCE, answered, replay
from tests.recording.test_recording import STARTED
from tests.test_service import at_the_bench


def rewrite(folder: Path, change: Callable[[dict[str, Any]], None]) -> Run:
    """The run with every row changed."""
    rows = [json.loads(line) for line in (folder / LOG).read_text().splitlines()]
    for row in rows:
        change(row)
    (folder / LOG).write_text("".join(json.dumps(row) + "\n" for row in rows))
    return find(folder, folder.parent)


def questions(program: str) -> dict[str, Question]:
    return dict(PROGRAMS[program][1]().questions)


@pytest.mark.parametrize("name", ["home-8-1", "home-9-3", "avoid-4-4"])
def test_a_run_asked_again_answers_and_draws_as_it_did_to_the_bit(
    runs: Path, name: str, say: Callable[..., Any]
) -> None:
    said = say("replay", name, "--runs", runs, "--json")
    result = json.loads(said.out)
    assert said.code == 0
    assert result["same"]
    assert result["ticks"] == 120
    for asked in result["questions"].values():
        assert asked["answers"] == asked["same"] == 120
    assert result["questions"]["Vrot"]["draws"] == 120
    assert say("replay", name, "--runs", runs).out.splitlines()[-1] == "the same"


def test_the_first_tick_and_distribution_that_differ_are_named(copy: Path, say: Callable[..., Any]) -> None:
    def change(row: dict[str, Any]) -> None:
        if row["tick"] >= 40:
            row["answers"]["H"] = "0" * 16
            row["sketch"]["H"] += 1e-3
        if row["tick"] == 50:
            row["draws"]["Vrot"] = -row["draws"]["Vrot"] - 1

    rewrite(copy, change)
    said = say("replay", copy)
    assert said.code == 1
    assert "first at tick 40 (4 s) in P(H | Prox pi-home)" in said.out
    assert "the sketches differ by 0.001" in said.out
    lines = {line.split(":")[0].strip(): line for line in said.out.splitlines()}
    assert lines["P(H | Prox pi-home)"].endswith("80 different")
    assert lines["P(Vrot | Dir Prox Theta1 pi-home)"].endswith("1 different")


def test_last_bits_are_within_the_tolerance_and_said_to_be_so(copy: Path, say: Callable[..., Any]) -> None:
    def change(row: dict[str, Any]) -> None:
        row["answers"]["Vrot"] = "0" * 16
        row["sketch"]["Vrot"] += TOLERANCE / 10

    rewrite(copy, change)
    said = say("replay", copy, "--json")
    assert said.code == 0
    asked = json.loads(said.out)["questions"]["Vrot"]
    assert (asked["same"], asked["near"], asked["different"]) == (0, 120, 0)


def test_evidence_that_is_no_longer_known_or_possible_is_a_difference(copy: Path) -> None:
    def change(row: dict[str, Any]) -> None:
        if row["tick"] == 7:
            row["evidence"]["Prox"] = 99
        if row["tick"] == 9:
            del row["evidence"]["Dir"]

    found = replay(rewrite(copy, change), questions("home"))
    assert found.asked["H"].differs is not None
    assert found.asked["H"].differs[0] == 7
    assert "Prox = 99" in found.asked["H"].differs[2]
    assert found.asked["Vrot"].different == 2
    assert found.asked["Vrot phototaxy"].differs is None, "it knows neither of them"


def test_another_program_under_the_same_name_is_seen(home: Run) -> None:
    changed = {**questions("home"), "Vrot": questions("avoid")["Vrot"]}
    del changed["H"]
    found = replay(home, changed)
    assert not found.same
    assert found.asked["H"].differs is not None
    assert found.asked["Vrot"].different > 100


def test_the_answers_of_a_run_are_made_again_from_its_log(home: Run) -> None:
    rows = list(home.rows())
    ticks = list(answered(home, questions("home")))
    assert [tick.tick for tick in ticks] == list(range(120))
    for tick, row in zip(ticks, rows, strict=True):
        assert {key: answer.digest() for key, answer in tick.answers.items()} == row["answers"]


def test_a_joint_question_of_the_watchman_is_asked_again_too(tmp_path: Path) -> None:
    """Three variables drawn together, an impossible evidence among the ticks, words and truths as evidence."""
    rng = np.random.default_rng(3)
    shape = (
        watchman.name,
        tuple(v.name for v in watchman.searched),
        tuple(tuple(v.values) for v in watchman.searched),
    )

    def ticks() -> Iterator[Tick]:
        for k in range(12):
            evidence = {v.name: v.values[int(rng.integers(len(v)))] for v in watchman.known}
            answer = watchman(**{v.keyword: evidence[v.name] for v in watchman.known})
            u = float(rng.random())
            draws = dict(zip(shape[1], answer.at(u), strict=True))
            yield Tick(
                k,
                k / 10,
                evidence=evidence,
                answers={"Motors": Answer(*shape, answer.p)},
                u={"Motors": u},
                draws=draws,
            )

    manifest = {
        "questions": [{"key": "Motors", "name": shape[0], "variables": shape[1], "values": shape[2], "main": True}],
        "evidence": {v.name: list(v.values) for v in watchman.known},
    }
    recording = Recording.create(tmp_path, program="watchman", seed=1, manifest=manifest, started=STARTED)
    for tick in ticks():
        recording.write(tick)
    recording.close({})
    found = replay(find(recording.folder, tmp_path), {"Motors": watchman})
    assert found.same, found.first
    assert found.asked["Motors"].answers == found.asked["Motors"].same == found.asked["Motors"].draws == 12


def test_another_program_on_the_same_readings_stands_beside_it(runs: Path, say: Callable[..., Any]) -> None:
    said = say("replay", "home-8-1", "--runs", runs, "--program", "avoid", "--every", "2")
    assert said.code == 0
    lines = said.out.splitlines()
    assert lines[0].split() == ["home,", "as", "recorded", "avoid"]
    assert len([line for line in lines if " s  " in line]) == 6
    assert any("the distributions are apart by" in line for line in lines)
    result = json.loads(say("replay", "home-8-1", "--runs", runs, "--program", "avoid", "--json").out)
    assert result["ticks"] == 120
    assert 0 < result["same_draws"]["Vrot"] < 120
    assert 0 < result["apart"]["Vrot"] < 1


def test_the_same_program_on_the_same_readings_does_the_same(runs: Path, say: Callable[..., Any]) -> None:
    """Perception included: the evidence is made anew from the robot's answers."""
    result = json.loads(say("replay", "home-9-3", "--runs", runs, "--program", "home", "--json").out)
    assert result["first"] is None
    assert result["same_draws"] == {"Vrot": 120}
    assert result["same_commands"] == 120


def test_other_data_reach_down_to_the_description_that_they_fit(
    runs: Path, tmp_path: Path, say: Callable[..., Any]
) -> None:
    """Of home, which has no parameters of its own, they teach the avoidance that it calls."""
    rows = [
        {"Dir": d, "Prox": p, "Vrot": 10 if d in range(1, 11) else -10} for d in Dir.values for p in Prox.values
    ]
    rows += rows
    save_data(rows, [Dir, Prox, Vrot], tmp_path / "push.json", name="delta-push")
    save(obstacle.identify(rows, name="delta-push"), tmp_path / "description.json")
    found = []
    for name in ("push.json", "description.json"):
        said = say("replay", "home-8-1", "--runs", runs, "--data", tmp_path / name, "--json")
        assert said.code == 0, said.err
        found.append(json.loads(said.out))
    assert found[0] | {"beside": ""} == found[1] | {"beside": ""}
    assert found[0]["apart"]["H"] == 0
    assert found[0]["apart"]["Vrot phototaxy"] == 0
    assert found[0]["apart"]["Vrot avoidance"] > 0.3
    assert found[0]["apart"]["Vrot"] > 0


class Curious:
    """Needs one reading of every kind, and keeps what it was given."""

    name = "curious"
    needs = ("N", "O", Need("H"), Need("K"), Need("E"), Need("I", (3,)), Need("T", (2, "O"), every=3))
    decides = "Vrot"

    def __init__(self) -> None:
        self.questions = {"Vrot": questions("avoid")["Vrot"]}
        self.given: list[Readings] = []

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        self.given.append(readings)
        answer = self.questions["Vrot"](Dir=0, Prox=0)
        u = float(rng.random())
        return Decision({"Dir": 0, "Prox": 0}, {"Vrot": answer}, {"Vrot": u}, {"Vrot": answer.at(u)}, 1, 1)


def test_a_program_that_reads_all_that_can_be_read_gets_all_of_it_again(tmp_path: Path) -> None:
    then, now = Curious(), Curious()
    bench = at_the_bench(tmp_path, then)
    bench.robot.answers |= {b"I,3": b"i,512\r\n", b"T,2,O": b"t,2,o,31\r\n"}
    bench.service.connect()
    bench.service.run(bench.recording, duration=1.2)
    bench.recording.close({})
    run = find(bench.recording.folder, tmp_path)
    again = list(with_program(run, now))
    assert len(then.given) == 12
    assert now.given == then.given
    kinds = {name[0] for readings in then.given for name in readings.answers}
    assert kinds == {"H", "K", "E", "I", "T"}
    assert [tick.draws for tick in again] == [tick.draws for tick in run.ticks()]


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (["--program", "fly"], 2, "no program 'fly'"),
        (["--program", "avoid", "--data", "x"], 2, "one of them at a time"),
        (["--data", "nowhere.json"], 2, "nowhere.json cannot be read"),
        (["--data", "other.json"], 2, "fits none of what the program has learnt"),
        (["--every", "-1"], 2, "seconds"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_a_sentence(
    copy: Path, words: list[str], code: int, sentence: str, say: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(copy)
    Path("other.json").write_text('{"format": "something else"}')
    said = say("replay", copy, *words)
    assert said.code == code
    assert sentence in said.err
    assert said.err.count("\n") == 1


def test_a_program_that_is_no_more_is_told(copy: Path, say: Callable[..., Any]) -> None:
    manifest = json.loads((copy / "manifest.json").read_bytes())
    (copy / "manifest.json").write_text(json.dumps(manifest | {"program": "sleep"}))
    said = say("replay", copy)
    assert said.code == 2
    assert "'sleep', which this version does not have" in said.err
