"""The injector does what the specification says, to the byte, whatever the lumps; and its log says what it did."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.errors import UsageError
from khepera_hil.faults import BOOT_TEXT, Fault, Faults
from khepera_hil.faultspec import BYTE_KINDS, GROUPS, KINDS, LINE_KINDS, Specification

ANSWER = b"n,0,1,20,300,1023,5,0,7\r\n"


def passed(faults: Faults, data: bytes, lumps: Sequence[int] = (), way: str = "host") -> bytes:
    """What comes out in the end when ``data`` goes in, cut at ``lumps``."""
    move = faults.to_host if way == "host" else faults.to_robot
    cuts = [0, *sorted(cut % (len(data) + 1) for cut in lumps), len(data)]
    out = b"".join(move(data[cuts[i] : cuts[i + 1]], 0.0) for i in range(len(cuts) - 1))
    return out + move(b"", 1e6)


# The specification


def test_a_specification_is_read_as_it_is_written() -> None:
    read = Specification.parse(
        "flip=1e-3, host.late=0.01:0.08,robot.lose=.5,disconnect@30+5,stall@10+0.2/60,seed=7"
    )
    assert read.seed == 7
    assert [(r.kind, r.rate, r.seconds, r.way, r.at, r.every) for r in read.rules] == [
        ("flip", 1e-3, 0.0, None, None, None),
        ("late", 0.01, 0.08, "host", None, None),
        ("lose", 0.5, 0.0, "robot", None, None),
        ("disconnect", 0.0, 5.0, None, 30.0, None),
        ("stall", 0.0, 0.2, None, 10.0, 60.0),
    ]


def test_a_rate_may_hold_for_a_while_only() -> None:
    (rule,) = Specification.parse("late=0.5:0.02@30+5").rules
    assert (rule.rate, rule.seconds, rule.at, rule.since, rule.until) == (0.5, 0.02, None, 30.0, 35.0)
    faults = Faults("lose=1@30+5,drop=1@32+1")
    assert faults.to_host(ANSWER, 29.9) == ANSWER
    for moment in (30.0, 32.5, 34.9):
        assert faults.to_host(ANSWER, moment) == b""
    assert faults.counts == {"lose": 3, "drop": len(ANSWER)}
    assert faults.to_host(ANSWER, 35.0) == ANSWER


def test_trouble_may_come_later() -> None:
    faults = Faults(Specification(()))
    assert faults.to_host(ANSWER, 1.0) == ANSWER
    faults.trouble("drop", 1.0, 1.5, 2.0)
    assert faults.to_robot(b"N\n", 1.4) == b"N\n"
    assert faults.to_robot(b"N\n", 1.5) == faults.to_host(ANSWER, 1.9) == b""
    assert faults.to_robot(b"N\n", 2.0) == b"N\n"


@pytest.mark.parametrize("group", GROUPS)
def test_a_group_shares_its_rate(group: str) -> None:
    rules = Specification.parse(f"{group}=0.3").rules
    assert tuple(rule.kind for rule in rules) == GROUPS[group]
    assert sum(rule.rate for rule in rules) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "no faults are named: write a list such as"),
        (",", "no faults are named"),
        ("seed=4", "no faults are named"),
        ("flip", "'flip' is no fault: write KIND=RATE"),
        ("flip=", "'' is no number of a rate from 0 to 1"),
        ("flip=x", "'x' is no number of a rate from 0 to 1"),
        ("flip=2", "'2' is no number of a rate from 0 to 1"),
        ("flip=-1e-3", "no number of a rate"),
        ("flip=nan", "no number of a rate"),
        ("flop=1", "there is no fault 'flop'; there are drop, flip"),
        ("Flip=1", "is no fault: write KIND=RATE"),
        ("moon.flip=1", "to the robot or to the host, not to 'moon'"),
        ("robot.boot=1", "boot texts only go to the host"),
        ("flip=0.1:3", "only late, stall, disconnect last for seconds"),
        ("flip@3+3", "only late, stall, disconnect last for seconds"),
        ("stall@x", "'x' is no number of seconds"),
        ("stall@1+", "'' is no number of seconds"),
        ("stall@1+9/5", "would begin again before it ended"),
        ("lines@5", "lines stands for several kinds, name one of them"),
        ("flip=0.7,drop=0.7", "faults of a byte add up to 1.4: at most 1"),
        ("seed=x,flip=1", "a seed is a whole number"),
        ("flip=1e-3;late=1", "is no number of a rate"),
        ("late=1@5", "is no fault: write KIND=RATE"),
        ("late=1@5+x", "'x' is no number of seconds"),
        ("late=1:inf", "'inf' is no number of seconds from 0 to 3600"),
    ],
)
def test_a_mistake_is_told_in_a_sentence(text: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        Specification.parse(text)


@given(st.text(alphabet="abdefhlnoprstu.,=:@+/0123456789e-", max_size=40) | st.text(max_size=30))
def test_no_text_makes_more_than_a_usage_error(text: str) -> None:
    with contextlib.suppress(UsageError):
        assert Specification.parse(text).rules


def test_each_kind_is_explained() -> None:
    assert set(KINDS) == set(BYTE_KINDS) | set(LINE_KINDS)
    assert {kind for kinds in GROUPS.values() for kind in kinds} <= set(KINDS)


# What is done to bytes


@pytest.mark.parametrize(
    ("specification", "come"),
    [
        ("drop=1", b""),
        ("double=1", b"".join(bytes((byte, byte)) for byte in ANSWER)),
        ("lose=1", b""),
        ("host.lose=1", b""),
        ("robot.lose=1", ANSWER),
        ("repeat=1", ANSWER + ANSWER),
        ("late=1:0.5", ANSWER),
        ("stall=1", ANSWER),
        ("drop@0", ANSWER[1:]),
        ("lose@0", b""),
        ("flip=0", ANSWER),
    ],
)
def test_a_kind_does_what_it_says(specification: str, come: bytes) -> None:
    assert passed(Faults(specification), ANSWER) == come


def test_flipping_turns_over_one_bit_of_each_byte() -> None:
    come = passed(Faults("flip=1"), ANSWER)
    assert [(a ^ b).bit_count() for a, b in zip(come, ANSWER, strict=True)] == [1] * len(ANSWER)


def test_cutting_a_line_loses_its_end_and_nothing_of_the_next() -> None:
    for seed in range(40):
        come = passed(Faults("truncate@0", seed), ANSWER + ANSWER)
        assert come.endswith(ANSWER)
        assert ANSWER.startswith(come[: -len(ANSWER)])
        assert len(come) < 2 * len(ANSWER)


def test_a_boot_text_comes_before_or_behind_the_line() -> None:
    come = {passed(Faults("boot@0", seed), ANSWER) for seed in range(20)}
    assert come == {BOOT_TEXT + ANSWER, ANSWER + BOOT_TEXT}
    assert passed(Faults("boot=1"), b"N\n", way="robot") == b"N\n"


def test_bytes_of_the_frame_are_those_that_belong_to_no_number() -> None:
    digits = set(b"-0123456789")
    for seed in range(20):
        come = passed(Faults("frame=1", seed), ANSWER)
        assert bytes(b for b in come if b in digits).count(b"1") >= ANSWER.count(b"1")
        assert come != ANSWER
    assert passed(Faults("frame=1"), b"12345") == b"12345"


@given(
    st.lists(st.integers(0, 10_000), max_size=30),
    st.sampled_from(["bytes=0.05,lines=0.2", "frame=0.2,repeat=0.3", "truncate=0.5", "boot=0.5,lose=0.3,drop=0.1"]),
    st.integers(0, 2**32),
    st.sampled_from(["host", "robot"]),
)
def test_what_comes_does_not_depend_on_the_lumps(lumps: list[int], text: str, seed: int, way: str) -> None:
    data = (ANSWER + b"d\r\n" + b"o,500,500,500,500,500,500,500,500\r\n") * 4
    whole, cut = Faults(text, seed), Faults(text, seed)
    assert passed(whole, data, way=way) == passed(cut, data, lumps, way=way)
    assert [f.kind for f in whole.log] == [f.kind for f in cut.log]


def test_the_rate_is_the_share_of_what_is_hit_and_the_log_counts_it() -> None:
    heard: list[Fault] = []
    faults = Faults("flip=0.02,lose=0.1", 3, on_fault=heard.append)
    lines = 4000
    passed(faults, ANSWER * lines)
    assert faults.counts["flip"] == pytest.approx(0.02 * lines * len(ANSWER), rel=0.1)
    assert faults.counts["lose"] == pytest.approx(0.1 * lines, rel=0.15)
    assert len(heard) == faults.counts.total()
    assert {fault.way for fault in heard} == {"host"}


def test_seeds_repeat_and_differ() -> None:
    assert passed(Faults("flip=0.1", 1), ANSWER * 9) == passed(Faults("flip=0.1", 1), ANSWER * 9)
    assert passed(Faults("flip=0.1", 1), ANSWER * 9) != passed(Faults("flip=0.1", 2), ANSWER * 9)
    assert passed(Faults("flip=0.1,seed=5", 1), ANSWER * 9) == passed(Faults("flip=0.1,seed=5", 2), ANSWER * 9)


def test_a_line_without_end_is_not_collected_for_ever() -> None:
    faults = Faults("repeat=1")
    come = b"".join(faults.to_host(b"\x55" * 1000, 0.0) for _ in range(100))
    assert 100_000 < len(come) <= 200_000


# Time


def test_a_late_line_holds_up_all_behind_it_and_nothing_is_overtaken() -> None:
    faults = Faults("host.late@1+0.5")
    assert faults.to_host(b"a\r\n", 0.9) == b"a\r\n"
    assert faults.to_host(b"b\r\n", 1.0) == b""
    assert faults.next_event() == pytest.approx(1.5)
    assert faults.to_host(b"c\r\n", 1.2) == b""
    assert faults.to_robot(b"N\n", 1.2) == b"N\n"
    assert faults.to_host(b"", 1.49) == b""
    assert faults.to_host(b"d\r\n", 1.5) == b"b\r\nc\r\nd\r\n"
    assert faults.next_event() is None


def test_in_a_stall_nothing_passes_either_way_and_then_all_of_it() -> None:
    faults = Faults("stall@1+0.5/10")
    assert faults.next_event() == 1.0
    assert faults.to_robot(b"N\n", 1.1) == b""
    assert faults.to_host(b"n", 1.2) == b""
    assert faults.to_host(b"", 1.5) == b"n"
    assert faults.to_robot(b"", 1.5) == b"N\n"
    assert faults.next_event() == 11.0
    assert faults.to_robot(b"N\n", 11.2) == b""
    assert [(fault.kind, fault.at) for fault in faults.log] == [("stall", 1.0), ("stall", 11.0)]


def test_what_is_under_way_when_the_line_is_unplugged_is_lost() -> None:
    faults = Faults("disconnect@2+5,host.late@1+3")
    assert faults.to_host(b"a\r\n", 1.0) == b""
    assert faults.connected(1.9)
    assert not faults.connected(2.0)
    assert faults.back == 7.0
    assert faults.to_host(b"b\r\n", 3.0) == faults.to_robot(b"N\n", 6.9) == b""
    assert faults.connected(7.0)
    assert faults.to_host(b"c\r\n", 7.0) == b"c\r\n"
    assert faults.to_robot(b"N\n", 7.0) == b"N\n"


def test_a_line_may_be_unplugged_by_chance_too() -> None:
    faults = Faults("disconnect=1:2")
    assert faults.to_host(b"a\r\n", 1.0) == b""
    assert not faults.connected(1.5)
    assert 2.0 <= faults.back <= 4.0
