from math import floor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.perception import LightBearing, Obstacle, Readings

eight = st.tuples(*[st.integers(0, 1023)] * 8)


@given(eight)
def test_dir_and_prox_are_the_papers_formulas_and_stay_in_range(px: tuple[int, ...]) -> None:
    values = Obstacle().step(Readings(proximity=px)).values
    # E4.1 and E4.2 as printed, sensor by sensor
    numerator = 90 * (px[5] - px[0]) + 45 * (px[4] - px[1]) + 5 * (px[3] - px[2])
    assert values["Dir"] == floor(numerator / (9 * (1 + sum(px[:6]))))
    assert values["Prox"] == floor(max(px[:6]) / 64)
    assert -10 <= values["Dir"] <= 10
    assert 0 <= values["Prox"] <= 15


@pytest.mark.parametrize(
    ("px", "dir_", "prox"),
    [
        ((0,) * 8, 0, 0),
        ((1023, 0, 0, 0, 0, 0, 0, 0), -10, 15),
        ((0, 0, 0, 0, 0, 1023, 0, 0), 9, 15),  # with Floor 10 is out of reach
        ((0, 0, 3, 0, 0, 0, 0, 0), -1, 0),  # the least imbalance to the left
        ((0, 0, 700, 700, 0, 0, 0, 0), 0, 10),
        ((0,) * 6 + (1023, 1023), 0, 0),  # what is behind does not count
    ],
)
def test_dir_and_prox_of_known_situations(px: tuple[int, ...], dir_: int, prox: int) -> None:
    assert Obstacle().step(Readings(proximity=px)).values == {"Dir": dir_, "Prox": prox}


def lamp(bearing_index: int) -> tuple[int, ...]:
    return tuple(100 if i == bearing_index else 490 for i in range(8))


@pytest.mark.parametrize(("sensor", "theta"), [(0, -90), (1, -40), (2, -10), (3, 10), (4, 40), (5, 90), (6, 180)])
def test_theta1_points_to_the_one_bright_sensor_clockwise_positive(sensor: int, theta: int) -> None:
    assert LightBearing().step(Readings(light=lamp(sensor))).values["Theta1"] == theta


@given(eight)
def test_theta1_takes_its_36_values_only_and_clipping_is_counted(light: tuple[int, ...]) -> None:
    percept = LightBearing().step(Readings(light=light))
    assert percept.values["Theta1"] in range(-170, 190, 10)
    assert percept.clipped == {f"L{i}": 1 for i, value in enumerate(light, 1) if value > 511}


@given(st.tuples(*[st.integers(480, 504)] * 8))
def test_noise_in_the_dark_is_no_source(light: tuple[int, ...]) -> None:
    assert LightBearing().step(Readings(light=light)).values["Theta1"] == 0


@given(eight)
def test_mirrored_readings_give_the_mirrored_bearing(light: tuple[int, ...]) -> None:
    mirrored = (*light[5::-1], light[7], light[6])
    theta = LightBearing().step(Readings(light=light)).values["Theta1"]
    back = LightBearing().step(Readings(light=mirrored)).values["Theta1"]
    # A bearing exactly between two steps may be rounded to either.
    assert (theta + back) % 360 in (0, 10, 350)
