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


def test_the_lamp_is_reached_sixty_millimetres_from_its_foot() -> None:
    score = Score((0.0, 0.0), None, (100.0, 0.0))
    for step, x in enumerate((39.0, 40.0, 100.0), 1):
        score.step(step * STEP, STEP, (x, 0.0), False)
    assert score.figures()["lamp_reached_s"] == pytest.approx(2 * STEP)


def test_a_thing_has_moved_beyond_ten_millimetres_and_its_shift_is_as_the_crow_flies() -> None:
    score = Score((0.0, 0.0), None)
    for name in ("still", "cube", "taken", "carried"):
        score.put(name, (100.0, 100.0))
    score.taken("taken", (100.0, 130.0))
    score.taken("carried", (105.0, 100.0))
    score.put("carried", (500.0, 500.0))  # by hand, which is not the robot's doing
    figures = score.figures([("still", (110.0, 100.0)), ("cube", (130.0, 140.0)), ("carried", (500.0, 503.0))])
    assert figures["objects_moved"] == 2
    assert figures["objects_moved_m"] == pytest.approx(0.080)
    assert figures["object_moved_most_m"] == pytest.approx(0.050)


def test_a_fire_burns_from_its_lighting_to_its_end_and_only_the_turbines_work_counts() -> None:
    score = Score((0.0, 0.0), None)
    for name, now in (("first", 1.0), ("second", 2.0), ("third", 3.0)):
        score.lit(name, now)
    score.put_out("second", 9.0)
    score.put_out("first", 4.0)
    score.burned_down("third")
    score.put_out("third", 100.0)
    score.put_out("a bulb", 100.0)
    figures = score.figures()
    assert (figures["fires_lit"], figures["fires_put_out"]) == (3, 2)
    assert figures["fire_burned_longest_s"] == 7.0


def test_an_alarm_is_false_when_no_mover_was_in_view_for_a_second() -> None:
    score = Score((0.0, 0.0), None)
    score.alarm(1.0)
    score.entered()
    for now in (2.0, 2.05):
        score.saw("mouse", now, 0.05)
        score.saw("ball", now, 0.05)
    score.alarm(3.05)
    score.alarm(3.06)
    figures = score.figures()
    assert (figures["alarms"], figures["alarms_false"]) == (3, 2)
    assert (figures["movers_entered"], figures["movers_seen"]) == (1, 2)
    assert figures["movers_in_view_s"] == pytest.approx(0.2)
