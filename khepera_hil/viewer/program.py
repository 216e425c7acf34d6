"""The viewer as a program: where it is, and how one is run beside us."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from khepera_hil.errors import ViewerError

__all__ = ["end", "free_port", "has_screen", "program", "software_rendering", "start"]

_NAME = "rerun"


def program() -> str:
    """The viewer's path: beside the interpreter, where it is of our own version, or else on the PATH.

    Raises ViewerError when it is in neither.
    """
    beside = Path(sys.executable).with_name(_NAME)
    found = str(beside) if beside.exists() else shutil.which(_NAME)
    if found is None:
        raise ViewerError(f"the viewer's program {_NAME} is not installed; it comes with the package rerun-sdk")
    return found


_TIED = """\
exec 3<&0
"$@" 3<&- </dev/null &
viewer=$!
(cat <&3 >/dev/null; kill -9 -$$) &
wait $viewer
"""
# We hold the other end of its standard input: when that ends, however we ended, all of its group is killed.


def start(
    arguments: Sequence[str | Path], *, outlives: bool = False, environment: Mapping[str, str] | None = None
) -> subprocess.Popen[bytes]:
    """Run it in a session of its own, so that Ctrl-C here does not end it, with nothing of it on our terminal.

    Unless it ``outlives`` us it ends with this process, even where that is killed.
    """
    command = [program(), *map(str, arguments)]
    return subprocess.Popen(
        command if outlives else ["/bin/sh", "-c", _TIED, "sh", *command],
        env={**os.environ, "RUST_LOG": "error", **(environment or {})},
        stdin=subprocess.DEVNULL if outlives else subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def end(process: subprocess.Popen[bytes]) -> None:
    """Kill it with its children: what is on the PATH is a wrapper, and the viewer its child."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    if process.stdin is not None:
        process.stdin.close()
    process.wait()


def has_screen() -> bool:
    """Whether a window could be opened here."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def software_rendering() -> dict[str, str]:
    """The environment in which Vulkan draws without a graphics card, if that is installed."""
    found = sorted(Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json"))
    return {"VK_ICD_FILENAMES": str(found[0])} if found else {}


def free_port(host: str, wanted: int = 0) -> int:
    """A port that nobody listens on at this moment: ``wanted``, or any. Raises OSError."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as a server does
        one.bind((host, wanted))
        return int(one.getsockname()[1])
