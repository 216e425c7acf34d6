"""The wire's budget: at its worst, spread over ticks, refused with what would do."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.budget import RESERVE, SPEEDS, plan, seconds
from khepera_hil.errors import WireTooSlow
from khepera_hil.perception import Need

IMAGE = Need("T", (2, "N"), every=3)


@pytest.mark.parametrize(
    ("need", "baud", "milliseconds"),
    # The table of wire times at its worst; it counts D,-20,20 where D,-127,-127 is the longest: 3 characters more.
    [
        (Need("N"), 9600, 51.6),
        (Need("N"), 38400, 12.9),
        (Need("O"), 19200, 25.8),
        (Need("H"), 9600, 33.2),
        (Need("E"), 9600, 17.2),
        (Need("K"), 38400, 22 * 0.2865 + 27 * 0.2865 - 13 * 0.2865),
        (Need("D"), 9600, 13.8 + 3.4),
        (Need("T", (2, "N")), 38400, 77.1),
        (Need("T", (2, "S")), 19200, 80.8),
        (Need("T", (2, "T")), 9600, 88.2),
    ],
)
def test_the_budget_is_the_tables_worst_case(need: Need, baud: int, milliseconds: float) -> None:
    if need.letter != "K":  # whose errors the table takes to be short
        assert seconds(need, baud) * 1000 == pytest.approx(milliseconds, abs=0.15)


def test_what_is_verified_is_counted_as_often_as_it_may_be_read() -> None:
    assert seconds(Need("N"), 38400, verify=True) == pytest.approx(3 * seconds(Need("N"), 38400))
    assert seconds(IMAGE, 38400, verify=True) == seconds(IMAGE, 38400)


def test_homing_fits_into_a_tenth_of_a_second_also_when_it_is_verified() -> None:
    assert plan("home", ("N", "O"), baud=38400, period=0.1).worst < 0.04
    assert plan("home", ("N", "O"), baud=38400, period=0.1, verify=True).worst < 0.09


def test_every_tick_asks_what_it_always_needs_and_reads_the_speeds_back_now_and_then() -> None:
    found = plan("home", ("N", "O"), baud=38400, period=0.1)
    for tick in range(40):
        assert [need for need in found.at(tick) if need is not SPEEDS] == [Need("N"), Need("O")]
    assert sum(SPEEDS in found.at(tick) for tick in range(40)) == 4


def test_slow_readings_do_not_fall_into_the_same_tick() -> None:
    slow = [Need("T", (2, "T"), every=4), Need("I", (1,), every=4), Need("H", every=2), Need("K", every=4)]
    found = plan("slow", ["N", *slow], baud=38400, period=0.1)
    costly = [found.at(tick) for tick in range(20) if slow[0] in found.at(tick)]
    assert len(costly) == 5
    for turn in costly:
        assert not {slow[2], slow[3], SPEEDS} & set(turn), "the camera's tick has nothing else to carry"


def test_what_does_not_fit_is_refused_with_what_would() -> None:
    with pytest.raises(WireTooSlow) as refused:
        plan("home", ("N", "O"), baud=9600, period=0.1)
    assert str(refused.value) == (
        "home needs 138 ms a tick at 9600 baud (N 52, O 52, E 17 every 10 ticks, D 17), more than the 90 ms that a "
        "period of 100 ms leaves for the wire: use 19200 baud or --period 0.16"
    )
    with pytest.raises(WireTooSlow, match=r"use 57600 baud \(a Khepera II only\), --period 0.12 or no --verify$"):
        plan("seeing", ("N", "O", Need("T", (2, "T"))), baud=38400, period=0.1, verify=True)


NEEDS = st.lists(
    st.builds(
        Need,
        st.sampled_from(["N", "O", "H", "K", "B"]),
        st.just(()),
        st.sampled_from([1, 1, 2, 3, 4, 5, 10]),
    )
    | st.builds(Need, st.just("T"), st.sampled_from([(2, "N"), (2, "T"), (2, "O")]), st.integers(1, 6)),
    max_size=6,
    unique=True,
)


@given(NEEDS, st.sampled_from([9600, 19200, 38400, 57600, 115200]), st.booleans())
def test_no_tick_passes_the_budget_and_nothing_is_left_out(needs: Sequence[Need], baud: int, verify: bool) -> None:
    found = plan("all", needs, baud=baud, period=2.0, verify=verify)
    for tick, turn in enumerate(found.turns * 2):
        cost = sum(seconds(need, baud, verify=verify) for need in (*turn, Need("D")))
        assert cost <= found.worst + 1e-9 <= (1 - RESERVE) * 2.0 + 1e-9, tick
    for need in {*needs, SPEEDS}:
        due = [tick for tick in range(2 * len(found.turns)) if need in found.at(tick)]
        assert {later - sooner for sooner, later in pairwise(due)} <= {need.every}
        assert len(due) == 2 * len(found.turns) // need.every


@given(NEEDS, st.sampled_from([9600, 19200, 38400, 57600, 115200]), st.floats(0.005, 0.5), st.booleans())
def test_the_advice_of_a_refusal_holds(needs: Sequence[Need], baud: int, period: float, verify: bool) -> None:
    try:
        plan("all", needs, baud=baud, period=period, verify=verify)
    except WireTooSlow as refused:
        advice = str(refused).rpartition("use ")[2]
        longer = re.search(r"--period ([0-9.]+)", advice)
        assert longer is not None
        plan("all", needs, baud=baud, period=float(longer[1]), verify=verify)
        if "baud" in advice:
            plan("all", needs, baud=int(advice.split()[0]), period=period, verify=verify)
        if "--verify" in advice:
            plan("all", needs, baud=baud, period=period)


def test_a_need_that_is_never_due_is_refused() -> None:
    with pytest.raises(ValueError, match="every 0 ticks"):
        Need("N", every=0)
