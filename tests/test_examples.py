"""The examples run, and what they show is so."""

from __future__ import annotations

import runpy
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from brp import ImpossibleEvidence, P
from examples import extremes, filter, fusion, hidden, if_then_else, inverse, online, pushing, subroutine

SCRIPTS = sorted(
    path for path in (Path(__file__).parent.parent / "examples").glob("*.py") if path.stem != "__init__"
)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_an_example_runs_and_prints(script: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(script), run_name="__main__")
    assert len(capsys.readouterr().out.splitlines()) >= 3


def test_what_was_taught_to_push_pushes_and_can_be_asked_backwards() -> None:
    push = pushing.learnt(np.random.default_rng(1))
    turn = push.ask(P(pushing.Vrot | pushing.Dir, pushing.Prox))
    for dir_ in (-8, 0, 8):
        assert turn(Dir=dir_, Prox=14).mean() == pytest.approx(dir_, abs=2)
    backwards = push.ask(P(pushing.Dir | pushing.Vrot, pushing.Prox))
    assert backwards(Vrot=-8, Prox=14).mean() < -4 < 4 < backwards(Vrot=8, Prox=14).mean()


def test_fused_thermometers_know_more_than_each_and_find_the_broken_one() -> None:
    for read in ({"Cellar": 13, "Door": 20, "Roof": 24}, {"Cellar": 8, "Door": 2, "Roof": 6}):
        assert fusion.fused(**read).entropy() < fusion.by_one(Door=read["Door"]).entropy()
        others = {name: value for name, value in read.items() if name != "Roof"}
        assert fusion.expected(**others)[45] < 1e-9 < fusion.expected(**others)[read["Roof"]]


def test_the_command_variable_mixes_and_a_certain_one_branches() -> None:
    for gap, limit in product((10, 40, 80), (50, 100)):
        known = {"Gap": gap, "Limit": limit}
        weight = if_then_else.driving.ask(P(if_then_else.H | if_then_else.Gap))(Gap=gap)
        mixture = sum(weight[h] * if_then_else.braking(**known, H=h).p for h in ("brake", "cruise"))
        np.testing.assert_allclose(if_then_else.drive(**known).p, mixture, rtol=1e-12)
        branch = if_then_else.braking(**known, H="brake" if gap < 40 else "cruise")
        hard = if_then_else.hard.ask(P(if_then_else.Speed | if_then_else.Gap, if_then_else.Limit))
        np.testing.assert_allclose(hard(**known).p, branch.p, rtol=1e-12)


def test_an_inverse_program_always_has_an_answer() -> None:
    impossible = 0
    for row in product(*(v.values for v in inverse.strict.known)):
        known = {v.keyword: value for v, value in zip(inverse.strict.known, row, strict=True)}
        answer = inverse.act(**known)
        if inverse.strict.possible(**known):
            np.testing.assert_array_equal(answer.p, inverse.strict(**known).p)
        else:
            impossible += 1
            with pytest.raises(ImpossibleEvidence):
                inverse.strict(**known)
    assert impossible > 0


def test_a_subroutine_is_asked_and_not_opened() -> None:
    for window, season in product(range(9), ("winter", "summer")):
        rain = subroutine.forecast(Clouds=window, Pressure="rising", Season=season)[True]
        answer = subroutine.umbrella(Window=window, Pressure="rising", Season=season)
        assert answer["take"] == pytest.approx(0.1 + 0.9 * rain, rel=1e-12)
    assert "2 descriptions on 2 levels" in str(subroutine.umbrella)


def test_a_description_of_diracs_answers_by_0_and_1_only() -> None:
    answer = extremes.who()
    assert set(answer.p.ravel().tolist()) == {0.0, 1.0}
    assert answer.best() == (False, True, False)
    formal = extremes.adder(formal=True)
    both = formal.ask(P(extremes.Sum, extremes.Carry | extremes.X, extremes.Y))
    back = formal.ask(P(extremes.Y | extremes.X, extremes.Sum))
    for x, y in product((0, 1), repeat=2):
        assert both(X=x, Y=y)[(x + y) % 2, (x + y) // 2] == 1
        assert back(X=x, Sum=(x + y) % 2)[y] == 1
    # No one is both 1 and 1 and has no carry: what logic excludes is impossible, and not merely improbable.
    with pytest.raises(ImpossibleEvidence):
        formal.ask(P(extremes.Sum | extremes.X, extremes.Y, extremes.Carry))(X=1, Y=1, Carry=0)


def test_who_has_learnt_nothing_answers_uniform_whatever_the_question() -> None:
    flat = extremes.adder(formal=False)
    for searched in flat.variables:
        known = [v for v in flat.variables if v != searched]
        for row in product((0, 1), repeat=3):
            told = {v.keyword: value for v, value in zip(known, row, strict=True)}
            np.testing.assert_allclose(flat.ask(P(searched | known))(**told).p, 0.5, rtol=1e-12)


def test_objects_are_new_once_and_known_ever_after(capsys: pytest.CaptureFixture[str]) -> None:
    online.main()
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert len(lines) == 12
    assert sum("new:" in words for words in lines) == len(online.OBJECTS)


def test_when_the_driver_brakes_is_learnt_without_ever_seeing_it() -> None:
    found = hidden.learnt(np.random.default_rng(5)).ask(P(if_then_else.H | if_then_else.Gap))
    real = if_then_else.driving.ask(P(if_then_else.H | if_then_else.Gap))
    errors = [abs(found(Gap=gap)["brake"] - real(Gap=gap)["brake"]) for gap in if_then_else.Gap.values]
    assert max(errors) < 0.15
    assert np.mean(errors) < 0.05


def test_the_filter_is_the_forward_pass_and_finds_the_robot() -> None:
    """Against the forward pass of a hidden Markov model in plain numpy."""
    n = filter.LENGTH
    motion = np.zeros((n, n))
    for before in range(n):
        for error, p in ((0, 0.9), (1, 0.05), (-1, 0.05)):
            motion[(before + 1 + error) % n, before] += p
    sees_door = np.array([0.95 if place in filter.DOORS else 0.02 for place in range(n)])
    found = 0
    for seed in range(10):
        belief, forward = filter.localise.start, np.full(n, 1 / n)
        way = filter.walked(np.random.default_rng(seed), 60)
        for _, seen in way:
            belief = filter.localise.step(belief, Steps=1, Seen=seen)
            forward = motion @ forward * (sees_door if seen == "door" else 1 - sees_door)
            forward /= forward.sum()
            np.testing.assert_allclose(belief.p, forward, rtol=1e-10)
        place = way[-1][0]
        found += min((belief.best() - place) % n, (place - belief.best()) % n) <= 1
    assert found >= 7
