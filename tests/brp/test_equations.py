"""The paper's numbered equations of sections 6 and 8 to 10, typed once in plain numpy straight from the page.

Those of sections 5 and 7 are in `test_programs`. Nothing here but the questions asked comes from brp: tables and
parameters are typed again, so that a slip in a program shows.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brp import DataError, ImpossibleEvidence, P
from brp.programs.base import at_base
from brp.programs.behavior import Behavior, Behavior_t_1, behaving, behavior
from brp.programs.fusion import L, N, fusing, locate, locate_scaled, out_of_order
from brp.programs.level import locate as locate_by_level
from brp.programs.level import out_of_order as out_of_order_by_level
from brp.programs.move import Move, move
from brp.programs.object import Lrl, Nlt, Nrt, O, Per, pi_object, recognise, recognised, unacquainted
from brp.programs.sensor import Theta2, sensor
from brp.programs.speed import speed
from brp.programs.watchman import Sensory_variables, Vrot, Vtrans, pi_watchman, watching, watchman
from tests.brp.test_programs import page_avoid, page_command, page_phototaxy

Row = NDArray[np.float64]
Evidence = dict[str, Any]


def normal(values: Row, mean: float, deviation: float) -> Row:
    logs = -0.5 * ((values - mean) / deviation) ** 2
    return np.asarray(logs - np.log(np.exp(logs - logs.max()).sum()) - logs.max())


def normalised(logs: Row) -> Row:
    p = np.exp(logs - logs.max())
    return np.asarray(p / p.sum())


# Section 6.

THETA = (-90, -45, -10, 10, 45, 90, 175, -175)
BEARING = np.arange(-170, 181, 10)


@cache
def page_sensor(i: int) -> Row:
    """ln P(Li | Theta2) [S6.4], shape (512, 36)."""
    apart = np.abs(BEARING - THETA[i])
    apart = np.minimum(apart, 360 - apart)
    k = 1 - 1 / (1 + np.exp(-4 * 0.03 * (apart - 45)))
    return np.stack([normal(np.arange(512.0), 511 - 511 * b, 40) for b in k], axis=1)


def page_fusion(readings: tuple[int, ...]) -> Row:
    """[E6.2]"""
    return normalised(sum((page_sensor(i)[reading] for i, reading in enumerate(readings)), np.zeros(36)))


def test_figure_5_one_sensor_sees_the_light_on_its_axis() -> None:
    """K is .996 on the axis, .5 at 45 degrees and .004 at 90; a reading falls as light rises."""
    model = sensor(0).ask(P(sensor(0).variables[1] | Theta2))
    for theta, brightness in ((0, 0.996), (90, 0.004), (-90, 0.004), (180, 0.0)):
        assert model(Theta2=theta).best() == pytest.approx(511 * (1 - brightness), abs=1)
    assert model(Theta2=40).mean() == pytest.approx(511 * (1 - 1 / (1 + np.exp(-0.6))), abs=1)


def test_e6_2_equals_the_page() -> None:
    rng = np.random.default_rng(62)
    for _ in range(50):
        readings = tuple(int(r) for r in rng.integers(512, size=8))
        for question, variables in ((locate, L), (locate_scaled, N)):
            answer = question(**{v.name: r for v, r in zip(variables, readings, strict=True)})
            np.testing.assert_allclose(answer.p, page_fusion(readings), rtol=1e-9, atol=1e-300)


def test_e6_3_equals_the_page() -> None:
    question = fusing.ask(P(Theta2 | L[0], L[1]))
    for l1, l2 in np.random.default_rng(63).integers(512, size=(50, 2)):
        expected = normalised(page_sensor(0)[l1] + page_sensor(1)[l2])
        np.testing.assert_allclose(question(L1=int(l1), L2=int(l2)).p, expected, rtol=1e-9, atol=1e-300)


@pytest.mark.parametrize("i", range(1, 9))
def test_e6_4_equals_the_page(i: int) -> None:
    rng = np.random.default_rng(64)
    for _ in range(5):
        readings = {f"L{j}": int(rng.integers(512)) for j in range(1, 9) if j != i}
        others = sum((page_sensor(int(name[1]) - 1)[r] for name, r in readings.items()), np.zeros(36))
        expected = np.exp(page_sensor(i - 1)) @ normalised(others)
        np.testing.assert_allclose(out_of_order(i)(**readings).p, expected, rtol=1e-9, atol=1e-300)


def test_e6_1_the_readings_are_independent_knowing_the_bearing() -> None:
    alone = fusing.ask(P(L[4] | Theta2))
    with_others = fusing.ask(P(L[4] | L[3], L[2], L[1], L[0], Theta2))
    for theta in (-90, 0, 40):
        told = with_others(L1=500, L2=3, L3=77, L4=250, Theta2=theta)
        np.testing.assert_allclose(told.p, alone(Theta2=theta).p, rtol=1e-12)


def test_e6_6_the_decomposition_is_2_to_the_17_and_the_joint_2_to_the_77() -> None:
    """The page counts 36 twice and so has 2^22; its 2^79 is rounded up."""
    joint = np.prod([float(len(v)) for v in fusing.variables])
    terms = sum(np.prod([float(len(v)) for v in term.variables]) for term in fusing.specification.terms)
    assert np.log2(joint) == pytest.approx(77.17, abs=0.01)
    assert terms == 36 + 8 * 512 * 36


def test_figure_6_poor_sensors_blend_to_certainty() -> None:
    """A light at 10 degrees: no sensor alone is sure, not even of the side, and the eight are."""
    seen = {f"L{i}": int(page_sensor(i - 1)[:, 18].argmax()) for i in range(1, 9)}
    assert locate(**seen).best() == 10
    assert locate(**seen)[10] > 0.9
    for i in range(1, 9):
        alone = fusing.ask(P(Theta2 | L[i - 1]))(**{f"L{i}": seen[f"L{i}"]})
        assert alone.p.max() < 0.5


def test_with_a_hidden_level_one_broken_sensor_is_outvoted_and_named() -> None:
    """A dimmer light than the plain model knows, at 40 degrees, and sensor 1 stuck bright."""
    apart = np.abs(40 - np.array(THETA))
    k = 1 - 1 / (1 + np.exp(-0.12 * (np.minimum(apart, 360 - apart) - 45)))
    seen = {f"L{i}": round(497 - 135 * float(b)) for i, b in enumerate(k, 1)}
    assert abs(locate_by_level(**seen).mean() - 40) < 10
    broken = seen | {"L1": 20}
    assert abs(locate_by_level(**broken).mean() - 40) < 10
    doubts = [out_of_order_by_level(i)(**{n: r for n, r in broken.items() if n != f"L{i}"}) for i in range(1, 9)]
    surprise = [float(doubt[broken[f"L{i}"]] / doubt.p.max()) for i, doubt in enumerate(doubts, 1)]
    assert int(np.argmin(surprise)) == 0


# Section 8.


def page_laplace(values: list[int]) -> Row:
    return np.array([(1 + values.count(v)) / (len(values) + 25) for v in range(25)])


def page_gaussian(values: list[int], size: int, floor: float) -> Row:
    return np.exp(normal(np.arange(float(size)), float(np.mean(values)), max(floor, float(np.std(values)))))


def page_object(tours: list[Evidence], tour: Evidence) -> Row:
    """[E8.2], O = 0 being uniform [S8.5] and a class without an object left out."""
    p: Row = np.zeros(16)
    p[0] = 1 / 25 * 1 / 25 * 1 / 10_000 * 1 / 1000
    for o in {t["O"] for t in tours}:
        seen = {name: [t[name] for t in tours if t["O"] == o] for name in ("Nlt", "Nrt", "Per", "Lrl")}
        p[o] = page_laplace(seen["Nlt"])[tour["Nlt"]] * page_laplace(seen["Nrt"])[tour["Nrt"]]
        p[o] *= page_gaussian(seen["Per"], 10_000, 5)[tour["Per"]]
        p[o] *= page_gaussian(seen["Lrl"], 1000, 12)[tour["Lrl"]]
    return np.asarray(p / p.sum())


def tours_of(rng: np.random.Generator, count: int) -> list[Evidence]:
    def near(value: int, deviation: float, largest: int) -> int:
        return int(np.clip(round(rng.normal(value, deviation)), 0, largest))

    made = []
    for _ in range(count):
        o = int(rng.integers(1, 8))
        tour = {"Nlt": near(o % 3, 0.4, 24), "Nrt": near(3 + o % 4, 0.6, 24)}
        made.append(tour | {"Per": near(300 + 80 * o, 6, 9999), "Lrl": near(30 * o, 8, 999), "O": o})
    return made


def asked(tour: Evidence) -> Evidence:
    return {name: value for name, value in tour.items() if name != "O"}


def test_e8_2_equals_the_page_after_any_number_of_tours() -> None:
    rng = np.random.default_rng(82)
    tours, knowing = tours_of(rng, 25), unacquainted
    for n, tour in enumerate(tours):
        if n % 4 == 0:
            question = knowing.ask(P(O | Nlt, Nrt, Per, Lrl))
            for other in tours_of(rng, 3):
                expected = page_object(tours[:n], other)
                np.testing.assert_allclose(question(**asked(other)).p, expected, rtol=1e-9, atol=1e-290)
        knowing = knowing.learn(tour)
    batch = pi_object.identify(tours).ask(P(O | Nlt, Nrt, Per, Lrl))
    for other in tours_of(rng, 5):
        np.testing.assert_allclose(
            batch(**asked(other)).p, knowing.ask(batch.term)(**asked(other)).p, rtol=1e-9, atol=1e-290
        )


def test_the_turns_of_a_class_follow_laplaces_law() -> None:
    """(1 + n_v) / (N + 25): footnote 16."""
    knowing = pi_object.identify([{"Nlt": 0, "Nrt": 4, "Per": 500, "Lrl": 10, "O": 2}] * 3)
    turns = knowing.ask(P(Nrt | O))
    assert turns(O=2)[4] == pytest.approx(4 / 28)
    assert turns(O=2)[5] == pytest.approx(1 / 28)
    np.testing.assert_allclose(turns(O=0).p, 1 / 25)


def test_who_has_met_no_object_calls_every_object_new() -> None:
    for tour in tours_of(np.random.default_rng(1), 20):
        assert recognise(**asked(tour))[0] == 1
    assert recognised(unacquainted, tours_of(np.random.default_rng(1), 1)[0]) == 1


def test_an_object_met_is_recognised_and_another_is_new_until_the_classes_are_used_up() -> None:
    def object_(number: int) -> Evidence:
        return {"Nlt": 0, "Nrt": 4, "Per": 300 + 100 * number, "Lrl": 20}

    knowing = unacquainted
    for number in range(15):
        o = recognised(knowing, object_(number))
        assert o == number + 1
        knowing = knowing.learn(object_(number) | {"O": o})
        assert recognised(knowing, object_(number) | {"Per": 303 + 100 * number}) == o
    with pytest.raises(DataError, match="all 15 classes"):
        recognised(knowing, object_(20))


# Section 9. Columns of tables 2 to 7: idle patrol recognition fire-intervention homing recharge.

T2 = np.array(
    [
        [0.9, 0.02, 0, 0, 0.02, 0.02],
        [0.05, 0.9, 0.0025, 1 / 3, 0.02, 0.02],
        [0, 0.02, 0.99, 0, 0.02, 0.02],
        [0.05, 0.02, 0.0025, 1 / 3, 0.02, 0.02],
        [0, 0.02, 0.0025, 0, 0.9, 0.02],
        [0, 0.02, 0.0025, 1 / 3, 0.02, 0.9],
    ]
)
T3 = np.array([[0.9, 0, 0, 0.5, 1, 0.5], [0.1, 1, 1, 0.5, 0, 0.5]])
T4 = np.array(
    [
        [0.325, 0, 0, 0.25, 0.25, 0.8],
        [0.325, 0.1, 0.1, 0.25, 0.25, 0.2],
        [0.25, 0.45, 0.45, 0.25, 0.25, 0],
        [0.1, 0.45, 0.45, 0.25, 0.25, 0],
    ]
)
T5 = np.array([[0, 0.99, 0.99, 0.5, 0.99, 0.99], [1, 0.01, 0.01, 0.5, 0.01, 0.01]])
T6 = np.array([[1, 1, 1, 0, 1, 1], [0, 0, 0, 1, 0, 0]])
T7 = np.array([[0.5, 0.5, 0, 0.5, 0.5, 0.5], [0.5, 0.5, 1, 0.5, 0.5, 0.5]])
BEHAVIORS = ("idle", "patrol", "recognition", "fire-intervention", "homing", "recharge")
ENERGIES = ("very-low", "low", "high", "very-high")


def page_behavior(vigil: bool, energy: str, base: bool, fire: bool, identify: bool, before: str | None) -> Row:
    """[E9.1] before its division; without Behavior_t-1 when that is not told."""
    last = T2[:, BEHAVIORS.index(before)] if before else T2.sum(axis=1)
    observed = T3[int(vigil)] * T4[ENERGIES.index(energy)] * T5[int(base)] * T6[int(fire)] * T7[int(identify)]
    return np.asarray(last * observed)


def page_always(vigil: bool, energy: str, base: bool, fire: bool, identify: bool, before: str) -> Row:
    p = page_behavior(vigil, energy, base, fire, identify, before)
    if p.sum() == 0:
        p = page_behavior(vigil, energy, base, fire, identify, None)
    return np.asarray(p / p.sum())


def test_e9_1_equals_the_page_for_all_384_combinations() -> None:
    truths = (False, True)
    strict = behaving.ask(P(Behavior | behavior.known))
    impossible = 0
    for row in product(truths, ENERGIES, truths, truths, truths, BEHAVIORS):
        known = {v.keyword: value for v, value in zip(behavior.known, row, strict=True)}
        assert [v.name for v in behavior.known] == ["Vigil", "Energy", "Base", "Fire", "Identify", "Behavior_t-1"]
        np.testing.assert_allclose(behavior(**known).p, page_always(*row), rtol=1e-12, atol=1e-300)
        possible = page_behavior(*row).sum() > 0
        assert behavior.possible(**known) == possible
        if not possible:
            impossible += 1
            with pytest.raises(ImpossibleEvidence):
                strict(**known)
    assert impossible == 18


F, T = False, True


@pytest.mark.parametrize(
    ("before", "vigil", "energy", "base", "fire", "identify", "expected"),
    [
        ("patrol", T, "high", F, F, F, {"patrol": 1}),
        ("patrol", T, "high", F, F, T, {"recognition": 0.0426, "patrol": 0.9574}),
        ("recognition", T, "high", F, F, T, {"recognition": 0.9987, "patrol": 0.0013}),
        ("recognition", T, "high", F, F, F, {"patrol": 1}),
        ("patrol", T, "low", F, F, F, {"patrol": 0.978, "recharge": 0.022}),
        ("patrol", T, "very-low", F, F, F, {"recharge": 1}),
        ("patrol", F, "high", F, F, F, {"homing": 1}),
        ("homing", F, "high", T, F, F, {"idle": 0.667, "homing": 0.333}),
        ("recharge", T, "very-low", T, F, F, {"idle": 0.153, "recharge": 0.847}),
        ("recharge", F, "very-low", T, F, F, {"idle": 0.616, "recharge": 0.379, "homing": 0.005}),
        ("recharge", T, "low", T, F, F, {"idle": 0.414, "recharge": 0.573, "patrol": 0.013}),
        ("idle", T, "very-low", T, F, F, {"idle": 1}),
        ("idle", T, "low", T, F, F, {"patrol": 0.0017}),
        ("idle", T, "high", T, F, F, {"patrol": 0.0099}),
        ("idle", T, "very-high", T, F, F, {"patrol": 0.0244}),
        ("patrol", T, "high", F, T, F, {"fire-intervention": 1}),
        ("fire-intervention", T, "high", F, F, F, {"patrol": 1}),
        ("fire-intervention", T, "low", F, F, F, {"patrol": 0.5, "recharge": 0.5}),
        ("homing", T, "high", F, F, F, {"patrol": 1}),
        # Where a row is impossible: an idle robot lifted off its base with Vigil off.
        ("idle", F, "high", F, F, F, {"homing": 1}),
    ],
)
def test_what_a_tick_makes_of_a_behavior(
    before: str, vigil: bool, energy: str, base: bool, fire: bool, identify: bool, expected: dict[str, float]
) -> None:
    answer = behavior(Vigil=vigil, Energy=energy, Base=base, Fire=fire, Identify=identify, Behavior_t_1=before)
    for value, p in expected.items():
        assert answer[value] == pytest.approx(p, abs=6e-4)


# Section 10: what the paper leaves out, typed from the programs' docstrings.

MOVES = ("stop", "wander", "home", "follow", "approach", "blow")


def page_move(behavior: str, last: str, tempo: str, tour: str) -> Row:
    p = np.zeros(6)
    of_move: dict[str, dict[str, float]] = {
        "stop": {"idle": 0.6, "patrol": 0.3, "recognition": 0.1},
        "wander": {"patrol": 1},
        "home": {"homing": 0.5, "recharge": 0.5},
        "follow": {"recognition": 1},
        "approach": {"fire-intervention": 1},
        "blow": {"fire-intervention": 1},
    }
    done = {"stop": 0.9, "wander": 0.1, "home": 0.5, "follow": 1e-5, "approach": 0.5, "blow": 0.5}
    for i, m in enumerate(MOVES):
        if m == last:
            stay = 0.9
        elif last == "blow" or (last == "approach" and m != "approach"):
            stay = 0.02
        else:
            stay = 0 if m == "blow" else 0.025
        elapsed = 0.02 if m == last else 0.99
        p[i] = stay * of_move[m].get(behavior, 0) * (elapsed if tempo == "elapsed" else 1 - elapsed)
        p[i] *= done[m] if tour == "done" else 1 - done[m]
    return np.asarray(p / p.sum())


def test_move_equals_the_page_for_all_evidence() -> None:
    for row in product(BEHAVIORS, MOVES, ("running", "elapsed"), ("undone", "done")):
        known = {v.keyword: value for v, value in zip(move.known, row, strict=True)}
        np.testing.assert_allclose(move(**known).p, page_move(*row), rtol=1e-11, atol=1e-300)
    assert Move.values == MOVES


@pytest.mark.parametrize(
    ("behavior", "last", "elapsed", "done", "expected"),
    [
        ("patrol", "wander", F, F, {"wander": 1}),
        ("patrol", "wander", T, F, {"stop": 0.044, "wander": 0.956}),
        ("patrol", "stop", F, F, {"stop": 0.992, "wander": 0.008}),
        ("patrol", "stop", T, F, {"stop": 0.024, "wander": 0.976}),
        ("recognition", "follow", F, F, {"follow": 1}),
        ("recognition", "follow", F, T, {"stop": 0.718, "follow": 0.282}),
        ("recognition", "wander", F, F, {"stop": 0.010, "follow": 0.990}),
        ("recognition", "stop", F, T, {"stop": 1}),
        ("fire-intervention", "wander", F, F, {"approach": 1}),
        ("fire-intervention", "approach", T, F, {"approach": 0.476, "blow": 0.524}),
        ("fire-intervention", "blow", F, F, {"blow": 1}),
        ("fire-intervention", "blow", T, F, {"approach": 0.524, "blow": 0.476}),
        ("homing", "wander", F, F, {"home": 1}),
        ("idle", "home", F, F, {"stop": 1}),
    ],
)
def test_what_a_tick_makes_of_a_move(
    behavior: str, last: str, elapsed: bool, done: bool, expected: dict[str, float]
) -> None:
    tempo, tour = "elapsed" if elapsed else "running", "done" if done else "undone"
    answer = move(Behavior=behavior, Move_t_1=last, Tempo=tempo, Tour=tour)
    for value, p in expected.items():
        assert answer[value] == pytest.approx(p, abs=6e-4)


LIGHT_AT_BASE = [0.033, 0.048, 0.066, 0.085, 0.102, 0.112, 0.114, 0.108]
LIGHT_AT_BASE += [0.094, 0.076, 0.057, 0.040, 0.027, 0.018, 0.012, 0.009]
LIGHT_ELSEWHERE = [0.006, 0.006, 0.006, 0.006, 0.006, 0.007, 0.008, 0.011]
LIGHT_ELSEWHERE += [0.021, 0.043, 0.082, 0.132, 0.176, 0.192, 0.172, 0.126]


def page_base_light() -> Row:
    """P(Li's neighbourhood | Base), shape (16, 2): .9 of a Gaussian and .1 uniform."""
    b = 32 * np.arange(16) + 16
    columns = [np.exp(-((b - 430) ** 2) / 2 / 70**2), np.exp(-((b - 200) ** 2) / 2 / 110**2)]
    return np.stack([0.9 * c / c.sum() + 0.1 / 16 for c in columns], axis=1)


def page_base_proximity() -> Row:
    b = np.arange(16)
    false, true = np.exp(-0.5 * b), np.exp(-0.15 * b)
    return np.stack([0.85 * false / false.sum() + 0.15 / 16, 0.7 * true / true.sum() + 0.3 / 16], axis=1)


def page_base(px: list[int], light: list[int]) -> Row:
    """P(Base | Px1 ... L8)."""
    logs = sum((np.log(page_base_proximity()[r >> 6]) for r in px), np.zeros(2))
    return normalised(logs + sum((np.log(page_base_light()[r >> 5]) for r in light), np.zeros(2)))


def test_base_equals_the_page() -> None:
    np.testing.assert_allclose(page_base_light().T, [LIGHT_ELSEWHERE, LIGHT_AT_BASE], atol=6e-4)
    rng = np.random.default_rng(10)
    for _ in range(50):
        px, light = rng.integers(1024, size=8).tolist(), rng.integers(512, size=8).tolist()
        known = {f"Px{i}": r for i, r in enumerate(px, 1)} | {f"L{i}": r for i, r in enumerate(light, 1)}
        np.testing.assert_allclose(at_base(**known).p, page_base(px, light), rtol=1e-9)


def test_three_bright_sensors_are_no_base() -> None:
    """Facing a lamp in the open."""
    known = {f"Px{i}": 0 for i in range(1, 9)}
    lights = (480, 300, 80, 60, 300, 480, 490, 490)
    assert at_base(**known, **{f"L{i}": r for i, r in enumerate(lights, 1)})[True] < 0.01
    inside = {f"Px{i}": r for i, r in enumerate((700, 400, 200, 200, 400, 700, 60, 60), 1)}
    assert at_base(**inside, **{f"L{i}": 210 for i in range(1, 9)})[True] > 0.99


def page_follow(dir_: int, prox: int) -> Row:
    mean = 3.0 if prox == 0 else -10.0 if dir_ <= 0 else -2 * max(0, 9 - dir_) + 0.6 * (8 - prox)
    return np.exp(normal(np.arange(-10.0, 11), float(np.clip(mean, -10, 10)), 1))


def page_speed(m: str, h: str, e: Evidence, theta: int) -> Row:
    """P(Vrot Vtrans | Move H Dir Prox DirL ProxL Vtrans_c Theta2), shape (21, 11)."""
    v, c = np.arange(-10.0, 11), e["Vtrans_c"]
    if m in ("stop", "blow"):
        return np.outer(v == 0, np.arange(11) == 0).astype(np.float64)
    avoid = page_avoid(e["Dir"], e["Prox"])
    if m == "wander":
        vrot, s = avoid, 1.0
    elif m == "follow":
        vrot, s = page_follow(e["Dir"], e["Prox"]), 0.6
    elif m == "home":
        vrot, s = avoid if h == "avoidance" else page_phototaxy(theta), max(0.3, 1 - 0.06 * e["Prox"])
    else:
        aim = h == "phototaxy" or e["ProxL"] >= 8
        vrot = np.exp(normal(v, e["DirL"], 2)) if aim else avoid
        s = 1 if e["ProxL"] < 8 else 0.5 if e["ProxL"] < 12 else 0
    return np.outer(vrot, np.exp(normal(np.arange(11.0), s * c, 0.7)))


def sensed(rng: np.random.Generator) -> Evidence:
    """A value for each of the 33 sensory variables."""
    return {v.keyword: v.values[int(rng.integers(len(v)))] for v in Sensory_variables}


def page_sensed_behavior(e: Evidence) -> Row:
    """[E10.5]"""
    base = page_base([e[f"Px{i}"] for i in range(1, 9)], [e[f"L{i}"] for i in range(1, 9)])
    told = (e["Fire"], e["Identify"], e["Behavior_t_1"])
    return np.asarray(sum(base[int(b)] * page_always(e["Vigil"], e["Energy"], b, *told) for b in (False, True)))


def page_motors(e: Evidence) -> Row:
    """[E10.4] without O, shape (21, 11)."""
    behaviors = page_sensed_behavior(e)
    moves = sum(
        p * page_move(b, e["Move_t_1"], e["Tempo"], e["Tour"]) for b, p in zip(BEHAVIORS, behaviors, strict=True)
    )
    light = page_fusion(tuple(e[f"L{i}"] for i in range(1, 9)))
    avoidance = page_command(e["Prox"])
    p = np.zeros((21, 11))
    for m, p_move in zip(MOVES, np.asarray(moves), strict=True):
        for h, p_h in (("avoidance", avoidance), ("phototaxy", 1 - avoidance)):
            for theta, p_theta in zip(BEARING, light, strict=True):
                p += p_move * p_h * p_theta * page_speed(m, h, e, int(theta))
    return np.asarray(p / p.sum())


def test_speed_equals_the_page() -> None:
    rng = np.random.default_rng(11)
    for _ in range(100):
        e: Evidence = {v.keyword: v.values[int(rng.integers(len(v)))] for v in speed.known}
        expected = page_speed(e["Move"], e["H"], e, e["Theta2"])
        np.testing.assert_allclose(speed(**e).p, expected, rtol=1e-9, atol=1e-300)


def test_e10_4_equals_the_page() -> None:
    rng = np.random.default_rng(104)
    for _ in range(15):
        e = sensed(rng)
        answer = watchman(**e)
        assert answer.variables == (Vrot, Vtrans, O)
        np.testing.assert_allclose(answer.p[..., 0], page_motors(e), rtol=1e-8, atol=1e-14)
        assert answer.p[..., 1:].sum() == 0


def test_e10_4_recognises_objects_independently_of_the_motors() -> None:
    """ "Recognizing the object is independent of the Khepera control." """
    rng = np.random.default_rng(105)
    tours = tours_of(rng, 12)
    knowing = pi_object.identify(tours, name="delta-object").ask(P(O | Nlt, Nrt, Per, Lrl))
    question = pi_watchman(knowing).identify().ask(P(Vrot, Vtrans, O | Sensory_variables))
    for tour in tours_of(rng, 4):
        e = sensed(rng) | asked(tour)
        expected = page_motors(e)[..., None] * page_object(tours, tour)
        np.testing.assert_allclose(question(**e).p, expected, rtol=1e-8, atol=1e-14)


def test_e10_5_holds_whatever_move_tempo_tour_and_prox_are() -> None:
    """A term of E10.2 is a question and no evidence: P(Behavior | Sensory-variables) is E10.5."""
    rng = np.random.default_rng(106)
    question = watching.ask(P(Behavior | Sensory_variables))
    for _ in range(20):
        e = sensed(rng)
        for other in (e, sensed(rng), sensed(rng)):
            changed = e | {name: other[name] for name in ("Move_t_1", "Tempo", "Tour", "Prox")}
            np.testing.assert_allclose(question(**changed).p, page_sensed_behavior(e), rtol=1e-9, atol=1e-300)


def test_e10_5_is_not_soft_evidence_on_base() -> None:
    """Homing, Vigil off, Energy high, P(Base) one half: idle one third; as soft evidence it would be a fiftieth."""
    known = {"Vigil": False, "Energy": "high", "Fire": False, "Identify": False, "Behavior_t_1": "homing"}
    by_e10_5 = sum(0.5 * behavior(Base=base, **known)["idle"] for base in (False, True))
    assert by_e10_5 == pytest.approx(0.333, abs=5e-4)
    soft = sum(page_behavior(False, "high", base, False, False, "homing") for base in (False, True))
    assert np.asarray(soft)[0] / np.asarray(soft).sum() == pytest.approx(0.0196, abs=5e-4)


def test_e10_1_to_e10_3_the_watchman_has_41_variables_12_descriptions_and_4_levels() -> None:
    text = str(watchman)
    assert "41 variables: 3 searched, 33 known, 5 unknown (Base Theta2 Behavior Move H)" in text
    assert "12 descriptions on 4 levels:" in text
    assert text.startswith("P(Vrot Vtrans O | Px1 Px2 Px3 Px4 Px5 Px6 Px7 Px8 L1 ")
    # The nesting of E10.4: Base inside Behavior, Behavior inside Move.
    assert "× Σ_{Behavior} [ P(Move | Behavior Move_t-1 Tempo Tour pi-move) × Σ_{Base} [ P(Base | Px1 " in text
    assert Behavior_t_1 in Sensory_variables
