"""How the watchman depends on the numbers in its tables: the design, what is exact, and what is found."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brp import chain
from brp.programs.behavior import Behavior, behaving, pi_behavior_taught
from brp.store import save
from khepera_hil.commands import paper
from khepera_hil.errors import UsageError
from khepera_hil.experiments import stability_effects
from khepera_hil.experiments import stability_exact as exact
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.stability import experiment
from khepera_hil.experiments.stability_design import Design, signs_of
from khepera_hil.experiments.stability_effects import OUTCOMES, Nights
from khepera_hil.experiments.stability_tables import (
    ENTRIES,
    PUBLISHED,
    Entry,
    chosen,
    described,
    movable,
    perturbed,
    zeros,
)
from khepera_hil.experiments.stability_trial import trial
from khepera_hil.experiments.tabled_night import met, nightly


def test_there_are_108_entries_of_which_22_are_zero_and_11_certain() -> None:
    """Lesson 9's count."""
    assert len(ENTRIES) == 108
    assert len(movable()) == 75
    assert len(zeros()) == 22
    assert str(Entry(2, 5, 1)) == "P(recharge | patrol)"
    assert str(Entry(4, 1, 5)) == "P(Energy low | recharge)"
    assert chosen(["4:recharge:low"]) == (Entry(4, 1, 5),)
    assert len(chosen(["3", "2:patrol", "2:patrol:idle"])) == 18
    for wrong in ("8", "2:nobody", "4:recharge:empty", "4:recharge:low:more", ""):
        with pytest.raises(UsageError, match="is no part of tables 2 to 7"):
            chosen([wrong])


@pytest.mark.parametrize("amount", [0.1, 1.0, 100.0])
def test_perturbed_columns_are_distributions_and_zeros_stay_or_are_opened(amount: float) -> None:
    rng = np.random.default_rng(3)
    signs = {entry: int(rng.choice([-1, 1])) for entry in ENTRIES}
    for opened in (0.0, 0.02):
        tables = perturbed(signs, amount, opened)
        for number, p in tables.items():
            np.testing.assert_allclose(p.sum(axis=0), 1, rtol=1e-12)
            was = PUBLISHED[number] == 0
            wanted = [opened if signs[Entry(number, *at)] > 0 else 0.0 for at in np.argwhere(was).tolist()]
            np.testing.assert_allclose(p[was], wanted, atol=1e-15)
        described(tables)  # the engine agrees that these are distributions


def test_one_entry_moves_by_its_odds_and_the_others_keep_their_proportions() -> None:
    entry = Entry(2, 5, 1)
    before, after = PUBLISHED[2][:, 1], perturbed({entry: 1}, 0.5)[2][:, 1]
    assert after[5] / (1 - after[5]) == pytest.approx(1.5 * before[5] / (1 - before[5]))
    np.testing.assert_allclose(after[:5] / after[0], before[:5] / before[0])
    down = perturbed({entry: -1}, 0.5)[2][:, 1]
    assert down[5] / (1 - down[5]) == pytest.approx(before[5] / (1 - before[5]) / 1.5)
    together = perturbed({e: 1 for e in movable() if (e.table, e.column) == (2, 1)}, 3.0)
    np.testing.assert_allclose(together[2], PUBLISHED[2], rtol=1e-12)


def test_every_perturbation_has_its_opposite_over_the_same_night() -> None:
    cases = Design(amount=1.0, opened=0.01).cases([4, 5])
    assert len(cases) == 2 * (1 + 20)
    ran = {(case["seed"], case["signs"]) for case in cases}
    assert len(ran) == len(cases)
    for case in cases:
        opposite = str(case["signs"]).translate(str.maketrans("+-", "-+"))
        assert (case["seed"], opposite) in ran
    assert set(signs_of(cases[1])) == set(Design(opened=0.01).entries())


