"""Tables 2 to 7 learnt from a watchman's runs: by what it drew, and by an operator's word."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brp import P
from brp.programs.base import at_base
from brp.programs.behavior import TABLES, Behavior, Behavior_t_1, Energy, deciding, pi_behavior_taught
from khepera_hil.commands import identify
from khepera_hil.commands import run as run_command
from khepera_hil.controllers.base import Setting
from khepera_hil.controllers.watchman import Watchman
from khepera_hil.errors import UsageError
from khepera_hil.experiments.trial import Trial, drive
from khepera_hil.reading import read_ticks
from khepera_hil.recording import Tick
from khepera_hil.teaching.behaviors import FEWEST, enough, said
from khepera_hil.teaching.dataset import data_set, learnt, taught
from tests.runs.cli import khepera_hil

VARIABLES = learnt(pi_behavior_taught)

WORDS = {20: "patrol", 70: "recharge", 110: "patrol", 150: "homing", 190: "free"}
"""What the operator says at which tick."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that is drawn, then labelled, then drawn again."""
    runs = tmp_path_factory.mktemp("runs")
    watchman = Watchman(Setting(labels=True))
    watchman.order("vigil on")

    def watch(tick: Tick, trial: Trial) -> bool:
        if tick.tick in WORDS:
            watchman.order(f"behavior {WORDS[tick.tick]}")
        return False

    drive(watchman, world="furnished", seed=3, duration=24.0, watch=watch, record=runs)
    (folder,) = runs.iterdir()
    return folder


@pytest.fixture(scope="module")
def rows(run: Path) -> list[dict[str, Any]]:
    return list(read_ticks(run))


