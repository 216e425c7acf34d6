from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.clock import SimulatedClock
from khepera_hil.scheduler import PAUSE, Beat, beats


def run(busy: list[float], period: float, duration: float | None = None) -> list[Beat]:
    """All beats of a loop whose ticks take so long each."""
    clock = SimulatedClock()
    clock.sleep_until(7.0)
    work = iter(busy)
    done: list[Beat] = []
    for beat in beats(clock, period, duration=duration, stopped=lambda: len(done) == len(busy)):
        done.append(beat)
        clock.sleep_until(clock.now() + next(work))
    return done


def test_a_tick_that_is_done_in_time_never_delays_another() -> None:
    done = run([0.09] * 50, 0.1)
    assert [beat.late for beat in done] == [0.0] * 50
    assert [beat.missed for beat in done] == [0] * 50


def test_a_duration_holds_so_many_ticks() -> None:
    assert [beat.due for beat in run([0.01] * 9, 0.1, duration=0.3)] == [0.0, 0.1, 0.2]
    assert len(run([0.0] * 999, 0.1, duration=12.0)) == 120


def test_missed_deadlines_are_skipped_and_counted_and_never_caught_up() -> None:
    done = run([0.35, 0.0, 0.0], 0.1)
    assert [(round(beat.due, 9), beat.missed) for beat in done] == [(0.0, 0), (0.3, 2), (0.4, 0)]
    assert round(done[1].late, 9) == 0.05


@given(st.lists(st.floats(0, 1), min_size=1, max_size=40), st.floats(0.01, 0.3))
def test_deadlines_lie_on_the_grid_and_lateness_stays_below_a_period(busy: list[float], period: float) -> None:
    done = run(busy, period)
    assert [beat.tick for beat in done] == list(range(len(busy)))
    for beat in done:
        number = beat.due / period
        assert abs(number - round(number)) < 1e-6
        assert 0 <= beat.late <= period * (1 + 1e-9)
    for before, after in pairwise(done):
        assert round((after.due - before.due) / period) == 1 + after.missed


def test_a_loop_that_is_told_to_stop_stops_before_its_next_tick() -> None:
    clock = SimulatedClock()
    stopped = False

    def halfway(now: float) -> None:
        nonlocal stopped
        stopped = now > 0.25

    clock.on_advance = halfway
    assert len(list(beats(clock, 0.1, duration=None, stopped=lambda: stopped))) == 3


class Waiting(SimulatedClock):
    """A clock that one has to wait for."""

    simulated = False


def test_while_it_waits_it_shows_that_it_is_awake() -> None:
    clock = Waiting()
    shown: list[float] = []
    for _ in beats(
        clock, 0.48, duration=0.96, stopped=lambda: False, waiting=lambda: shown.append(round(clock.now(), 9))
    ):
        pass
    assert shown == [round(PAUSE * n, 9) for n in range(1, 10)], "and the tick does so itself"
    assert clock.now() == 0.48


def test_a_stop_is_heard_while_it_waits() -> None:
    clock = Waiting()
    done = list(beats(clock, 10.0, duration=None, stopped=lambda: clock.now() > 0.2))
    assert [beat.tick for beat in done] == [0]
    assert clock.now() < 0.3
