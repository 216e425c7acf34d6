"""The in-process port, through pyserial's own door."""

from collections.abc import Iterator
from typing import Any

import pytest
import serial

from khepera_hil.emulator import BOOT_TEXT
from khepera_hil.errors import KheperaHilError
from khepera_hil.protocol import wire_seconds


@pytest.fixture(autouse=True)
def _handler() -> Iterator[None]:
    serial.protocol_handler_packages.append("khepera_hil.ports")
    yield
    serial.protocol_handler_packages.remove("khepera_hil.ports")


def opened(url: str = "emulator://empty?clock=simulated", **settings: Any) -> Any:
    port = serial.serial_for_url(url, **{"baudrate": 38400, "timeout": 0.5, **settings})
    port.read(len(BOOT_TEXT))
    return port


def ask(port: Any, request: bytes) -> bytes:
    port.write(request)
    answer = b""
    while not answer.endswith(b"\r\n"):
        piece = port.read(max(1, port.in_waiting))
        if not piece:
            break
        answer += piece
    return answer


@pytest.mark.parametrize("clock", ["wall", "simulated"])
def test_a_command_is_answered(clock: str) -> None:
    with opened(f"emulator://furnished?seed=3&clock={clock}") as port:
        assert ask(port, b"B\n") == b"b,5.01,5.00\r\n"
        assert ask(port, b"N\n").count(b",") == 8
        assert port.clock.simulated == (clock == "simulated")


def test_a_new_robot_tells_its_name_first() -> None:
    port: Any = serial.serial_for_url("emulator://?clock=simulated", baudrate=9600, timeout=1)
    assert port.read(len(BOOT_TEXT)) == BOOT_TEXT
    assert port.clock.now() >= wire_seconds(len(BOOT_TEXT), 9600) - 1e-9


def test_reading_takes_the_wires_time_and_a_few_reads() -> None:
    with opened() as port:
        start = port.clock.now()
        reads = 0
        port.write(b"N\n")
        answer = b""
        while not answer.endswith(b"\r\n"):
            answer += port.read(max(1, port.in_waiting))
            reads += 1
        wire = wire_seconds(2 + len(answer), 38400)
        assert wire <= port.clock.now() - start <= wire + wire_seconds(4, 38400) + 1e-9
        assert reads <= 6


def test_a_timeout_lasts_as_long_as_it_says() -> None:
    with opened(timeout=0.25) as port:
        start = port.clock.now()
        assert port.read(1) == b""
        assert port.clock.now() == pytest.approx(start + 0.25)
        port.timeout = 0
        assert port.read(100) == b""
        assert port.clock.now() == pytest.approx(start + 0.25)


def test_waiting_for_ever_for_nothing_is_an_error() -> None:
    with opened() as port:
        port.timeout = None
        with pytest.raises(serial.SerialException, match="nothing is on its way"):
            port.read(1)


def test_no_limit_waits_for_what_is_on_its_way() -> None:
    with opened() as port:
        port.timeout = None
        port.write(b"B\n")
        assert port.read(13) == b"b,5.01,5.00\r\n"


def test_reset_input_buffer_forgets_what_has_come_but_not_what_is_coming() -> None:
    with opened() as port:
        port.write(b"B\n")
        port.clock.sleep_until(port.clock.now() + 0.1)
        assert port.in_waiting == 13
        port.reset_input_buffer()
        assert port.in_waiting == 0
        port.write(b"B\n")
        port.reset_input_buffer()
        assert port.read(13) == b"b,5.01,5.00\r\n"


def test_reset_output_buffer_forgets_what_has_not_left() -> None:
    with opened() as port:
        port.write(b"D,9,9\n" * 50)
        assert port.out_waiting > 200
        port.reset_output_buffer()
        assert port.out_waiting == 0
        assert ask(port, b"\nB\n") == b"b,5.01,5.00\r\n"


def test_flush_waits_until_the_last_bit_has_left() -> None:
    with opened() as port:
        start = port.clock.now()
        port.write(b"D,9,9\n" * 10)
        port.flush()
        assert port.clock.now() - start == pytest.approx(wire_seconds(60, 38400), abs=1e-6)


def test_a_write_waits_when_the_drivers_buffer_is_full_and_gives_up_in_time() -> None:
    with opened() as port:
        start = port.clock.now()
        assert port.write(b"\n" * 5000) == 5000
        assert port.clock.now() - start == pytest.approx(wire_seconds(5000 - 4096, 38400), abs=1e-3)
        port.write_timeout = 0.1
        with pytest.raises(serial.SerialTimeoutException):
            port.write(b"\n" * 4096)


def test_another_rate_garbles_and_the_right_one_mends() -> None:
    with opened("emulator://empty?clock=simulated&baud=9600", baudrate=9600) as port:
        port.baudrate = 38400
        assert b"b,5" not in ask(port, b"B\n")
        port.baudrate = 9600
        ask(port, b"\n")
        assert ask(port, b"B\n").endswith(b"b,5.01,5.00\r\n")


