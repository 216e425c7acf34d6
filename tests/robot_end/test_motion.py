"""The motion controllers on the emulated motors: the manual's three modes, and what the gains do."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.motion import Mode, Motion
from khepera_hil.units import ENCODER_PULSES_PER_MM, SPEED_UNIT_MM_S
from khepera_hil.world.wheels import Wheels

_STEP = 0.005


class Bench:
    """Wheels off the floor; everything in pulses and periods of 10 ms."""

    def __init__(self) -> None:
        self.wheels = Wheels((0.0, 0.0), np.random.default_rng(0), _STEP)
        self.motion: Motion = self.wheels.motion

    def run(self, seconds: float) -> list[float]:
        """The left wheel's speed after each step, pulse/10 ms."""
        speeds = []
        for _ in range(round(seconds / _STEP)):
            before = self.wheels.travel[0]
            self.wheels.advance()
            speeds.append((self.wheels.travel[0] - before) / _STEP / SPEED_UNIT_MM_S)
        return speeds

    @property
    def ways(self) -> list[float]:
        return [way * ENCODER_PULSES_PER_MM for way in self.wheels.travel]

    @property
    def counters(self) -> list[int]:
        return self.motion.counters(self.ways)

    @property
    def status(self) -> list[int]:
        before, after = self.wheels.window
        speeds = [
            math.floor(b * ENCODER_PULSES_PER_MM) - math.floor(a * ENCODER_PULSES_PER_MM)
            for a, b in zip(before, after, strict=True)
        ]
        return self.motion.status(speeds, self.ways)


@pytest.mark.parametrize("asked", [1, -3, 8, 20, -60, 127])
def test_with_the_reset_gains_a_wheel_follows_as_a_lag_of_sixty_milliseconds(asked: int) -> None:
    bench = Bench()
    bench.motion.set_speed(asked, asked)
    share, most, ideal = 1 - math.exp(-_STEP / 0.060), 1000 * _STEP / SPEED_UNIT_MM_S, 0.0
    for speed in bench.run(2.0):
        ideal += min(max((asked - ideal) * share, -most), most)
        assert speed == pytest.approx(ideal, abs=0.012 * abs(asked))
        assert abs(speed) <= abs(asked) * (1 + 1e-6)  # no overshoot


def test_a_speed_is_held_exactly_and_for_ever() -> None:
    bench = Bench()
    bench.motion.set_speed(5, -7)
    bench.run(3.0)
    before = bench.ways
    bench.run(60.0)
    assert [after - way for way, after in zip(before, bench.ways, strict=True)] == pytest.approx([30000, -42000])
    assert bench.status == [1, Mode.SPEED, 0, 1, Mode.SPEED, 0]


def test_the_speed_gains_change_how_a_wheel_follows() -> None:
    def speeds(*gains: int) -> list[float]:
        bench = Bench()
        bench.motion.set_speed_gains(*gains)
        bench.motion.set_speed(20, 20)
        return bench.run(3.0)

    assert max(speeds(0, 0, 0)) == 0  # nothing moves it
    assert max(speeds(3800, 800, 100)) < 20.01
    assert max(speeds(3800, 8000, 100)) > 21.5  # too much of the sum overshoots
    assert 5 < speeds(3800, 0, 100)[-1] < 15  # without it the wheel stays behind
    assert speeds(500, 50, 0)[100] < 10  # and little of all is slow


def test_gains_of_zero_stop_a_wheel_that_turns() -> None:
    bench = Bench()
    bench.motion.set_speed(20, 20)
    bench.run(1.0)
    bench.motion.set_speed_gains(0, 0, 0)
    assert bench.run(1.0)[-1] == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("target", [(600, 600), (-600, 600), (1, -1), (25, 0), (5000, -3000), (0, 0)])
def test_a_position_is_reached_to_the_pulse_along_the_trapezoid(target: tuple[int, int]) -> None:
    bench = Bench()
    bench.motion.set_position(*target)
    speeds = bench.run(0.05)
    while bench.status[0] == 0 or bench.status[3] == 0:
        speeds += bench.run(0.05)
        assert len(speeds) < 10_000
    way, fastest, acceleration = max(map(abs, target)), 20, 64 / 256
    ramp = fastest / acceleration
    ideal = 2 * math.sqrt(way / acceleration) if way < fastest * ramp else way / fastest + ramp  # periods
    # In the middle the profile's own time; at its end the controllers settle.
    assert ideal <= len(speeds) / 2 + 5 <= ideal + 45
    bench.run(1.0)
    assert bench.counters == list(target)
    assert bench.status == [1, Mode.POSITION, 0, 1, Mode.POSITION, 0]
    assert max(map(abs, speeds)) < fastest * 1.02
    # The profile's acceleration, and what the lag of the wheel adds to it at the corners.
    assert np.abs(np.diff(speeds)).max() < 2 * acceleration / 2 + 0.05
    assert bench.run(5.0)[-1] == pytest.approx(0, abs=1e-3)


def test_the_profile_may_differ_from_wheel_to_wheel() -> None:
    bench = Bench()
    bench.motion.set_profile(40, 128, 10, 32)
    bench.motion.set_position(4000, 4000)
    bench.run(2.0)
    left, right = bench.ways
    assert left == pytest.approx(4000, abs=1200)
    assert right == pytest.approx(10 * 200 - 10 * 40, abs=100)


