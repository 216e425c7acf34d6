"""A picture of the viewer without a screen: a viewer that draws into memory, asked for what it would show."""

from __future__ import annotations

import socket
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from khepera_hil.errors import ViewerError
from khepera_hil.viewer import program

__all__ = ["headless", "picture"]

PATIENCE = 90.0
"""Seconds in which the viewer must be there; drawing without a graphics card is slow."""

STEP = 0.3
"""Seconds between two looks."""

NEEDS = "drawing without a screen needs a Vulkan driver, such as the packages mesa-vulkan-drivers and libvulkan1"


def picture(files: Sequence[Path], at: float | None, size: tuple[int, int]) -> tuple[bytes, list[str]]:
    """The viewer with these files as PNG, ``at`` so many seconds of the run (its end, where None), and what its
    panels complain of. Raises ViewerError when no viewer comes up here.
    """
    with headless(files, size) as client:
        if at is not None:
            client.set_time("run_time", duration=at, play_state="paused")
        before, shown = b"", b"?"
        end = time.monotonic() + PATIENCE
        # Chunks are read when they are needed: it is done when two looks are alike.
        while before != shown and time.monotonic() < end:
            time.sleep(STEP)
            before, shown = shown, client.take_screenshot()
        complaints = [f"{view.name}: {view.reports}" for view in client.get_state().views if view.reports]
    return shown, complaints


@contextmanager
def headless(files: Sequence[Path], size: tuple[int, int]) -> Iterator[Any]:
    """A viewer without a window that has loaded the files; yields rerun's client of it."""
    port = program.free_port("127.0.0.1")
    width, height = size
    arguments = ["--headless", "--window-size", f"{width}x{height}", "--hide-welcome-screen"]
    arguments += ["--bind", "127.0.0.1", "--port", str(port)]
    # A home of its own: what somebody changed in their viewer does not change the picture.
    with tempfile.TemporaryDirectory() as home:
        process = program.start(
            [*files, *arguments], environment={"HOME": home, "XDG_DATA_HOME": home, **program.software_rendering()}
        )
        try:
            yield _connected(process, port)
        finally:
            program.end(process)


def _connected(process: Any, port: int) -> Any:
    from rerun.experimental import ViewerClient  # late: half a second

    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if process.poll() is not None:
            raise ViewerError(f"the viewer ended with code {process.returncode}; {NEEDS}")
        try:
            socket.create_connection(("127.0.0.1", port), 0.5).close()
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            state = client.get_state()
        except (OSError, RuntimeError):
            time.sleep(STEP)  # not up yet; the loop has its deadline
            continue
        if state.recordings and state.active_recording and not state.loading:
            return client
        time.sleep(STEP)
    raise ViewerError(f"the viewer did not come up within {PATIENCE:g} s; {NEEDS}")