def test_the_robots_own_rate_may_differ_from_the_ports() -> None:
    port = serial.serial_for_url("emulator://empty?clock=simulated&baud=9600", baudrate=38400, timeout=0.3)
    assert b"ROM of" not in port.read(300)


def test_sleeping_on_the_clock_moves_the_world() -> None:
    with opened() as port:
        ask(port, b"D,5,5\n")
        x = port.witness.pose()[0]
        port.clock.sleep_until(port.clock.now() + 2)
        assert port.witness.pose()[0] - x == pytest.approx(0.08, abs=0.01)
        assert port.witness.score()["distance_m"] > 0.07


def test_a_closed_port_refuses_but_its_witness_stays() -> None:
    port = opened()
    ask(port, b"D,5,5\n")
    port.clock.sleep_until(port.clock.now() + 1)
    port.close()
    score = port.witness.score()
    port.clock.sleep_until(port.clock.now() + 5)
    assert port.witness.score() == score
    assert score["distance_m"] > 0
    with pytest.raises(serial.PortNotOpenError):
        port.read(1)
    with pytest.raises(serial.PortNotOpenError):
        port.write(b"B\n")
    with pytest.raises(serial.PortNotOpenError):
        _ = port.in_waiting


def test_the_same_seed_gives_the_same_bytes() -> None:
    def session(seed: int) -> bytes:
        with opened(f"emulator://furnished?seed={seed}&clock=simulated") as port:
            told = b""
            for tick in range(50):
                told += ask(port, b"N\n") + ask(port, b"O\n") + ask(port, b"D,8,%d\n" % (tick % 9))
                port.clock.sleep_until(port.clock.now() + 0.07)
            return told + ask(port, b"H\n")

    assert session(1) == session(1) != session(2)


@pytest.mark.parametrize(
    ("url", "complaint"),
    [
        ("emulator://moon", "no arena 'moon'"),
        ("emulator://empty?sed=3", r"knows no 'sed'; there are scenario, .*, turrets"),
        ("emulator://empty?clock=sun", r"no clock 'sun'; there are wall and simulated"),
        ("emulator://empty?seed=-1", r"a whole number for seed, not '-1'"),
        ("emulator://empty?robot=koala", "no robot 'koala'; there are khepera and khepera2"),
        ("emulator://empty?turrets=k213,radar", "no turret 'radar'; there are gripper, k213, genio"),
        ("emulator://empty?baud=31250", r"no Khepera talks at 31250 baud"),
    ],
)
def test_a_mistake_in_the_name_is_one_sentence(url: str, complaint: str) -> None:
    with pytest.raises(KheperaHilError, match=complaint):
        serial.serial_for_url(url, baudrate=38400)


def test_an_arena_may_be_a_file(tmp_path: Any) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("title = 'mine'\n[start]\nat_mm = [300, 400]\n")
    with opened(f"emulator://{path}?clock=simulated") as port:
        assert port.witness.pose() == pytest.approx((0.3, 0.4, 0.0))


def test_robot_and_turrets_may_be_chosen() -> None:
    url = "emulator://empty?clock=simulated&robot=khepera2&turrets=gripper"
    with serial.serial_for_url(url, baudrate=57600, timeout=0.5) as port:
        assert port.read(2000).endswith(b"Serial Communication Protocol\r\n")
        assert ask(port, b"B\n") == b"b,6.01,6.01\r\n"
        assert ask(port, b"T,1,B\n") == b"t,1,b,1,0\r\n"
        assert ask(port, b"T,2,B\n") == b"z,Turret order not supported\r\n"


def test_the_wires_pace_follows_the_tool_serial_when_the_port_does() -> None:
    with opened(baudrate=9600) as port:
        port.write(b"serial 38400\n")
        port.flush()
        port.clock.sleep_until(port.clock.now() + 0.01)
        port.baudrate = 38400
        start = port.clock.now()
        assert ask(port, b"B\n") == b"b,5.01,5.00\r\n"
        assert port.clock.now() - start <= wire_seconds(2 + 13 + 4, 38400) + 1e-9


@pytest.mark.parametrize("end", [b"\r", b"\n", b"\r\n"])
@pytest.mark.parametrize("habit", ["ahead", "one by one", "byte by byte"])
def test_programs_of_all_habits_are_answered_alike(end: bytes, habit: str) -> None:
    commands = [b"B", b"G,7,-8", b"H", b"D,3,-3", b" K ", b"L,1,2", b"huh", b"T,2,B", b"R,32", b"D,0,0"]
    with opened() as port:
        said = b""
        for command in commands:
            line = command + end
            for piece in [line[i : i + 1] for i in range(len(line))] if habit == "byte by byte" else [line]:
                port.write(piece)
            if habit == "one by one":
                said += port.read_until(b"\r\n")
        while not said.endswith(b"r,0\r\nd\r\n"):
            piece = port.read(max(1, port.in_waiting))
            assert piece
            said += piece
    lines = said.decode().split("\r\n")
    assert lines[:2] == ["b,5.01,5.00", "g"]
    assert lines[4].startswith("k,0,0,")
    assert lines[5:] == ["l", "Command not found", "t,2,b,1,2", "r,0", "d", ""]
