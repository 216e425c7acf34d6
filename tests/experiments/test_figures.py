"""Intervals and campaigns: what is claimed of a measurement, and that none is lost."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.experiments import campaign
from khepera_hil.experiments.campaign import run
from khepera_hil.experiments.figures import counted, mean, rate, share
from khepera_hil.experiments.fingerprint import code_of


@given(st.lists(st.booleans(), min_size=1, max_size=300))
def test_a_share_lies_in_its_interval_and_the_interval_in_0_to_1(hits: list[bool]) -> None:
    figure = share("hits", hits, ">= 0.5")
    assert figure.value is not None
    assert figure.low is not None
    assert figure.high is not None
    assert -1e-12 <= figure.low <= figure.value + 1e-12
    assert figure.value - 1e-12 <= figure.high <= 1 + 1e-12
    assert figure.met == (sum(hits) / len(hits) >= 0.5)


def test_known_intervals() -> None:
    # Wilson for 98 of 100, and the rule of three for a count of none.
    ninety_eight = share("", [True] * 98 + [False] * 2)
    assert (ninety_eight.low, ninety_eight.high) == pytest.approx((0.930, 0.9945), abs=1e-3)
    none = rate("", 0, 10.0, 10)
    assert none.low == 0
    assert none.high == pytest.approx(-math.log(0.025) / 10)
    assert mean("", [1.0, 2.0, 3.0]).high == pytest.approx(2 + 4.3027 / math.sqrt(3), abs=1e-3)


def test_nothing_measured_reaches_nothing() -> None:
    for figure in (share("", [], ">= 0"), rate("", 0, 0.0, 0, "<= 1"), mean("", [], "<= 1")):
        assert figure.value is None
        assert figure.met is None
        assert json.loads(json.dumps(figure.row()))["n"] == 0
    assert counted("", 2, "== 2").met
    assert not counted("", 2.5, "<= 2").met


def _double(case: Any) -> dict[str, Any]:
    if case.get("fails"):
        raise ZeroDivisionError
    with Path(case["log"]).open("a") as log:
        log.write(f"{case['seed']}\n")
    return {"twice": 2 * case["seed"]}


def test_an_interrupted_campaign_goes_on_and_measures_nothing_twice(tmp_path: Path) -> None:
    log = tmp_path / "log"
    cases: list[dict[str, Any]] = [{"seed": seed, "log": str(log)} for seed in range(6)]
    with pytest.raises(ZeroDivisionError):
        run("doubling", _double, [*cases[:3], {"seed": 9, "fails": True}], tmp_path / "out", workers=1)
    done = log.read_text().split()
    assert done
    assert [r["twice"] for r in run("doubling", _double, cases, tmp_path / "out", workers=2)] == [0, 2, 4, 6, 8, 10]
    assert sorted(log.read_text().split()) == [str(seed) for seed in range(6)]
    run("doubling", _double, cases, tmp_path / "out")
    assert len(log.read_text().split()) == 6


def test_other_code_measures_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log"
    case = {"seed": 1, "log": str(log)}
    run("doubling", _double, [case], tmp_path)
    of = code_of("tests.experiments.test_figures")
    monkeypatch.setattr(campaign, "code_of", lambda module: replace(of, digest="other"))
    run("doubling", _double, [case], tmp_path)
    assert log.read_text().split() == ["1", "1"]