def test_signs_are_independent_over_a_whole_round_of_rows() -> None:
    design = Design(only=("2:patrol", "4:patrol"), pairs=16)
    cases = design.cases([1])[1:]
    signs = np.array([[signs_of(case)[entry] for entry in design.entries()] for case in cases])
    np.testing.assert_array_equal(signs.T @ signs, len(cases) * np.eye(signs.shape[1]))


@pytest.mark.parametrize(("by", "expected"), [("entry", 1 + 2 * 9), ("column", 1 + 2 * 2), ("all", 1 + 2 * 10)])
def test_what_is_perturbed_together_is_as_asked(by: str, expected: int) -> None:
    design = Design(by=by, only=("2:patrol", "4:patrol"))
    cases = design.cases([7])
    assert len(cases) == expected
    most = max(len(signs_of(case)) for case in cases)
    assert most == {"entry": 1, "column": 6, "all": 9}[by]
    # More pairs than an entry has ways to be moved are no more nights.
    assert len(Design(by="entry", only=("3:idle",), pairs=9).cases([1])) == 1 + 2 * 2


def test_entries_that_no_answer_depends_on_are_not_perturbed() -> None:
    some = set(Design().entries())
    fire = Behavior.place("fire-intervention")
    assert len(some) == 65
    assert not any(entry.table > 2 and entry.column == fire for entry in some)
    with pytest.raises(UsageError, match="zeros are opened by --open-zeros only"):
        Design(only=("6",)).entries()
    assert len(Design(only=("6",), opened=0.01).entries()) == 6


def test_the_exact_slopes_are_those_of_kernels_with_other_tables() -> None:
    """The rows that are asked without Behavior_t-1 too."""
    step = 1e-4
    for entry in movable()[::9]:
        up, down = (exact.kernels(described(perturbed({entry: s}, math.expm1(step)))) for s in (1, -1))
        np.testing.assert_allclose(exact.slopes()[ENTRIES.index(entry)], (up - down) / (2 * step), atol=1e-8)
    opened = exact.kernels(described(perturbed({Entry(4, 2, 5): 1}, 0.5, 1e-8))) - exact.kernels()
    slope = exact.openings()[ENTRIES.index(Entry(4, 2, 5))]
    becomes_possible = np.abs(opened).max(axis=2) > 0.5
    assert 0 < becomes_possible.sum() <= 18
    np.testing.assert_allclose(opened[~becomes_possible] / 1e-8, slope[~becomes_possible], atol=1e-4)


def test_the_exact_figures_of_the_chain() -> None:
    low = {(exact.PATROL[1], "patrol"): 600.0}
    rate, slopes = exact.changing(low)
    assert rate == pytest.approx(600 / 46)  # .0217 a tick and back: see docs/watchman.md
    entry = Entry(2, 5, 1)
    step = 1e-4
    place = exact.SITUATIONS.index(exact.PATROL[1])
    start = np.full(6, 1 / 6)
    up, down = (
        600 * chain.changes(exact.kernels(described(perturbed({entry: s}, math.expm1(step))))[place], start)
        for s in (1, -1)
    )
    assert slopes[ENTRIES.index(entry)] == pytest.approx((up - down) / (2 * step), rel=1e-5)
    lasts, relative = exact.dwelling(exact.PATROL[1])
    assert lasts[Behavior.place("patrol")] == pytest.approx(4.6)
    assert relative[ENTRIES.index(entry), Behavior.place("patrol")] == pytest.approx(-0.98, abs=0.005)
    assert math.isinf(exact.dwelling(exact.PATROL[2])[0][Behavior.place("patrol")])
    moved = exact.otherwise(low, 0.01)[ENTRIES.index(entry)]
    kernel = exact.kernels(described(perturbed({entry: 1}, math.expm1(0.01))))[place]
    apart = np.abs(kernel - exact.kernels()[place])[Behavior.place("patrol")].sum() / 2
    assert moved == pytest.approx(600 * apart, rel=0.02)


