"""The layout inside the file, seen by a real viewer without a screen: every panel shows without complaint."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from rerun.experimental import ViewerClient

from khepera_hil.viewer import ROWS_FAST, open_file
from tests.recording import synthetic

DRIVER = Path("/usr/share/vulkan/icd.d/lvp_icd.x86_64.json")
VIEWER = Path(sys.executable).with_name("rerun")

pytestmark = pytest.mark.skipif(
    not (DRIVER.exists() and VIEWER.exists()),
    reason="no viewer without a screen here: it needs mesa-vulkan-drivers and libvulkan1",
)

PATIENCE = 60.0


@contextmanager
def viewer(path: Path) -> Iterator[Any]:
    """A viewer that has loaded ``path``; yields its client."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [str(VIEWER), str(path), "--headless", "--window-size", "1600x900", "--bind", "127.0.0.1"]
    command += ["--port", str(port), "--hide-welcome-screen"]
    environment = dict(os.environ, VK_ICD_FILENAMES=str(DRIVER), RUST_LOG="error", HOME=str(path.parent))
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    ) as process:
        try:
            yield connect(process, port)
        finally:
            os.killpg(process.pid, signal.SIGKILL)  # the command is a wrapper: its child is the viewer


def connect(process: subprocess.Popen[bytes], port: int) -> Any:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and process.poll() is None:
        try:
            socket.create_connection(("127.0.0.1", port), 0.5).close()
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            state = client.get_state()
        except (OSError, RuntimeError):
            time.sleep(0.1)  # not up yet; the loop has its deadline
            continue
        if state.recordings and not state.loading:
            return client
        time.sleep(0.1)
    raise AssertionError("the viewer did not come up")


@pytest.mark.parametrize("world", [True, False])
def test_every_panel_of_the_layout_shows_without_complaint(tmp_path: Path, world: bool) -> None:
    path = tmp_path / "run.rrd"
    sink = open_file(path, {"program": "home", "seed": 7, **synthetic.manifest(world)}, rows=ROWS_FAST)
    for tick in synthetic.ticks(60, world=world):
        sink.write(tick, 0)
    sink.close()
    with viewer(path) as client:
        client.set_time("run_time", duration=4.0, play_state="paused")
        picture = client.take_screenshot()
        state = client.get_state()
    assert picture.startswith(b"\x89PNG")
    assert {line.name for line in state.recordings[0].timelines} == {"run_time", "tick", "wall_clock"}
    names = [view.name for view in state.views]
    assert [view.name for view in state.views if view.reports] == []
    for start in (
        "P(Vrot | Dir Prox Theta1)",
        "P(H | Prox)",
        "Events",
        "Wheels",
        "Proximity",
        "Vrot, the last 30 s",
    ):
        assert any(name.startswith(start) for name in names), names
    assert any(name.startswith("Arena furnished" if world else "Robot") for name in names)
