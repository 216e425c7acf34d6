"""Section 10 typed in plain numpy: E10.1 to E10.5, and the programs of which the paper names only variables."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from brp import P
from brp.programs.base import at_base
from brp.programs.behavior import Base, Behavior, Behavior_t_1, behaving, behavior
from brp.programs.move import Move, move
from brp.programs.object import Lrl, Nlt, Nrt, O, Per, pi_object
from brp.programs.speed import speed
from brp.programs.watchman import Sensory_variables, Vrot, Vtrans, pi_watchman, watching, watchman
from tests.brp.test_equations import (
    BEARING,
    BEHAVIORS,
    Evidence,
    asked,
    normal,
    normalised,
    page_always,
    page_behavior,
    page_fusion,
    page_object,
    tours_of,
)
from tests.brp.test_programs import page_avoid, page_command, page_phototaxy

Row = NDArray[np.float64]
F, T = False, True


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


def page_glare(e: Evidence) -> Row:
    """Away from the light, as from an obstacle, or away from an obstacle."""
    side = 1 if e["DirL"] > 0 else -1
    turn = -side * (10.0 if abs(e["DirL"]) <= 5 else 4.0)
    if e["Prox"] >= 4:
        away = 1 if e["Dir"] > 0 else -1
        aside = max(0, abs(e["Dir"]) - 6) / 4
        turn = -away * 10 * (1 - aside * (1 - e["Prox"] / 15))
    return np.exp(normal(np.arange(-10.0, 11), turn, 1))


def page_speed(m: str, h: str, e: Evidence, theta: int) -> Row:
    """P(Vrot Vtrans | Move H Dir Prox DirL ProxL Vtrans_c Theta2), shape (21, 11)."""
    v, c = np.arange(-10.0, 11), e["Vtrans_c"]
    if m in ("stop", "blow"):
        return np.outer(v == 0, np.arange(11) == 0).astype(np.float64)
    avoid = page_avoid(e["Dir"], e["Prox"])
    if m == "wander":
        vrot, s = page_glare(e) if e["ProxL"] in (12, 13) else avoid, 2.0 if e["ProxL"] >= 14 else 1.0
    elif m == "follow":
        vrot, s = page_follow(e["Dir"], e["Prox"]), 0.6
    elif m == "home":
        vrot, s = avoid if h == "avoidance" else page_phototaxy(theta), max(0.3, 1 - 0.06 * e["Prox"])
    else:
        beside = h == "avoidance" and e["ProxL"] >= 12 and abs(e["Dir"]) > 2 and abs(e["Dir"] - e["DirL"]) > 5
        aim = (-3 if e["Dir"] > 0 else 3) if beside else e["DirL"]
        vrot = np.exp(normal(v, aim, 2)) if h == "phototaxy" or e["ProxL"] >= 12 else avoid
        s = 1 if e["ProxL"] < 12 else 0.5 if e["ProxL"] < 15 else 0
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
    softly = behaving.ask(P(Behavior | behavior.known), soft=Base)
    np.testing.assert_allclose(softly(**known, Base=[0.5, 0.5]).p, soft / np.asarray(soft).sum(), rtol=1e-12)


def test_e10_1_to_e10_3_the_watchman_has_41_variables_12_descriptions_and_4_levels() -> None:
    text = str(watchman)
    assert "41 variables: 3 searched, 33 known, 5 unknown (Base Theta2 Behavior Move H)" in text
    assert "12 descriptions on 4 levels:" in text
    assert text.startswith("P(Vrot Vtrans O | Px1 Px2 Px3 Px4 Px5 Px6 Px7 Px8 L1 ")
    # The nesting of E10.4: Base inside Behavior, Behavior inside Move.
    assert "× Σ_{Behavior} [ P(Move | Behavior Move_t-1 Tempo Tour pi-move) × Σ_{Base} [ P(Base | Px1 " in text
    # What neither Move nor H decides is not said to be at a value of theirs; equal cases are one.
    assert "Σ_{Theta2} [ P(Theta2 | L1 L2 L3 L4 L5 L6 L7 L8 pi-fusion) × P(Vrot | Theta2 " in text
    assert "{ ProxL = 0..11: P(Vrot | Prox Dir delta-avoid pi-obstacle)" in text
    assert Behavior_t_1 in Sensory_variables