def test_a_profile_steeper_than_the_motors_does_not_run_away() -> None:
    bench = Bench()
    bench.motion.set_profile(127, 32767, 127, 32767)
    bench.motion.set_position(3000, -3000)
    speeds = bench.run(3.0)
    assert bench.counters == [3000, -3000]
    assert max(speeds) < 127


@pytest.mark.parametrize("profile", [(0, 64), (20, 0)])
def test_a_profile_without_speed_or_acceleration_stands_still(profile: tuple[int, int]) -> None:
    bench = Bench()
    bench.motion.set_profile(*profile, *profile)
    bench.motion.set_position(500, 500)
    bench.run(2.0)
    assert bench.counters == [0, 0]
    assert bench.status[0] == 0


def test_the_position_gains_change_how_a_target_is_reached() -> None:
    def most(*gains: int) -> float:
        bench = Bench()
        bench.motion.set_position_gains(*gains)
        bench.motion.set_position(1000, 1000)
        return float(max(np.cumsum(bench.run(8.0)))) * _STEP / 0.010

    assert most(0, 0, 0) == 0
    assert most(3000, 20, 4000) < 1003
    assert most(3000, 3000, 4000) > 1100  # a sum that is too strong swings
    assert most(10, 0, 0) < 900  # and too little is slow


def test_the_last_order_wins_and_taking_over_is_smooth() -> None:
    bench = Bench()
    bench.motion.set_speed(20, 20)
    bench.run(1.0)
    bench.motion.set_position(5000, 5000)
    speeds = bench.run(0.5)
    assert min(speeds) > 19
    bench.motion.set_position(-200, -200)  # back: it brakes along the profile first
    speeds = bench.run(0.3)
    assert speeds[-1] > 5
    assert np.diff(speeds).min() > -0.25
    bench.motion.set_speed(3, 3)
    assert bench.run(2.0)[-1] == pytest.approx(3, abs=1e-3)
    bench.motion.set_pwm(20, -20)
    assert bench.run(1.0)[-1] == pytest.approx(10, abs=0.01)
    assert bench.status == [0, Mode.PWM, 0, 0, Mode.PWM, 0]
    bench.motion.set_speed(10, -10)
    assert all(9 < speed < 11 for speed in bench.run(1.0))


def test_full_pwm_is_about_the_highest_speed() -> None:
    bench = Bench()
    bench.motion.set_pwm(255, 255)
    speeds = bench.run(3.0)
    assert speeds[-1] == pytest.approx(127.5, abs=0.1)
    assert np.diff(speeds).max() <= 1000 * _STEP / SPEED_UNIT_MM_S + 1e-6


def test_a_counter_set_on_the_way_moves_what_is_left_of_it() -> None:
    bench = Bench()
    bench.motion.set_position(2000, 2000)
    bench.run(1.0)
    gone = bench.ways[0]
    bench.motion.set_counters([1900, 1900], bench.ways)
    bench.run(4.0)
    assert bench.counters == [2000, 2000]
    assert bench.ways[0] - gone == pytest.approx(100, abs=2)


def test_a_counter_that_has_wrapped_around_is_where_it_says() -> None:
    bench = Bench()
    bench.motion.set_counters([2**31 - 100, 2**31 - 100], bench.ways)
    bench.motion.set_speed(20, 20)
    bench.run(1.0)
    assert bench.counters[0] < 0
    before = bench.ways[0]
    bench.motion.set_position(0, 0)  # far ahead, not back
    bench.run(2.0)
    assert bench.ways[0] > before + 1000


def test_a_reset_stops_the_wheels_and_forgets_everything() -> None:
    bench = Bench()
    bench.motion.set_speed_gains(0, 0, 0)
    bench.motion.set_position_gains(0, 0, 0)
    bench.motion.set_profile(0, 0, 0, 0)
    bench.motion.set_pwm(100, 100)
    bench.run(1.0)
    bench.motion.reset()
    assert bench.run(1.0)[-1] == pytest.approx(0, abs=1e-3)
    assert 0 < bench.counters[0] < 1500  # they ran out
    bench.motion.set_counters([0, 0], bench.ways)
    bench.motion.set_position(300, 300)
    bench.run(3.0)
    assert bench.counters == [300, 300]


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("set_speed"), st.tuples(*[st.integers(-127, 127)] * 2)),
            st.tuples(st.just("set_pwm"), st.tuples(*[st.integers(-255, 255)] * 2)),
            st.tuples(st.just("set_position"), st.tuples(*[st.integers(-(2**23) + 2, 2**23 - 2)] * 2)),
            st.tuples(st.just("set_speed_gains"), st.tuples(*[st.integers(0, 32767)] * 3)),
            st.tuples(st.just("set_position_gains"), st.tuples(*[st.integers(0, 32767)] * 3)),
            st.tuples(
                st.just("set_profile"),
                st.tuples(*[st.integers(0, 127), st.integers(0, 32767)] * 2),
            ),
            st.tuples(st.just("reset"), st.just(())),
        ),
        max_size=12,
    )
)
def test_whatever_is_ordered_wheels_stay_within_their_motors(orders: list[tuple[str, tuple[int, ...]]]) -> None:
    bench = Bench()
    for name, values in orders:
        getattr(bench.motion, name)(*values)
        speeds = bench.run(0.2)
        assert all(abs(speed) <= 127.5 + 1e-6 for speed in speeds)
        assert np.abs(np.diff(speeds)).max() <= 1000 * _STEP / SPEED_UNIT_MM_S + 1e-6
        told = bench.status
        assert all(-(2**31) <= value < 2**31 for value in told + bench.counters)
