"""Whole nights on the emulator: every byte of them through the serial line, in simulated time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brp.programs.behavior import behavior
from khepera_hil.__main__ import outcome
from khepera_hil.controllers.watchman import Watchman
from khepera_hil.errors import WorldError
from khepera_hil.experiments import weathercock
from khepera_hil.experiments.agreement import Agreement
from khepera_hil.experiments.nights import night, short_night
from khepera_hil.experiments.tally import resolved
from khepera_hil.experiments.trial import drive
from khepera_hil.world import World


def test_the_film_begins_with_an_object_that_is_identified() -> None:
    said: list[tuple[float, str]] = []

    def watch(tick: Any, trial: Any) -> bool:
        said.extend((tick.t, text) for _, text in tick.events)
        return any("new object" in text for _, text in tick.events)

    trial = drive(Watchman(), world="watchman", seed=8, duration=60, watch=watch, options={"scenario": "night"})
    assert trial.stopped, said
    assert all(tick.evidence for tick in trial.ticks)
    assert {tick.draws["Behavior"] for tick in trial.ticks} <= {"recognition", "patrol"}
    assert trial.ticks[-1].evidence["Tour"] == "done"
    assert trial.score["contacts_over_half_second"] == 0


FILM = [  # of section 10.5: what must be said, or which behavior begun, in this order
    "a new object",
    "recognition",
    "fire",
    "no fire: three blows changed nothing",
    "patrol",
    "fire",
    "the fire is out",
    "patrol",
    "something moves",
    "recharge",
    "idle",
    "patrol",
]


def test_the_film_of_the_papers_results_is_played_to_its_end() -> None:
    """Each scene in its turn; what comes between does no harm. The run ends with the last of them."""
    left = list(FILM)
    seen: list[tuple[float, str]] = []
    before = ""

    def watch(tick: Any, trial: Any) -> bool:
        nonlocal before
        trial.ticks.clear()
        behavior = str(tick.draws["Behavior"])
        new = [text for _, text in tick.events] + ([behavior] if behavior != before else [])
        before = behavior
        for text in new:
            seen.append((tick.t, text))
            if left and text.startswith(left[0]):
                del left[0]
        return not left

    trial = drive(Watchman(), world="watchman", seed=8, duration=520, watch=watch, options={"scenario": "night"})
    assert not left, seen
    assert trial.score["fires_put_out"] == 1
    assert trial.score["alarms"] >= 1
    assert trial.score["contact_longest_s"] <= 3


def test_a_watchman_without_turrets_keeps_watch_as_well_as_it_can() -> None:
    trial = drive(Watchman(), world="watchman", seed=4, duration=25, options={"turrets": "none"})
    assert all(tick.evidence for tick in trial.ticks)
    assert {tick.evidence["Energy"] for tick in trial.ticks} == {"high"}
    said = [text for tick in trial.ticks for _, text in tick.events]
    assert sum("no camera" in text for text in said) == 1
    assert sum("measures no battery" in text for text in said) == 1
    assert not any("not acknowledged" in text for text in said)


def flame(folder: Path) -> str:
    path = folder / "flame.toml"
    path.write_text(
        'title = "a candle ahead"\nworld = "empty"\n[start]\nat_mm = [500, 500]\nheading_deg = 45\n'
        '[[event]]\nat_s = 0\nkind = "order"\norder = "vigil"\n'
        '[[event]]\nat_s = 0\nkind = "fire"\nname = "fire"\nat_mm = [650, 650]\n'
    )
    return str(path)


def test_a_candle_ahead_is_told_approached_and_blown_out(tmp_path: Path) -> None:
    told: list[str] = []

    def watch(tick: Any, trial: Any) -> bool:
        told.extend(text for _, text in tick.events if "fire" in text)
        return "the fire is out" in told

    trial = drive(
        Watchman(), world="empty", seed=1, duration=90, watch=watch, options={"scenario": flame(tmp_path)}
    )
    assert told[0] == "fire"
    assert told[-1] == "the fire is out"
    assert trial.score["fires_put_out"] == 1
    assert any(tick.raw.get("W") == "w" for tick in trial.ticks)


def test_a_run_of_the_command_repeats_and_its_log_can_be_asked_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    logs = []
    for name in ("one", "two"):
        words = ["--program", "watchman", "--scenario", "night", "--seed", "4", "--fast", "--duration", "6"]
        assert outcome([*words, "--runs", str(tmp_path / name), "--json"]) == 0
        folder = Path(json.loads(capsys.readouterr().out.splitlines()[-1])["run"])
        rows = [json.loads(line) for line in (folder / "ticks.jsonl").read_text().splitlines()]
        logs.append([{k: v for k, v in row.items() if k not in ("work_ms", "late_ms", "wall")} for row in rows])
    assert logs[0] == logs[1]
    assert len(logs[0]) == 60
    assert outcome(["replay", str(folder)]) == 0
    assert "the same" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--program", "home", "--decide", "early"], "about --program watchman"),
        (["--program", "watchman", "--decide", "soon"], "neither late nor early"),
        (["--program", "watchman", "--decide", "Move", "--memory", "whole"], "--decide does not go with it"),
        (["--program", "watchman", "--stay", ".99", "--memory", "whole"], "--stay does not go with it"),
        (["--program", "watchman", "--stay", "2"], "a probability"),
        (["--program", "watchman", "--unknown", "Prox"], "no variable that could be unknown"),
    ],
)
def test_what_does_not_fit_is_one_sentence(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert outcome([*words, "--runs", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1


def test_a_start_that_is_taken_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "start.toml"
    for at, why in (("[430, 420]", "'table' is there"), ("[3000, 40]", "not on the floor")):
        path.write_text(f'title = "t"\nworld = "watchman"\n[start]\nat_mm = {at}\n')
        with pytest.raises(WorldError, match=why):
            World("watchman", 1, str(path))


def test_nights_by_chance_are_worlds_and_repeat(tmp_path: Path) -> None:
    for seed in range(6):
        for world, plan in (
            ("watchman", night(seed, 3600, "watchman")),
            ("furnished", short_night(seed, "furnished")),
        ):
            (tmp_path / "night.toml").write_text(plan.text)
            World(world, seed, str(tmp_path / "night.toml"))
            assert plan.calls or "real = true" in plan.text
    assert night(1, 3600, "watchman") == night(1, 3600, "watchman")
    assert night(1, 3600, "watchman") != night(2, 3600, "watchman")
    assert short_night(1, "furnished") != short_night(3, "furnished")


def test_the_world_of_a_long_night_is_no_larger_than_that_of_a_short_one() -> None:
    names = {word for word in night(1, 36000, "watchman").text.split("\n") if word.startswith("name")}
    assert len(names) <= 2 * 12 + 3 * 3


def test_a_mover_counts_that_moves_in_the_picture() -> None:
    assert resolved([-20.0, -17.0, -15.0, -12.0])
    assert not resolved([17.0, 19.0, 21.0, 25.0])  # an edge at the rim
    assert not resolved([3.0, 3.5, 4.0, 4.5, 5.0])  # comes straight on
    assert not resolved([0.0, 9.0])


def test_draws_that_agree_pass_the_chi_square_and_others_do_not() -> None:
    rng = np.random.default_rng(5)
    fair, loaded = Agreement(), Agreement()
    for _ in range(1500):
        p = rng.dirichlet(np.ones(4))
        fair.add(p, int(rng.choice(4, p=p)))
        loaded.add(p, int(rng.choice(4, p=0.8 * p + 0.2 * np.array([1, 0, 0, 0]))))
    from scipy.stats import chi2

    assert chi2.sf(*fair.chi2()) > 0.01
    assert chi2.sf(*loaded.chi2()) < 1e-4


def test_how_often_it_changes_its_mind() -> None:
    """13 a minute with low energy, as printed; lesson 9: 108 entries against 2304."""
    assert weathercock.changes(behavior, "low") == pytest.approx(13.04, abs=0.01)
    assert weathercock.changes(behavior, "high") == pytest.approx(0, abs=1e-9)
    assert weathercock.entries() == (108, 2304)
