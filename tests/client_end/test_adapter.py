"""The host's side of a line: who else reads from it, and adapters that hold bytes back."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from khepera_hil import adapter
from khepera_hil.errors import NoAnswer, PortError
from khepera_hil.lookout import AGAIN
from khepera_hil.opening import WRITE_TIMEOUT, open_port, search
from tests.client_end.robots import BAUD, Cable, Robot, connected


@contextmanager
def another_program(name: str, *, forks: bool = True) -> Iterator[int]:
    """Has the device open, without any lock, and does nothing; its pid. It is no child of ours if it forks."""
    code = (
        "import os, sys\n"
        f"if {forks} and os.fork(): os._exit(0)\n"
        "fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)\n"
        "print(os.getpid(), flush=True)\n"
        "sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        pid = int(process.stdout.readline())
        if forks:
            process.wait()  # its child has the pipe too
        yield pid
        process.stdin.close()


def test_a_port_that_another_program_reads_from_is_in_use(cable: Cable) -> None:
    with (
        another_program(cable.name) as pid,
        pytest.raises(PortError, match=rf"is in use by another program, pid {pid} \(python.*\): end that"),
    ):
        open_port(cable.name, BAUD)


def test_who_comes_later_and_takes_bytes_away_is_named(cable: Cable) -> None:
    robot = Robot(cable.end, mute=True)
    try:
        with connected(open_port(cable.name, BAUD)) as khepera:
            khepera.link.margin = 0.0
            lookout, clock = khepera.link.lookout, khepera.link.clock

            def told() -> str:
                """What the first failure after a search says."""
                with pytest.raises(NoAnswer):
                    khepera.proximity()
                for _ in range(10_000):  # pieces, of which it takes a few
                    lookout.look()
                with pytest.raises(NoAnswer) as failure:
                    khepera.proximity()
                return str(failure.value)

            assert "also open" not in told()
            clock.sleep_until(clock.now() + AGAIN)
            with another_program(cable.name) as pid:
                assert f"{cable.name} is also open in pid {pid} (python" in told()
            clock.sleep_until(clock.now() + AGAIN)
            assert "also open" not in told()
    finally:
        robot.off()


def test_our_own_children_are_no_rivals(cable: Cable) -> None:
    port = open_port(cable.name, BAUD)
    with another_program(cable.name, forks=False):
        assert set(search(port)) <= {None}
    port.close()


def test_the_emulator_that_holds_its_own_terminal_open_is_none(cable: Cable, tmp_path: Path) -> None:
    code = (
        "import os, sys\n"
        "if os.fork(): os._exit(0)\n"
        "master, slave = os.openpty()\n"
        "print(os.ttyname(slave), flush=True)\n"
        "sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        name = process.stdout.readline().strip()
        process.wait()
        open_port(name, BAUD).close()
        process.stdin.close()


def test_where_nothing_can_be_seen_nobody_is_suspected(cable: Cable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapter, "PROC", Path("/no/such/folder"))
    with another_program(cable.name):
        open_port(cable.name, BAUD).close()


# Adapters


class Adapter:
    """A made-up /sys with one adapter in it."""

    def __init__(self, folder: Path, device: str) -> None:
        self.timer = folder / "bus/usb-serial/devices" / Path(device).name / "latency_timer"
        self.timer.parent.mkdir(parents=True)
        self.timer.write_text("16\n")


@pytest.fixture
def ftdi(cable: Cable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Adapter:
    monkeypatch.setattr(adapter, "SYS", tmp_path)
    return Adapter(tmp_path, cable.name)


def test_an_adapters_latency_timer_is_lowered(cable: Cable, ftdi: Adapter) -> None:
    said: list[str] = []
    open_port(cable.name, BAUD, said.append).close()
    assert ftdi.timer.read_text() == "1"
    assert said == []


def test_where_it_cannot_be_lowered_it_is_said_in_a_line(
    cable: Cable, ftdi: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    def forbidden(self: Path, text: str) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "write_text", forbidden)
    said: list[str] = []
    open_port(cable.name, BAUD, said.append).close()
    assert len(said) == 1
    assert f"the adapter of {cable.name} holds the end of each answer for up to 16 ms" in said[0]
    assert said[0].endswith(f"as root, write 1 to {ftdi.timer}")


def test_a_line_without_such_an_adapter_has_nothing_to_be_said(cable: Cable) -> None:
    said: list[str] = []
    open_port(cable.name, BAUD, said.append).close()
    assert said == []
    assert adapter.latency_ms(cable.name) is None


# Writing


def test_a_write_that_is_not_taken_fails_in_time_and_one_that_is_does_not(cable: Cable) -> None:
    port = open_port(cable.name, BAUD)
    assert port.write(b"N\n") == 2
    with pytest.raises(OSError, match="not taken"):  # noqa: PT012 - how much the kernel holds is its choice
        for _ in range(10_000):
            port.write(bytes(1 << 12))
    assert WRITE_TIMEOUT < 0.1, "within a tick"
    os.read(cable.end, 1 << 16)
    assert port.write(b"N\n") == 2
    port.close()
    with pytest.raises(OSError, match="not open"):
        port.write(b"N\n")
