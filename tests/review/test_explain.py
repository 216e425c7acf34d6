"""Why a value was drawn."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brp import Term
from brp.programs.home import H, Vrot, home, homing
from brp.programs.watchman import watchman
from khepera_hil.explain import reasons
from khepera_hil.recording import LOG

EVIDENCE = {"Dir": -7, "Prox": 9, "Theta1": -60}
KNOWN: dict[str, Any] = dict(EVIDENCE)


def test_the_bits_are_those_of_the_question_and_the_hidden_variable_is_weighed_by_the_draw() -> None:
    top, *below = reasons(home, {"Vrot": 8}, EVIDENCE)
    assert top.explanation is not None
    assert top.explanation.probability == home(**KNOWN)[8]
    for part in top.explanation.contributions:
        assert part.bits == pytest.approx(math.log2(top.explanation.probability / part.without))
    (belief,) = top.beliefs
    assert belief.variable == "H"
    assert dict(belief.before)["avoidance"] == pytest.approx(
        homing.ask(Term((H,), home.known))(**KNOWN)["avoidance"]
    )
    joint = homing.ask(Term((H, Vrot), home.known))(**KNOWN)  # Bayes by hand
    after = [joint[h, 8] / sum(joint[x, 8] for x in H.values) for h in H.values]
    assert [p for _, p in belief.after] == pytest.approx(after)
    # To the right there is avoidance only: phototaxy is not gone into.
    assert [reason.depth for reason in below] == [1]
    assert below[0].under.startswith("H = avoidance")
    assert "delta-avoid" in below[0].question


def test_both_behaviors_are_gone_into_where_both_may_have_drawn() -> None:
    under = {
        reason.under.split(" (")[0] for reason in reasons(home, {"Vrot": 0}, {"Dir": 0, "Prox": 0, "Theta1": 0})
    }
    assert "H = phototaxy" in under
    _, *below = reasons(home, {"Vrot": 8}, {"Dir": -8, "Prox": 9, "Theta1": 60})
    assert {reason.under.split(" (")[0] for reason in below} == {"H = phototaxy", "H = avoidance"}


def test_the_watchmans_levels_are_all_gone_down() -> None:
    rng = np.random.default_rng(1)
    evidence = {v.name: v.values[int(rng.integers(len(v)))] for v in watchman.known}
    drawn = watchman(**{v.keyword: evidence[v.name] for v in watchman.known}).draw(rng)
    found = list(reasons(watchman, dict(zip(("Vrot", "Vtrans", "O"), drawn, strict=True)), evidence))
    assert {belief.variable for belief in found[0].beliefs} == {"Base", "Theta2", "Behavior", "Move", "H"}
    names = " ".join(reason.question for reason in found)
    for name in ("pi-behavior", "pi-move", "pi-speed", "pi-fusion", "pi-base", "pi-object"):
        assert name in names
    assert max(reason.depth for reason in found) >= 2
    for reason in found:  # each holds what it says it holds
        if reason.explanation is not None:
            assert 0 <= reason.explanation.probability <= 1


def test_a_tick_is_explained_at_its_time(runs: Path, say: Callable[..., Any]) -> None:
    said = say("explain", "home-8-1", "--runs", runs, "--at", "6.04", "--variable", "Vrot")
    assert said.code == 0, said.err
    first, second, third, *rest = said.out.splitlines()
    assert first.startswith("home-8-1, tick 60 at 6 s: Dir ")
    assert second.startswith("Vrot = ")
    assert third.startswith("P(Vrot | Dir Prox Theta1 pi-home)")
    assert any("bits for" in line for line in rest)
    assert any("not known, H:" in line for line in rest)
    told = json.loads(say("explain", "home-8-1", "--runs", runs, "--at", "6", "--json").out)
    assert told["tick"] == 60
    assert told["draws"]["Vrot"][0]["explanation"]["question"] == home.name


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--at", "99"], "ends at 12 s"),
        (["--at", "6", "--variable", "H"], "'H' was not drawn in that tick; there is Vrot"),
        (["--at", "soon"], "no number of seconds"),
        ([], "--at"),
    ],
)
def test_what_cannot_be_explained_is_refused(
    runs: Path, words: list[str], sentence: str, say: Callable[..., Any]
) -> None:
    said = say("explain", "home-8-1", "--runs", runs, *words)
    assert said.code == 2
    assert sentence in said.err


def test_a_tick_without_a_draw_says_why(copy: Path, say: Callable[..., Any]) -> None:
    rows = [json.loads(line) for line in (copy / LOG).read_text().splitlines()]
    rows[30] |= {"draws": {}, "u": {}, "evidence": {}, "events": [["warning", "no data: the robot is silent"]]}
    rows[40]["evidence"] = {}
    (copy / LOG).write_text("".join(json.dumps(row) + "\n" for row in rows))
    said = say("explain", copy, "--at", "3")
    assert said.code == 2
    assert "nothing was drawn in tick 30 at 3 s: no data: the robot is silent" in said.err
    said = say("explain", copy, "--at", "4")
    assert said.code == 2
    assert "cannot be asked again" in said.err
