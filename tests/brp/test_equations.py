"""The paper's numbered equations of sections 6, 8 and 9, typed once in plain numpy straight from the page.

Those of sections 5 and 7 are in `test_programs`, those of section 10 in `test_watchman`. Nothing here but the
questions asked comes from brp: tables and parameters are typed again, so that a slip in a program shows.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brp import DataError, ImpossibleEvidence, P
from brp.filter import Filter
from brp.programs.behavior import Base, Behavior, Behavior_t_1, Energy, Fire, Identify, Vigil, behaving, behavior
from brp.programs.fusion import L, N, fusing, locate, locate_scaled, out_of_order
from brp.programs.level import locate as locate_by_level
from brp.programs.level import out_of_order as out_of_order_by_level
from brp.programs.object import Lrl, Nlt, Nrt, O, Per, pi_object, recognise, recognised, unacquainted
from brp.programs.sensor import Theta2, sensor

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


# L by how far a lamp is (mm) and how far off a sensor's direction (degrees): an ambient light table sampled on a
# Khepera (light.sam of the PhD Active Vision System Simulator), converted to 0..511.
OFF = (0, 15, 30, 45, 60, 75, 90, 135, 180)
LIGHT_TABLE = {
    73: (72, 75, 91, 227, 410, 470, 480, 491, 494),
    133: (272, 285, 320, 379, 439, 485, 488, 494, 496),
    213: (396, 398, 417, 441, 468, 489, 493, 494, 496),
    313: (450, 455, 461, 470, 485, 492, 497, 496, 496),
}


def lit(mm: int, bearing: int, rng: np.random.Generator) -> Evidence:
    """What eight sensors read of a lamp, with the noise that was measured."""
    off = [abs((bearing - theta + 180) % 360 - 180) for theta in THETA]
    read = np.rint(np.interp(off, OFF, LIGHT_TABLE[mm]) + rng.normal(0, 4.4, 8))
    return {f"L{i}": int(np.clip(r, 0, 511)) for i, r in enumerate(read, 1)}


def page_error(p: Row, bearing: int) -> float:
    apart = np.abs(BEARING - bearing)
    return float(p @ np.minimum(apart, 360 - apart))


@pytest.mark.parametrize("mm", LIGHT_TABLE)
def test_a_hidden_level_finds_the_light_of_a_measured_khepera_near_and_far(mm: int) -> None:
    rng = np.random.default_rng(mm)
    frames = [(int(b), lit(mm, int(b), rng)) for b in BEARING]
    plain = np.mean([page_error(locate(**read).p, b) for b, read in frames])
    by_level = np.mean([page_error(locate_by_level(**read).p, b) for b, read in frames])
    assert by_level < 12
    assert mm < 200 or plain > 45


def test_with_a_hidden_level_a_sensor_stuck_bright_is_outvoted_and_named() -> None:
    rng, errors = np.random.default_rng(6), []
    for bearing in range(-170, 181, 50):
        for broken in range(1, 9):
            read = lit(213, bearing, rng) | {f"L{broken}": 60}
            errors.append(page_error(locate_by_level(**read).p, bearing))
            doubts = [
                out_of_order_by_level(i)(**{n: r for n, r in read.items() if n != f"L{i}"}) for i in range(1, 9)
            ]
            surprise = [doubt[read[f"L{i}"]] / doubt.p.max() for i, doubt in enumerate(doubts, 1)]
            assert int(np.argmin(surprise)) + 1 == broken
    assert np.mean(errors) < 15


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


def test_a_belief_about_the_last_behavior_goes_inside_the_program() -> None:
    """Half patrol, half recognition, Identify: to mix the two answers by the belief is something else."""
    tick: Evidence = {"Vigil": True, "Energy": "high", "Base": False, "Fire": False, "Identify": True}
    carried = Filter(behaving, {Behavior: Behavior_t_1}, known=(Vigil, Energy, Base, Fire, Identify))
    start = behaving.ask(P(Behavior | Vigil, Energy, Base, Fire, Identify))(**tick)
    half = type(start)(start.variables, np.array([0, 0.5, 0.5, 0, 0, 0]))
    expected = T2 @ half.p * T3[1] * T4[2] * T5[0] * T6[0] * T7[1]
    answer = carried.step(half, **tick)
    np.testing.assert_allclose(answer.p, expected / expected.sum(), rtol=1e-12)
    assert answer["recognition"] == pytest.approx(0.691, abs=5e-4)
    mixture = sum(0.5 * behavior(**tick, Behavior_t_1=b)["recognition"] for b in ("patrol", "recognition"))
    assert mixture == pytest.approx(0.521, abs=5e-4)