def test_an_operators_word_is_what_behavior_is_and_takes_no_number(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        number = row["tick"]
        last = max((at for at in WORDS if at < number), default=None)
        word = None if last is None or WORDS[last] == "free" else WORDS[last]
        assert said(row["evidence"]) is (word is not None)
        if word is not None:
            assert row["draws"]["Behavior"] == word
            assert "Behavior" not in row["u"]
        else:
            assert row["u"]["Behavior"] < 1
        assert row["draws"]["Behavior"] in Behavior.values
    # A robot that is told to recharge away from its base drives home, whatever pi-behavior says of a full battery.
    assert {row["draws"]["Move"] for row in rows if 80 < row["tick"] <= 110} == {"home"}
    assert {row["evidence"]["Energy"] for row in rows} <= {"high", "very-high"}


def test_what_is_learnt_are_the_counts_by_laplaces_rule(rows: list[dict[str, Any]], run: Path) -> None:
    data = data_set(str(run), VARIABLES)
    assert len(data) == len(rows) == 240
    description = pi_behavior_taught.identify(dict(data.columns))
    met = Counter((row["draws"]["Behavior"], row["evidence"]["Behavior_t-1"]) for row in rows)
    by = Counter(row["evidence"]["Behavior_t-1"] for row in rows)
    form: Any = description[P(Behavior | Behavior_t_1)]
    p = form.probabilities(P(Behavior | Behavior_t_1))
    for i, now in enumerate(Behavior.values):
        for j, before in enumerate(Behavior.values):
            assert p[i, j] == pytest.approx((met[now, before] + 1) / (by[before] + 6))
    based: Counter[Any] = Counter()
    for row in rows:
        based[at_base(**{v.keyword: row["evidence"][v.name] for v in at_base.known}).best()] += 1
    assert Counter(data.columns["Base"]) == based
    # Nothing is impossible by accident: every combination is answered, with no zero in it.
    question = deciding(description)
    for energy in Energy.values:
        told = {"Vigil": False, "Energy": energy, "Fire": True, "Identify": True, "Base": True}
        assert (question(**told, Behavior_t_1="recognition").p > 0).all()


def test_labelled_ticks_alone(run: Path, rows: list[dict[str, Any]]) -> None:
    labelled = data_set(str(run), VARIABLES, labelled=True)
    assert len(labelled) == sum(said(row["evidence"]) for row in rows) == 170
    assert set(labelled.columns["Behavior"]) == {"patrol", "recharge", "homing"}
    cut = data_set(f"{run}@7.05-9", VARIABLES, labelled=True)
    assert set(cut.columns["Behavior"]) == {"recharge"}


def test_the_command_learns_shows_and_saves_and_the_watchman_goes_by_it(run: Path, tmp_path: Path) -> None:
    done = khepera_hil("identify", "behavior", "--data", run, "--out", "b.json", "--json", cwd=tmp_path)
    assert done.code == 0, done.err
    assert "never met: " in done.out
    terms = json.loads(done.out.splitlines()[-1])["terms"]
    assert [terms[str(term)]["table"] for term in TABLES.values()] == [2, 3, 4, 5, 6, 7]
    for term in TABLES.values():
        np.testing.assert_allclose(np.sum(terms[str(term)]["p"], axis=0), 1, atol=1e-5)
    learnt_tables = taught(str(tmp_path / "b.json"), pi_behavior_taught)
    direct = taught(str(run), pi_behavior_taught)
    told = {"Vigil": True, "Energy": "low", "Base": False, "Fire": False, "Identify": False}
    question, other = deciding(learnt_tables), deciding(direct)
    for last in Behavior.values:
        np.testing.assert_array_equal(question(**told, Behavior_t_1=last).p, other(**told, Behavior_t_1=last).p)
    words = [
        "--program",
        "watchman",
        "--data",
        "b.json",
        "--labels",
        "--fast",
        "--seed",
        "4",
        "--duration",
        "3",
        "--json",
    ]
    ran = khepera_hil(*words, cwd=tmp_path)
    assert ran.code == 0, ran.err
    again = khepera_hil("replay", ran.result["run"], "--json", cwd=tmp_path)
    assert again.code == 0, again.out
    assert again.result["same"] is True


@pytest.mark.parametrize(
    ("data", "more", "said"),
    [
        ("runs/example-home", [], "no tick of {} has all of Behavior_t-1, Behavior, Vigil"),
        ("RUN@0-3", [], f"30 data are too few to learn behaviors from: at least {FEWEST} are needed"),
        ("RUN@3-6.9", ["--labelled"], "39 data are too few"),
        ("delta-push", ["--labelled"], "delta-push is a data set, which does not tell what was labelled"),
        ("nowhere", [], "there is no data set 'nowhere'"),
    ],
)
def test_what_cannot_be_learnt_is_one_sentence(data: str, more: list[str], said: str, run: Path) -> None:
    root = Path(__file__).parent.parent.parent
    where = data.replace("RUN", str(run)).replace("runs/example-home", str(root / "runs/example-home"))
    with pytest.raises(UsageError) as caught:
        identify.main(["behavior", "--data", where, *more])
    assert said.format(where) in str(caught.value)


def test_a_run_in_which_nobody_said_anything_has_no_labels(tmp_path: Path) -> None:
    drive(Watchman(), world="furnished", seed=1, duration=1.0, record=tmp_path)
    (folder,) = tmp_path.iterdir()
    assert len(data_set(str(folder), VARIABLES)) == 10
    with pytest.raises(UsageError, match=r"no tick of .* was labelled: run the watchman with --labels"):
        data_set(str(folder), VARIABLES, labelled=True)


def test_a_watchman_does_not_go_by_too_little_either(run: Path) -> None:
    with pytest.raises(UsageError, match="30 data are too few"):
        taught(f"{run}@0-3", pi_behavior_taught)
    with pytest.raises(UsageError, match="all 120 data are of one behavior, patrol"):
        enough({"Behavior": ["patrol"] * 120})


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--program", "home", "--labels"], "are about --program watchman, not home"),
        (["--program", "watchman", "--labels", "--memory", "whole"], "--labels does not go with it"),
        (["--program", "watchman", "--data", "B", "--memory", "whole"], "--data does not go with it"),
        (["--program", "watchman", "--data", "B", "--stay", "0.99"], "does not go with --data"),
        (["--program", "watchman", "--data", "delta-push"], "delta-push"),
    ],
)
def test_what_does_not_go_together_is_one_sentence(words: list[str], said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        run_command.main([*words, "--fast", "--duration", "1", "--runs", str(tmp_path)])
    assert said in str(caught.value)
