"""The robot's end of the protocol, to the last byte."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from khepera_hil.emulator import BOOT_TEXT, Emulator
from khepera_hil.errors import UsageError
from khepera_hil.protocol import COMMAND_NOT_FOUND, COMMANDS, LED_ABSENT, LED_ACTION, PROTOCOL_ERROR, wire_seconds
from khepera_hil.turrets import TURRET_ABSENT
from khepera_hil.world import Reset, Scenario, World
from khepera_hil.world.scenario import Event

_BOOTED = 1.0


def robot(baud: int = 38400, *, arena: str = "empty", seed: int = 0, fifo: int = 1, **more: Any) -> Emulator:
    emulator = Emulator(World(arena, seed), baud, fifo=fifo, **more)
    assert emulator.transmitted(_BOOTED) == emulator.model.boot
    return emulator


def dialogue(emulator: Emulator, data: bytes, now: float = _BOOTED, wait: float = 2.0) -> bytes:
    emulator.receive(data, now)
    return emulator.transmitted(now + wait)


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        (b"B\n", b"b,5.01,5.00\r\n"),
        (b"D,5,-3\n", b"d\r\n"),
        (b"G,7,-8\n", b"g\r\n"),
        (b"G,7,-8\rH\r", b"g\r\nh,7,-8\r\n"),
        (b"E\r\n", b"e,0,0\r\n"),
        (b"A,3800,800,100\r", b"a\r\n"),
        (b"C,0,0\n", b"c\r\n"),
        (b"F,3000,20,4000\n", b"f\r\n"),
        (b"I,0\n", b"i,0\r\n"),
        (b"J,20,64,20,64\n", b"j\r\n"),
        (b"P,0,0\nK\n", b"p\r\nk,1,2,0,1,2,0\r\n"),
        (b"W,5,32\nR,32\nR,0\n", b"w\r\nr,5\r\nr,255\r\n"),
        (b"T,2,B\n", b"t,2,b,1,2\r\n"),
        (b"T,1,B\n", TURRET_ABSENT),
        (b"T,2,Z\n", TURRET_ABSENT),
        (b"T,2,Q\n", PROTOCOL_ERROR),
        (b"T,2,Q,57\n", PROTOCOL_ERROR),
        (b"T,2\n", PROTOCOL_ERROR),
        (b"A,1,2,-1\n", PROTOCOL_ERROR),
        (b"C,8388607,0\n", PROTOCOL_ERROR),
        (b"G,2147483648,0\n", PROTOCOL_ERROR),
        (b"P,256,0\n", PROTOCOL_ERROR),
        (b"M\nQ\nS\nU\nV\nX\nY\nZ\n", 8 * COMMAND_NOT_FOUND),
        (b"D, 5,5\n", PROTOCOL_ERROR),
        (b"K\n", b"k,1,0,0,1,0,0\r\n"),
        (b"L,0,1\n", b"l\r\n"),
        (b"L,2,1\n", LED_ABSENT),
        (b"L,1,3\n", LED_ACTION),
        (b"D,128,0\n", PROTOCOL_ERROR),
        (b"D,1\n", PROTOCOL_ERROR),
        (b"d,1,1\n", COMMAND_NOT_FOUND),
        (b" \n", COMMAND_NOT_FOUND),
        (b"\n\r\n", b""),
        (b"  B  \n", b"b,5.01,5.00\r\n"),
        (b"\xff\xfe\n", COMMAND_NOT_FOUND),
        (b"N" * 500 + b"\nB\n", PROTOCOL_ERROR + b"b,5.01,5.00\r\n"),
    ],
)
def test_the_manuals_dialogues_are_answered_to_the_last_byte(request_: bytes, answer: bytes) -> None:
    assert dialogue(robot(), request_) == answer


@pytest.mark.parametrize("baud", [9600, 19200, 38400])
def test_a_byte_takes_eleven_bit_times_each_way(baud: int) -> None:
    emulator = robot(baud)
    emulator.receive(b"B\n", _BOOTED)
    asked = _BOOTED + wire_seconds(2, baud)
    answer = b"b,5.01,5.00\r\n"
    for sent in range(len(answer) + 1):
        moment = asked + wire_seconds(sent, baud)
        assert emulator.transmitted(moment - 1e-7) == b""
        assert emulator.transmitted(moment + 1e-7) == answer[sent - 1 : sent] if sent else True
    assert emulator.next_event() is None


def test_a_command_counts_when_its_last_bit_has_arrived() -> None:
    emulator = robot(9600)
    emulator.receive(b"D,10,10\n", _BOOTED)
    arrival = _BOOTED + wire_seconds(8, 9600)
    emulator.advance(arrival - 1e-6)
    assert emulator.world.wheel_travel() == (0.0, 0.0)
    emulator.advance(arrival + 0.02)
    assert min(emulator.world.wheel_travel()) > 0


def test_leds_are_switched_and_toggled() -> None:
    emulator = robot()
    dialogue(emulator, b"L,0,1\nL,1,2\nL,1,2\nL,1,2\n")
    assert emulator.leds == (1, 1)
    dialogue(emulator, b"L,0,2\nL,1,0\n", now=4.0)
    assert emulator.leds == (0, 0)


def test_counters_wrap_at_32_bits() -> None:
    emulator = robot()
    dialogue(emulator, b"G,2147483647,-2147483648\nD,10,-10\n")
    left, right = map(int, dialogue(emulator, b"D,0,0\nH\n", now=4.0).split(b"\r\n")[1].split(b",")[1:])
    assert -(2**31) <= left < -(2**31) + 3000
    assert 2**31 - 3000 < right < 2**31


def test_the_wheels_keep_their_speed_when_the_host_is_silent() -> None:
    emulator = robot()
    dialogue(emulator, b"D,3,-3\n")
    assert dialogue(emulator, b"E\nK\n", now=60.0) == b"e,3,-3\r\nk,1,0,0,1,0,0\r\n"


def test_the_error_in_speed_mode_is_what_is_lacking() -> None:
    emulator = robot()
    emulator.receive(b"D,20,-20\n", _BOOTED)
    emulator.advance(_BOOTED + 0.03)
    emulator.receive(b"K\n", _BOOTED + 0.03)
    answer = emulator.transmitted(_BOOTED + 1).split(b"\r\n")[1].split(b",")
    assert answer[1:3] == [b"0", b"0"]
    assert 0 < int(answer[3]) < 20
    assert -20 < int(answer[6]) < 0


_SCRIPT = (
    b"N\nO\rD,6,5\r\nH\nN\nbad\nE\nD,4,-4\nN\n\nO\nH\nK\nL,0,2\nC,90,-90\nT,2,T\nN\nO\nserial 19200\nB\nnet\n"
    b"run demo\nN\nrestart\nK\nN\n"
)


@given(cuts=st.lists(st.integers(0, len(_SCRIPT)), max_size=20), looks=st.lists(st.floats(1.0, 1.5), max_size=20))
@settings(max_examples=30)
@pytest.mark.parametrize("follows", [False, True])
def test_how_the_bytes_are_cut_and_how_often_one_looks_changes_nothing(
    cuts: list[int], looks: list[float], follows: bool
) -> None:
    whole, cut = robot(seed=4, host_follows=follows), robot(seed=4, host_follows=follows)
    for first, last in pairwise([0, *sorted(cuts), len(_SCRIPT)]):
        cut.receive(_SCRIPT[first:last], _BOOTED)
    seen = b"".join(cut.transmitted(moment) for moment in sorted(looks))
    assert seen + cut.transmitted(2.0) == dialogue(whole, _SCRIPT, wait=1.0)


@given(data=st.binary(max_size=300))
@settings(max_examples=40, deadline=None)
def test_whatever_comes_the_next_command_is_answered(data: bytes) -> None:
    emulator = robot()
    dialogue(emulator, data, wait=20.0)
    answer = dialogue(emulator, b"\nB\n", now=30.0)
    assert answer.endswith(b"b,5.01,5.00\r\n")


def test_a_host_at_another_rate_reads_and_writes_garbage() -> None:
    emulator = Emulator(World("empty"), 38400, host_baud=9600)
    boot = emulator.transmitted(1.0)
    assert boot
    assert boot not in BOOT_TEXT
    answer = dialogue(emulator, b"B\n")
    assert b"b,5.01" not in answer
    emulator.host_baud = 38400
    dialogue(emulator, b"\n", now=5.0)
    assert dialogue(emulator, b"B\n", now=8.0) == b"b,5.01,5.00\r\n"


def test_a_rate_that_no_khepera_has_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(UsageError, match=r"12345 baud.*9600, 19200, 38400"):
        Emulator(World("empty"), 12345)


def test_a_khepera_has_three_rates_and_a_khepera_2_two_more() -> None:
    assert Emulator(World("empty"), 38400).model.name == "khepera"
    assert Emulator(World("empty"), 115200).model.name == "khepera2"
    assert Emulator(World("empty"), 9600, robot="khepera2").model.name == "khepera2"
    with pytest.raises(UsageError, match=r"a Khepera does not talk at 57600 baud \(a Khepera II does\)"):
        Emulator(World("empty"), 57600, robot="khepera")
    with pytest.raises(UsageError, match="no robot 'koala'; there are khepera and khepera2"):
        Emulator(World("empty"), 9600, robot="koala")
    with pytest.raises(UsageError, match="no turret 'radar'; there are gripper, k213, genio"):
        Emulator(World("empty"), 9600, turrets=("radar",))


def test_both_boot_texts_name_robot_and_mode() -> None:
    for name, rom in (("khepera", b"ROM of minirobot KHEPERA, "), ("khepera2", b"ROM of minirobot KII, ")):
        *_, rom_line, mode, end = robot(robot=name).model.boot.split(b"\r\n")
        assert rom_line.startswith(rom)
        assert (mode, end) == (b"Serial Communication Protocol", b"")


def test_restart_resets_everything_but_the_place() -> None:
    emulator = robot(turrets=("gripper", "k213", "genio"), host_follows=True)
    pose = emulator.world.pose()
    dialogue(emulator, b"L,0,1\nL,1,1\nA,0,0,0\nF,0,0,0\nJ,0,0,0,0\nW,255,32\nT,1,E,250\nG,5,6\nserial 9600\n")
    assert emulator.baud == 9600
    assert dialogue(emulator, b"D,9,9\nN\nrestart\n", now=3.5).endswith(b"\r\n" + BOOT_TEXT)
    assert (emulator.baud, emulator.host_baud) == (38400, 38400)
    assert emulator.leds == (0, 0)
    assert dialogue(emulator, b"R,32\nT,1,H,1\nK\n", now=5.5) == b"r,0\r\nt,1,h,180\r\nk,1,0,0,1,0,0\r\n"
    assert dialogue(emulator, b"G,0,0\nC,50,50\n", now=7.6) == b"g\r\nc\r\n"
    assert dialogue(emulator, b"H\n", now=9.7) == b"h,50,50\r\n"  # so the gains and the profile are back
    assert emulator.world.pose() != pose


def scenario(*events: Event) -> World:
    return World("empty", 0, Scenario("made", "for a test", events))


def test_a_reset_by_the_scenario_breaks_off_what_was_said() -> None:
    emulator = Emulator(scenario(Reset(1.0), Reset(2.0031)), 9600)
    assert emulator.transmitted(0.9) == BOOT_TEXT
    emulator.receive(b"D,10,10\nN\nN\nN\n", 0.93)
    seen = emulator.transmitted(0.999)
    assert seen.startswith(b"d\r\nn,")
    assert not seen.endswith(b"\n")
    rest = emulator.transmitted(1.5)  # the three N are forgotten, and so is what was not yet out
    assert rest.endswith(BOOT_TEXT)
    assert len(rest) <= len(BOOT_TEXT) + 1
    assert dialogue(emulator, b"E\nK\n", now=1.5, wait=0.2) == b"e,0,0\r\nk,1,0,0,1,0,0\r\n"
    x = emulator.world.pose()[0]
    assert emulator.next_event() == pytest.approx(2.005)  # the end of the world's step
    assert emulator.transmitted(2.9) == BOOT_TEXT
    assert emulator.world.pose()[0] == pytest.approx(x)
    assert emulator.next_event() is None


@given(looks=st.lists(st.floats(0.9, 1.6), max_size=20))
@settings(max_examples=20)
def test_a_reset_is_the_same_however_often_one_looks(looks: list[float]) -> None:
    def told(moments: list[float]) -> bytes:
        emulator = Emulator(scenario(Reset(1.0), Reset(1.337)), 19200)
        emulator.receive(b"D,4,4\n" + b"N\n" * 30, 0.91)
        return b"".join(emulator.transmitted(moment) for moment in [*sorted(moments), 2.0])

    assert told(looks) == told([])


def test_a_demonstration_drives_until_the_host_orders_something_else() -> None:
    emulator = robot(arena="furnished", seed=3)
    assert dialogue(emulator, b"run demo\n") == b"Run the selected application...\r\n"
    emulator.advance(60.0)
    score = emulator.world.score()
    assert score["distance_m"] > 1.0
    assert score["contact_longest_s"] < 1.0
    assert b"demonstration" in dialogue(emulator, b"process\n", now=60.0)
    assert dialogue(emulator, b"D,0,0\n", now=63.0) == b"d\r\n"
    emulator.advance(66.0)
    place = emulator.world.pose()
    emulator.advance(70.0)
    assert emulator.world.pose() == pytest.approx(place)


def test_a_download_is_taken_in_and_ends() -> None:
    emulator = robot()
    assert dialogue(emulator, b"sfill\n") == b"S format Motorola loader mode\r\n"
    records = b"S00600004844521B\r\n" + b"S1" + b"0" * 400 + b"\r\nS9030000FC\r\n"
    assert dialogue(emulator, records, now=4.0) == b"S: download terminated\r\n"
    assert dialogue(emulator, b"B\n", now=7.0) == b"b,5.01,5.00\r\n"
    assert dialogue(emulator, b"run sloader\n", now=10.0).endswith(b"loader mode\r\n")
    assert dialogue(emulator, b"\r\nB\n", now=13.0) == b"b,5.01,5.00\r\n"  # no record: the download is over


def test_the_tools_answer_in_lines_and_name_what_there_is() -> None:
    emulator = robot(robot="khepera2", turrets=("gripper", "k213"))
    now = 1.0

    def tell(line: str) -> list[str]:
        nonlocal now
        now += 10
        *lines, end = dialogue(emulator, line.encode() + b"\n", now=now, wait=9).decode("ascii").split("\r\n")
        assert end == ""
        return lines

    tools = [line.split()[0] for line in tell("help")]
    assert tools == [
        "run",
        "serial",
        "help",
        "list",
        "k-team",
        "net",
        "memory",
        "process",
        "restart",
        "sfill",
        "flash",
    ]
    for item in [*tools, *COMMANDS]:
        assert item in tell(f"help {item}")[0]
    listed = tell("list")
    assert {line[:2] for line in listed} == {"TA", "FU", "PR", "TO", "BI"}
    assert [line.split()[1] for line in listed if line.startswith("PR")] == list(COMMANDS)
    assert [line.split()[0] for line in tell("net")] == ["gripper", "k213"]
    assert len(tell("memory")) == 3
    assert len(tell("process")) == 2
    assert "K-Team" in tell("k-team")[0]
    assert tell("flash E") == ["FLASH user segments erased"]
    assert tell("flash W") == ["FLASH user segments written"]
    assert tell("run user-flash")[0] == "Run the selected application..."
    for line in ("run", "serial", "serial 31250", "list all", "flash", "flash X", "memory 1", "help a b"):
        assert tell(line) == ["z,Protocol error"]
    for line in ("help me", "run away", "HELP", "restart!", "k-teams"):
        assert tell(line) == ["Command not found"]


def test_a_khepera_has_no_flash_and_none_to_list() -> None:
    emulator = robot(turrets=())
    assert dialogue(emulator, b"flash E\nrun user-flash\n") == 2 * COMMAND_NOT_FOUND
    assert dialogue(emulator, b"net\n", now=4.0) == b"No intelligent turret is fitted\r\n"
    assert b"flash" not in dialogue(emulator, b"help\n", now=7.0)


def test_the_inputs_of_a_khepera_2_tell_charger_and_current() -> None:
    emulator = robot(robot="khepera2", turrets=("genio",))

    def read(channel: int, now: float) -> int:
        return int(dialogue(emulator, b"I,%d\n" % channel, now=now, wait=1.0).split(b",")[1])

    assert read(0, 2) == 0
    idle = read(6, 4)
    assert 50 < idle < 1023
    dialogue(emulator, b"W,1,32\n", now=6)
    assert read(6, 9) > idle  # the micro-turbine
    assert read(3, 11) == pytest.approx(emulator.world.battery.volts / 2 / 4.09 * 1024, abs=1)
    assert read(4, 13) == 0
    assert 0 <= read(1, 15) <= 1023
    assert read(2, 17) > 400  # it is dark
