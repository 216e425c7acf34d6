"""The score's definitions, step by step."""

import re

import pytest

from khepera_hil.world.score import Score

STEP = 0.005


def run(
    touches: str, *, base: tuple[float, float, float, float] | None = None, x: float = 500.0
) -> dict[str, object]:
    """One letter a step: ``#`` touches something."""
    score = Score((x, 0.0), base)
    for step, letter in enumerate(touches, 1):
        score.step(step * STEP, STEP, (x, 0.0), letter == "#")
    return dict(score.figures())


def test_nothing_happened() -> None:
    figures = run("." * 100)
    never = {name for name, value in figures.items() if value is None}
    assert never == {"base_reached_s", "lamp_reached_s", "fire_burned_longest_s"}
    assert all(value == 0 for name, value in figures.items() if name not in never)
    assert set(figures) == set(re.findall(r"^ {8}([a-z_]+)$", Score.figures.__doc__ or "", re.MULTILINE))


def test_a_contact_lasts_from_its_first_step_to_its_last() -> None:
    assert run("..####..")["contact_longest_s"] == pytest.approx(0.020)


def test_touches_at_most_fifty_milliseconds_apart_are_one_contact() -> None:
    assert run("##" + "." * 10 + "##")["contact_longest_s"] == pytest.approx(14 * STEP)
    assert run("##" + "." * 11 + "###")["contact_longest_s"] == pytest.approx(3 * STEP)


def test_contacts_longer_than_half_a_second_are_counted_once_each() -> None:
    assert run("#" * 100)["contacts_over_half_second"] == 0
    assert run("#" * 101)["contacts_over_half_second"] == 1
    assert run("#" * 400 + "." * 20 + "#" * 101 + "." * 20 + "#" * 50)["contacts_over_half_second"] == 2


def test_inside_the_base_no_contact_counts() -> None:
    figures = run("#" * 300, base=(400, -100, 600, 100))
    assert figures["contact_longest_s"] == 0
    assert figures["base_reached_s"] == 0


def test_the_base_is_reached_when_the_centre_is_in_its_square_and_the_first_time_stands() -> None:
    score = Score((0.0, 0.0), (10, -5, 20, 5))
    for step in range(1, 41):
        score.step(step * STEP, STEP, (float(step), 0.0), False)
    assert score.figures()["base_reached_s"] == pytest.approx(10 * STEP)
    assert score.figures()["distance_m"] == pytest.approx(0.040)
