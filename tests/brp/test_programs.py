"""The paper's equations, typed in plain numpy from the page, against the programs declared from it."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from brp import Gaussian, P, Specification
from brp.programs.home import H, Theta1, command, home, homing
from brp.programs.obstacle import Dir, Prox, Vrot, avoid, avoiding, obstacle
from brp.programs.phototaxy import phototaxy1

Row = NDArray[np.float64]
v = np.arange(-10, 11)


def gauss(mean: float, deviation: float) -> Row:
    exponent = -0.5 * ((v - mean) / deviation) ** 2
    weight = np.exp(exponent - exponent.max())
    return np.asarray(weight / weight.sum())


def page_avoid(dir_: int, prox: int) -> Row:
    """One Gaussian for each (Dir, Prox) [S5.3]: the saturating table."""
    if prox == 0:
        return gauss(0, 1.5)
    s = -1 if dir_ == 0 else np.sign(dir_)
    w = 1 if abs(dir_) <= 6 else 1 + (prox / 15 - 1) * (abs(dir_) - 6) / 4
    return gauss(-s * 10 * min(1, prox / 4) * w, 0.7)


def page_phototaxy(theta: int) -> Row:
    return gauss(np.clip(round(10 * theta / 90), -10, 10), 2)


def page_command(prox: int) -> float:
    """P(avoidance | Prox) [S7.5]."""
    return float(1 / (1 + np.exp(-4 * 0.25 * (prox - 9))))


def test_the_avoidance_turns_right_for_what_is_ahead() -> None:
    assert avoid(Dir=0, Prox=8).best() == 10
    assert avoid(Dir=-1, Prox=8).best() == 10
    assert avoid(Dir=1, Prox=8).best() == -10
    assert avoid(Dir=3, Prox=0).best() == 0


def test_e5_1_the_joint_distribution_is_the_product_of_the_terms() -> None:
    joint = avoiding.ask(P(Dir, Prox, Vrot))()
    for dir_, prox in product(Dir.values, Prox.values):
        expected = 1 / 21 * 1 / 16 * page_avoid(int(dir_), int(prox))
        np.testing.assert_allclose(joint.p[int(dir_) + 10, int(prox)], expected, rtol=1e-12)


def test_e5_2_equals_the_page_for_all_evidence() -> None:
    for dir_, prox in product(Dir.values, Prox.values):
        np.testing.assert_allclose(avoid(Dir=dir_, Prox=prox).p, page_avoid(int(dir_), int(prox)), rtol=1e-12)
    assert str(avoid) == "P(Vrot | Prox Dir delta-avoid pi-obstacle)"


def test_e5_3_knows_the_direction_only() -> None:
    """P(Vrot | Dir): the mean over Prox, which is uniform."""
    question = obstacle.identify(
        name="delta-push", parameters={P(Vrot | Prox, Dir): Gaussian(lambda Dir: Dir, lambda Prox: 18 - Prox)}
    ).ask(P(Vrot | Dir))
    for dir_ in Dir.values:
        expected = np.mean([gauss(float(dir_), 18 - prox) for prox in range(16)], axis=0)
        np.testing.assert_allclose(question(Dir=dir_).p, expected, rtol=1e-12)
    assert str(question) == "P(Vrot | Dir delta-push pi-obstacle)\n= " + (
        "1/Σ × Σ_{Prox} [ P(Vrot | Prox Dir delta-push pi-obstacle) ]"
    )


def test_phototaxy_equals_the_page_for_all_evidence() -> None:
    for theta in Theta1.values:
        np.testing.assert_allclose(phototaxy1(Theta1=theta).p, page_phototaxy(int(theta)), rtol=1e-12)


def test_e7_1_equals_the_page_for_all_evidence() -> None:
    for dir_, prox, theta in product(range(-10, 11), range(16), range(-170, 181, 10)):
        avoidance = page_command(prox)
        sum_over_h = avoidance * page_avoid(dir_, prox) + (1 - avoidance) * page_phototaxy(theta)
        np.testing.assert_allclose(
            home(Dir=dir_, Prox=prox, Theta1=theta).p, sum_over_h / sum_over_h.sum(), rtol=1e-12
        )


def test_e7_1_prints_as_the_page_has_it() -> None:
    assert str(home) == (
        "P(Vrot | Dir Prox Theta1 pi-home)\n"
        "= [ P(avoidance | Prox pi-home) × P(Vrot | Prox Dir delta-avoid pi-obstacle)\n"
        "  + P(phototaxy | Prox pi-home) × P(Vrot | Theta1 delta-phototaxy pi-phototaxy1) ]\n"
        "5 variables: 1 searched, 3 known, 1 unknown (H)\n"
        "3 descriptions on 2 levels:\n"
        "  pi-home\n"
        "    delta-avoid pi-obstacle\n"
        "    delta-phototaxy pi-phototaxy1"
    )


def test_the_command_variable_is_the_sigmoid_of_figure_7() -> None:
    printed = [0.0001, 0.0003, 0.0009, 0.0025, 0.0067, 0.018, 0.047, 0.119]
    printed += [0.269, 0.5, 0.731, 0.881, 0.953, 0.982, 0.993, 0.998]
    for prox, p in enumerate(printed):
        assert command(Prox=prox)["avoidance"] == pytest.approx(p, abs=6e-4)


def test_the_command_variable_can_be_asked_for_from_what_the_robot_did() -> None:
    """Not one of the paper's questions: any may be asked. A left turn with the light at the left is phototaxy."""
    question = homing.ask(P(H | Vrot, Dir, Prox, Theta1))
    for vrot, prox in product((-10, 0, 10), (0, 8, 15)):
        avoidance = page_command(prox)
        both = np.array(
            [avoidance * page_avoid(-5, prox)[vrot + 10], (1 - avoidance) * page_phototaxy(-90)[vrot + 10]]
        )
        np.testing.assert_allclose(
            question(Vrot=vrot, Dir=-5, Prox=prox, Theta1=-90).p, both / both.sum(), rtol=1e-11
        )


