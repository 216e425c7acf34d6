"""What the host's side does to a serial line: adapters that hold bytes back, other programs that take them away.

Linux tells both in its pseudo files; elsewhere there is nothing to be known, and nothing is said.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path

import serial

__all__ = ["hurry", "latency_ms", "search"]

SYS = Path("/sys")
PROC = Path("/proc")

_PTY_MAJORS = range(136, 144)  # of pseudo-terminals: 256 in each


def latency_ms(device: str) -> int | None:
    """Milliseconds for which the adapter may hold the end of an answer; None where it has no such timer."""
    try:
        return int(_timer(device).read_text())
    except (OSError, ValueError):
        return None


def hurry(port: serial.Serial) -> str | None:
    """Have the adapter pass bytes on at once; a sentence for the user where it has a timer that cannot be lowered.

    An FTDI chip holds the end of an answer for 16 ms unless it is told otherwise, which makes three requests last
    half a tick.
    """
    # The driver's own switch; a pseudo-terminal and most other drivers have none.
    with contextlib.suppress(OSError, AttributeError, ValueError, NotImplementedError):
        port.set_low_latency_mode(True)
    device = str(port.port)
    held = latency_ms(device)
    if held is None or held <= 1:
        return None
    with contextlib.suppress(OSError):
        _timer(device).write_text("1")
    held = latency_ms(device)
    if held is None or held <= 1:
        return None
    return (
        f"the adapter of {device} holds the end of each answer for up to {held} ms, and we may not change it: "
        f"as root, write 1 to {_timer(device)}"
    )


def search(fd: int) -> Iterator[str | None]:
    """Other programs that have the same device open, such as ``pid 4711 (minicom)``: a process of this machine at
    a time, and None for one that has it not. All of them together take some milliseconds.

    Each byte that comes goes to one reader only. Not among them: our own children (a guard holds the port too),
    whoever holds the other end of a pseudo-terminal, and what the system does not let us see.
    """
    try:
        device = os.fstat(fd).st_rdev
        processes = os.listdir(PROC)
    except OSError:
        return
    me = os.getpid()
    for name in processes:
        if name.isdigit() and int(name) != me:
            process = PROC / name
            rival = _has_open(process, device) and _parent(process) != me and not _serves(process, device)
            yield _name(process) if rival else None


def _timer(device: str) -> Path:
    return SYS / "bus/usb-serial/devices" / Path(os.path.realpath(device)).name / "latency_timer"


def _parent(process: Path) -> int:
    with contextlib.suppress(OSError, ValueError, IndexError):
        return int((process / "stat").read_text().rpartition(")")[2].split()[1])
    return 0


def _has_open(process: Path, device: int) -> bool:
    """Whether a process has this device open; it has not where we may not look, or where it has ended."""
    with contextlib.suppress(OSError), os.scandir(process / "fd") as entries:
        for entry in entries:
            with contextlib.suppress(OSError):
                status = entry.stat()
                if status.st_rdev == device and stat.S_ISCHR(status.st_mode):
                    return True
    return False


def _serves(process: Path, device: int) -> bool:
    """Whether a process holds the controlling end of this pseudo-terminal, as an emulator does."""
    if os.major(device) not in _PTY_MAJORS:
        return False
    index = os.minor(device) + 256 * (os.major(device) - _PTY_MAJORS[0])
    with contextlib.suppress(OSError):
        for name in os.listdir(process / "fdinfo"):
            with contextlib.suppress(OSError):
                if f"tty-index:\t{index}\n" in (process / "fdinfo" / name).read_text():
                    return True
    return False


def _name(process: Path) -> str:
    try:
        return f"pid {process.name} ({(process / 'comm').read_text().strip()})"
    except OSError:
        return f"pid {process.name}"
