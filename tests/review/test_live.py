"""Looking on: viewers and browsers come late, stand still and go, and nobody waits for them."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

from khepera_hil.errors import UsageError
from khepera_hil.follower import Follower
from khepera_hil.reading import Run
from khepera_hil.viewer import program
from khepera_hil.viewer.live import Address, LiveView, address, open_live
from khepera_hil.viewer.program import software_rendering
from tests.recording import synthetic
from tests.review.chromium import CHROMIUM, browser
from tests.runs.cli import start
from tests.runs.test_wall import line_with

COUNT = 60

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")


@pytest.fixture
def live() -> Iterator[tuple[Address, LiveView]]:
    where = address()
    sink = open_live({"program": "home", "run": "live", **synthetic.manifest()}, where, page=True, window=False)
    yield where, sink
    sink.close()


def fetched(url: str) -> bytes:
    """The page, as soon as its server is up."""
    end = time.monotonic() + 60
    while True:
        try:
            with urllib.request.urlopen(url, timeout=5) as answer:
                page = answer.read()
                assert isinstance(page, bytes)
                return page
        except OSError:
            assert time.monotonic() < end
            time.sleep(0.1)


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here to open the page with")
def test_the_page_opens_in_a_browser_and_gets_the_run(live: tuple[Address, LiveView], tmp_path: Path) -> None:
    where, sink = live
    for tick in synthetic.ticks(COUNT):
        sink.write(tick, 0)
    sink.flush()
    fetched(where.page)
    with browser(tmp_path) as page:
        page.open(where.page)
        ours = f"http://127.0.0.1:{where.web_port}/"
        assert page.wait_for(ours, 1_000_000, 60), "the viewer itself"
        assert page.wait_for(f"http://127.0.0.1:{where.grpc_port}/", 50_000, 90), "what was sent before it came"
        got = sum(n for url, n in page.received.items() if f":{where.grpc_port}/" in url)
        for tick in list(synthetic.ticks(2 * COUNT))[COUNT:]:
            sink.write(tick, 0)
        sink.flush()
        assert page.wait_for(f"http://127.0.0.1:{where.grpc_port}/", got + 50_000, 60), "and what is sent since"


@pytest.mark.skipif(not software_rendering(), reason="no viewer without a screen here")
def test_a_viewer_may_come_late_stand_still_and_go(live: tuple[Address, LiveView]) -> None:
    from rerun.experimental import ViewerClient

    where, sink = live
    follower = Follower(sink, name="the live view", waits=False, capacity=2 * COUNT)
    ticks = synthetic.ticks(10**9)
    for _ in range(COUNT):
        follower.offer(next(ticks))
    port = program.free_port("127.0.0.1")
    viewer = program.start(
        [where.stream, "--headless", "--bind", "127.0.0.1", "--port", str(port)], environment=software_rendering()
    )
    try:
        assert seen(ViewerClient, port) == {"run_time", "tick", "wall_clock"}
        os.killpg(viewer.pid, signal.SIGSTOP)
        for _ in range(COUNT):
            follower.offer(next(ticks))
    finally:
        program.end(viewer)
    for _ in range(COUNT):
        follower.offer(next(ticks))
    assert follower.dropped == 0
    assert follower.close() == []


def seen(client_of: Any, port: int) -> set[str]:
    """The timelines of what the viewer has got, once it has any."""
    end = time.monotonic() + 90
    while time.monotonic() < end:
        try:
            socket.create_connection(("127.0.0.1", port), 0.5).close()
            state = client_of.connect(f"rerun+http://127.0.0.1:{port}/proxy").get_state()
        except (OSError, RuntimeError):
            time.sleep(0.2)
            continue
        if state.recordings and state.recordings[0].timelines:
            return {line.name for recording in state.recordings for line in recording.timelines}
        time.sleep(0.2)
    raise AssertionError("the viewer got nothing")


def test_a_run_that_is_served_says_where_and_loses_nothing(tmp_path: Path) -> None:
    process = start("--serve", "--duration", "4", "--seed", "3", "--json", cwd=tmp_path)
    said = line_with(process, "look on at ")
    page = fetched(said.split()[3])
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert b"rerun" in page.lower()
    result = json.loads(out.splitlines()[-1])
    manifest = json.loads((tmp_path / result["run"] / "manifest.json").read_text())
    assert manifest["ending"]["losses"] == []
    with pytest.raises(OSError, match=r"refused|reset"):
        urllib.request.urlopen(said.split()[3], timeout=5)


def test_a_live_view_that_takes_nothing_costs_ticks_of_its_own_only() -> None:
    """What a server that stands still does not take is counted and told; a thousand offers do not wait once."""

    class Still:
        def write(self, item: int, dropped: int) -> None:
            gate.wait()

        def flush(self) -> None: ...

        def close(self) -> None: ...

    gate = threading.Event()
    follower = Follower[int](Still(), name="the live view", waits=False, capacity=8)
    for item in range(1000):
        follower.offer(item)
    assert 990 <= follower.dropped <= 992
    gate.set()
    (sentence,) = follower.close()
    assert sentence == f"the live view lacks {follower.dropped} ticks"


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [("127.0.0.1", "127.0.0.1", None), ("localhost", "127.0.0.1", None), ("0.0.0.0", "0.0.0.0", None)],
)
def test_an_address_is_a_host_and_perhaps_a_port(text: str, host: str, port: int | None) -> None:
    found = address(text)
    assert found.host in (host, "::1")
    assert found.web_port != found.grpc_port
    free = program.free_port("127.0.0.1")
    assert address(f"127.0.0.1:{free}").web_port == free
    assert f":{free}/?url=rerun%2Bhttp" in address(f"127.0.0.1:{free}").page


@pytest.mark.parametrize("text", ["127.0.0.1:0", "127.0.0.1:99999", "127.0.0.1:x", "no.such.host.invalid", "[::"])
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(UsageError):
        address(text)


def test_a_port_in_use_is_told_before_the_run_begins(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = start("--serve", f"127.0.0.1:{port}", "--fast", "--duration", "1", cwd=tmp_path)
        _, err = done.communicate(timeout=60)
        assert done.returncode == 2
        assert f"cannot serve at 127.0.0.1:{port}" in err
        assert not (tmp_path / "runs").exists()


def test_nothing_of_it_is_left_when_the_run_has_ended(live: tuple[Address, LiveView]) -> None:
    where, sink = live
    page = sink._page
    assert isinstance(page, subprocess.Popen)
    sink.close()
    assert page.poll() is not None
    for port in (where.web_port, where.grpc_port):
        assert program.free_port("127.0.0.1", port) == port


def test_a_run_that_is_killed_leaves_no_server_behind(tmp_path: Path) -> None:
    process = start("--serve", "--duration", "60", "--seed", "3", cwd=tmp_path)
    try:
        url = line_with(process, "look on at ").split()[3]
        assert b"rerun" in fetched(url).lower()
    finally:
        process.kill()
        process.communicate()
    end = time.monotonic() + 60
    while True:
        try:
            urllib.request.urlopen(url, timeout=5).close()
        except OSError:
            break
        assert time.monotonic() < end, "the page is served on"
        time.sleep(0.1)


def test_a_program_that_ends_by_itself_says_how(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "viewer"
    script.write_text("#!/bin/sh\nexit 7\n")
    script.chmod(0o755)
    monkeypatch.setattr("khepera_hil.viewer.program.program", lambda: str(script))
    process = program.start([])
    assert process.wait(60) == 7
    program.end(process)


def test_a_window_is_opened_on_the_stream_and_nowhere_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "viewer"
    script.write_text(f'#!/bin/sh\nprintf "%s " "$@" > {tmp_path}/asked\n')
    script.chmod(0o755)
    monkeypatch.setattr("khepera_hil.viewer.program.program", lambda: str(script))
    where = address()
    sink = open_live({"program": "home", "run": "live", **synthetic.manifest()}, where, page=False, window=True)
    sink.write(next(synthetic.ticks(1)), 0)
    sink.close()
    end = time.monotonic() + 60
    while not (tmp_path / "asked").exists() or not (tmp_path / "asked").read_text():
        assert time.monotonic() < end
        time.sleep(0.05)
    assert (tmp_path / "asked").read_text() == f"{where.stream} --bind 127.0.0.1 --port auto "


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_recorded_run_is_shown_in_a_browser_until_ctrl_c(how: signal.Signals, home: Run, tmp_path: Path) -> None:
    process = start("review", home.folder, "--serve", cwd=tmp_path)
    try:
        said = line_with(process, "Ctrl-C ends it")
        url = next(word for word in said.split() if word.startswith("http")).rstrip(";")
        assert b"rerun" in fetched(url).lower()
        if CHROMIUM is not None and how == signal.SIGINT:
            stream = unquote(url.partition("url=rerun%2B")[2]).removesuffix("/proxy")
            with browser(tmp_path) as page:
                page.open(url)
                assert page.wait_for(stream, 50_000, 120), "the run's data"
        process.send_signal(how)
        _, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (0, "")
        with pytest.raises(OSError, match=r"refused|reset"):
            urllib.request.urlopen(url, timeout=5)
    finally:
        process.kill()
        process.communicate()