def made_up(cases: Sequence[Case], law: dict[Entry, float], rng: np.random.Generator) -> list[Result]:
    """Nights whose changes a minute follow a law of the entries, with noise of their own and of their seed."""
    seeds: dict[Any, float] = {}
    situations = {"True low False False False patrol": 900, "True low False False False recharge": 900}
    situations |= {"True low False False True idle": 900, "False high False False False homing": 900}
    found: list[Result] = []
    for case in cases:
        here = seeds.setdefault(case["seed"], 30 + 5 * rng.normal())
        here += sum(law.get(entry, 0.0) * sign for entry, sign in signs_of(case).items()) + rng.normal()
        score = {"fires_lit": 1, "fires_put_out": 1, "contacts": 0}
        found.append(
            {
                "changes": {"low": here},
                "behaviors": {"patrol": 600},
                "ticks": 600,
                "burning": 10.0,
                "charge": 0.5,
                "situations": situations,
                "score": score,
            }
        )
    return found


def obeying(rng: np.random.Generator, entries: Sequence[Entry]) -> dict[Entry, float]:
    """Effects that sum to zero in each column, as those of odds do; none of what hardly changes a decision."""
    law = {entry: float(rng.normal()) for entry in entries}
    for column in {(entry.table, entry.column) for entry in entries}:
        there = [entry for entry in entries if (entry.table, entry.column) == column]
        middle = float(np.mean([law[entry] for entry in there]))
        law |= {entry: law[entry] - middle for entry in there}
    return law


@pytest.mark.parametrize(("by", "seeds"), [("all", 16), ("all", 4), ("all", 2), ("column", 20), ("entry", 20)])
def test_effects_are_found_with_honest_intervals(by: str, seeds: int) -> None:
    covered, families = [], []
    for number in range(8):
        rng = np.random.default_rng([number, seeds])
        design = Design(amount=1.0, by=by)
        cases = design.cases(range(1, seeds + 1))
        first = Nights(cases, made_up(cases, {}, rng))
        law = obeying(rng, first.entries)
        nights = Nights(cases, made_up(cases, law, rng))
        assert nights.entries == first.entries
        assert nights.together is (by == "all" and seeds > 2)
        effects = nights.effects("changes")
        covered += [effect.low <= law[entry] <= effect.high for entry, effect in effects.items()]
        families.append(any(effect.clear for effect in first.effects("changes").values()))
    assert 0.9 < np.mean(covered) <= 1  # 95 % of some 230, and more where the others' effects are in the interval
    assert sum(families) <= 2  # where nothing has an effect one is clear in one campaign of twenty


def test_a_night_has_its_outcomes_and_repeats() -> None:
    case = Design(amount=1.0, seconds=12.0).cases([3])[1]
    one = trial(case)
    assert one == trial(case)
    assert json.loads(json.dumps(one)) == one
    assert one["ticks"] == 120 == sum(met(one).values())
    for outcome in OUTCOMES.values():
        assert math.isfinite(outcome.value(one, 1.0))
    published = nightly(3, 12.0, None)
    assert published == nightly(3, 12.0, behaving) == nightly(3, 12.0, described(PUBLISHED))
    assert published["charge"] == pytest.approx(one["charge"], abs=0.05)  # the same battery, from the seed


