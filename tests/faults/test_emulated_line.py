"""Faults on the line of the emulated robot: in simulated time, by the port's name."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
import serial

from khepera_hil.errors import LinkLost, NoAnswer, PortError, UsageError
from khepera_hil.khepera import Khepera
from khepera_hil.link import Link
from khepera_hil.opening import open_port, reopen

URL = "emulator://empty?clock=simulated&seed=4"


@pytest.fixture(autouse=True)
def _handler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial, "protocol_handler_packages", ["serial.urlhandler", "khepera_hil.ports"])


@contextmanager
def emulated(faults: str | None) -> Iterator[Any]:
    with closing(open_port(URL + ("" if faults is None else f"&faults={faults}"), 38400)) as port:
        yield port


def khepera_behind(port: Any) -> Khepera:
    return Khepera(Link(port, port.clock, baud=38400))


def test_a_line_with_faults_that_never_come_is_a_good_line() -> None:
    said = []
    for faults in (None, "flip=0"):
        with emulated(faults) as port:
            khepera = khepera_behind(port)
            khepera.handshake()
            said.append((khepera.proximity(), khepera.light(), port.clock.now()))
    assert said[0] == said[1]


def test_the_specification_does_what_it_says_and_repeats() -> None:
    def counts() -> tuple[int, ...]:
        with emulated("flip=0.01") as port:
            khepera = khepera_behind(port)
            for _ in range(200):
                try:
                    khepera.proximity()
                except NoAnswer:
                    pass
                except Exception as error:  # noqa: BLE001 - which of ours is counted below
                    assert type(error).__name__ in {"BadAnswer", "Refused"}  # noqa: PT017
            counters = khepera.link.counters
            return counters.accepted, counters.no_answer, counters.bad_answer, port.faults.counts["flip"]

    first = counts()
    assert first == counts()
    assert first[1] + first[2] > 10


def test_a_mistake_in_it_is_told() -> None:
    with pytest.raises(UsageError, match="there is no fault 'flop'"), emulated("flop=1"):
        pass


def test_a_line_that_is_unplugged_is_lost_and_leads_to_the_same_robot_again() -> None:
    with emulated("disconnect@1+5") as port:
        khepera = khepera_behind(port)
        khepera.handshake()
        khepera.set_speed(2, 2)
        start = port.witness.pose()
        port.clock.sleep_until(1.0)
        with pytest.raises(LinkLost, match="emulator://empty is gone"):
            khepera.proximity()
        with pytest.raises(PortError, match="is unplugged"):
            reopen(port, URL, 38400)
        port.clock.sleep_until(6.0)
        assert port.witness.pose() != start, "it went on as it was told"
        assert reopen(port, URL, 38400) is port
        again = khepera_behind(port)
        assert again.handshake() == ("5.01", "5.00")
        assert again.link.counters.boot_texts == 0, "it was not reset"
        assert again.speeds() != (0, 0)
        assert again.stop()


def test_also_a_line_that_was_away_between_two_uses_is_lost() -> None:
    with emulated("disconnect@1+0.01") as port:
        khepera = khepera_behind(port)
        khepera.handshake()
        port.clock.sleep_until(2.0)
        with pytest.raises(LinkLost):
            khepera.proximity()


def test_a_robot_whose_host_stalls_is_read_again_when_it_is_over() -> None:
    with emulated("stall@1+0.3") as port:
        khepera = khepera_behind(port)
        khepera.handshake()
        port.clock.sleep_until(1.0)
        with pytest.raises(NoAnswer):
            khepera.proximity()
        port.clock.sleep_until(1.4)
        assert len(khepera.proximity()) == 8


def test_a_scenarios_troubles_are_on_the_line(tmp_path: Path) -> None:
    scenario = tmp_path / "silence.toml"
    scenario.write_text(
        'title = "silence"\n[[event]]\nat_s = 2\nkind = "link-fault"\nfault = "silent"\nlasts_s = 1\n'
    )
    with closing(open_port(f"{URL}&scenario={scenario}", 38400)) as port:
        emulated: Any = port
        khepera = khepera_behind(emulated)
        khepera.handshake()
        heard = []
        for tenth in range(1, 40):
            emulated.clock.sleep_until(tenth / 10)
            try:
                heard.append(len(khepera.proximity()) == 8)
            except NoAnswer:
                heard.append(False)
        assert heard[:19] == [True] * 19
        assert not any(heard[20:28])
        assert all(heard[31:])
        assert emulated.witness.faults()["drop"] > 0