def test_figures_9_and_10_the_nearer_the_object_the_surer_the_turn_away() -> None:
    """Object and light at the left; deviation (18 - Prox)/3, with which the prose of the figures holds."""
    shown = obstacle.identify(
        name="delta-avoid",
        parameters={P(Vrot | Prox, Dir): Gaussian(lambda Dir: -Dir, lambda Prox: max(1, (18 - Prox) / 3))},
    )
    term = P(Vrot | Dir, Prox, Theta1, H)
    forms = dict(homing.specification.forms)
    switch = type(forms[term])(H, {"avoidance": shown.ask(P(Vrot | Prox, Dir)), "phototaxy": phototaxy1})  # type: ignore[call-arg]  # a Switch
    question = Specification(forms | {term: switch}).identify().ask(P(Vrot | Dir, Prox, Theta1))
    for prox, right in ((8, 0.24), (9, 0.47), (12, 0.94), (15, 0.998)):
        answer = question(Dir=-5, Prox=prox, Theta1=-90)
        assert answer.p[v > 0].sum() == pytest.approx(right, abs=0.005)


def test_pushing_is_taught_by_changing_the_data_only() -> None:
    rng = np.random.default_rng(1)
    teacher = obstacle.identify(
        parameters={P(Vrot | Prox, Dir): Gaussian(lambda Dir: Dir, lambda Prox: (18 - Prox) / 3)}
    ).ask(P(Vrot | Prox, Dir))
    rows = [{"Dir": int(rng.integers(-10, 11)), "Prox": int(rng.integers(1, 16))} for _ in range(300)]
    data = [row | {"Vrot": teacher(**row).draw(rng)} for row in rows]
    push = obstacle.identify(data, name="delta-push").ask(P(Vrot | Prox, Dir))
    assert str(push) == "P(Vrot | Prox Dir delta-push pi-obstacle)"
    error = [push(Dir=d, Prox=p).mean() - np.clip(d, -8, 8) for d in range(-10, 11) for p in range(8, 16)]
    assert np.abs(error).mean() < 1.6