def test_the_report_its_maps_and_its_numbers(tmp_path: Path) -> None:
    design = Design(amount=1.0, opened=0.01)
    study = experiment(design)
    assert study.show(tmp_path).files == []
    cases = study.cases(range(1, 17))
    rng = np.random.default_rng(1)
    report = study.report(cases, made_up(cases, {Entry(2, 5, 1): 3.0, Entry(2, 1, 1): -3.0}, rng))
    lines = [line for line in report.lines if line.startswith("2: P(recharge | patrol)")]
    assert len(lines) == 1
    assert "**" in lines[0]
    assert len([line for line in report.lines if line[1:3] == ": "]) == len(design.entries())
    page, written, svg, rrd = study.show(tmp_path).files
    assert "| P(recharge given patrol) | 0.02 |" in page.read_text()
    numbers = json.loads(written.read_text())
    effect = numbers["effects"]["changes"]["2:patrol:recharge"]
    assert effect["low"] < 3 < effect["high"]
    assert effect["clear"] is True
    assert len(numbers["exact"]) == 108
    text = svg.read_text()
    assert text.startswith("<svg")
    assert text.count("<rect") == 1 + 108 * (3 + len(OUTCOMES))
    assert rrd.stat().st_size > 10_000


def test_the_command_runs_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = [
        "stability",
        "--only",
        "2:patrol:recharge",
        "--minutes",
        "0.1",
        "--seeds",
        "1",
        "--json",
        "--jobs",
        "1",
    ]
    said = []
    for _ in range(2):
        assert paper.main(words) == 0
        said.append(json.loads(capsys.readouterr().out))
    assert said[0] == said[1]
    names = [Path(path).name for path in said[0]["experiments"]["stability"]["files"]]
    assert names == ["stability.md", "stability.json", "tables.svg", "tables.rrd", "stability.rrd"]


def test_a_learnt_watchman_beside_the_published_one_over_the_same_nights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(5)
    variables = {v.name: v for v in pi_behavior_taught.variables}
    columns = {name: [v.values[i] for i in rng.integers(len(v), size=200)] for name, v in variables.items()}
    save(pi_behavior_taught.identify(columns, name="delta-dice"), tmp_path / "dice.json")
    words = ["learnt", "--data", "dice.json", "--minutes", "0.1", "--seeds", "2", "--json", "--jobs", "1"]
    assert paper.main(words) == 0
    printed = capsys.readouterr()
    figures = json.loads(printed.out)["figures"]
    name = "learnt: changes of Behavior a minute"
    published, learnt = figures[f"{name}: published"], figures[f"{name}: learnt"]
    assert published["n"] == learnt["n"] == 2
    assert learnt["value"] > 100 > published["value"]  # by dice it changes its mind all the time
    difference = figures[f"{name}: learnt less published"]["value"]
    assert difference == pytest.approx(learnt["value"] - published["value"], rel=1e-5)
    assert "the tables of delta-dice pi-behavior beside the published one" in printed.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["stability", "--amount", "0"], "'0' is no number of times from 0.001 to 1000"),
        (["stability", "--open-zeros", "0.5"], "no number of a probability"),
        (["stability", "--by", "row"], "invalid choice: 'row'"),
        (["stability", "--only", "4:nobody"], "'4:nobody' is no part of tables 2 to 7"),
        (["stability", "--only", "6"], "none of these entries can be perturbed"),
        (["stability", "--pairs", "0"], "'0' is no number of pairs"),
        (["learnt"], "learnt wants --data"),
        (["learnt", "--data", "nowhere.json"], "there is no data set 'nowhere.json'"),
        (["learnt", "--data", "delta-push"], "delta-push"),
    ],
)
def test_mistakes_are_one_sentence(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(UsageError, match=said.replace("(", r"\(")):
        paper.main(words)


def test_an_entry_that_is_looked_at_alone_in_its_column_has_no_effect_and_no_star() -> None:
    """Effects of a column sum to zero, so that one by itself has none, whatever rounding leaves."""
    rng = np.random.default_rng(6)
    contrasts = rng.choice([-1.0, 1.0], (40, 3))
    contrasts[:, 1] = 1e-17 * rng.normal(size=40)
    one, alone, _ = stability_effects._fitted(contrasts, 2 * contrasts[:, 0] + 0.1 * rng.normal(size=40))
    assert one.seen
    assert one.clear
    assert (alone.value, alone.low, alone.high, alone.seen, alone.clear) == (0.0, 0.0, 0.0, False, False)
