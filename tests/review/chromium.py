"""A real browser without a window, spoken to over its debugging pipe."""

from __future__ import annotations

import fcntl
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

__all__ = ["CHROMIUM", "Browser", "browser"]

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

_FLAGS = ["--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run", "--disable-gpu-sandbox"]
_FLAGS += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=800,600"]


class Browser:
    """One page of it."""

    def __init__(self, commands: int, events: int) -> None:
        self._commands, self._events = commands, events
        self._text = b""
        self._count = 0
        self._session: str | None = None
        self.received: dict[str, int] = {}
        """Bytes that came so far, by the address that they were asked from."""
        self._asked: dict[str, str] = {}

    def open(self, url: str) -> None:
        """Go there."""
        page = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        self._call("Network.enable")
        self._call("Page.navigate", url=url)

    def wait_for(self, start: str, count: int, patience: float) -> bool:
        """Whether so many bytes come from addresses that start so."""
        end = time.monotonic() + patience
        while sum(n for url, n in self.received.items() if url.startswith(start)) < count:
            if time.monotonic() > end:
                return False
            self._listen(1.0)
        return True

    def _call(self, method: str, **parameters: Any) -> Any:
        self._count += 1
        message: dict[str, Any] = {"id": self._count, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        while True:
            for answer in self._listen(60.0):
                if answer.get("id") == self._count:
                    return answer["result"]

    def _listen(self, patience: float) -> list[dict[str, Any]]:
        if not select.select([self._events], [], [], patience)[0]:
            return []
        self._text += os.read(self._events, 1 << 20)
        *whole, self._text = self._text.split(b"\0")
        messages: list[dict[str, Any]] = [json.loads(one) for one in whole]
        for message in messages:
            what = message.get("params", {})
            if message.get("method") == "Network.requestWillBeSent":
                self._asked[what["requestId"]] = what["request"]["url"]
            elif message.get("method") == "Network.dataReceived":
                url = self._asked.get(what["requestId"], "?")
                self.received[url] = self.received.get(url, 0) + what["dataLength"]
        return messages


@contextmanager
def browser(home: Path) -> Iterator[Browser]:
    """A browser with an empty profile in ``home``."""
    assert CHROMIUM is not None
    from_us, commands = os.pipe()
    events, to_us = os.pipe()
    high = [fcntl.fcntl(one, fcntl.F_DUPFD, 20) for one in (from_us, to_us)]
    os.close(from_us)
    os.close(to_us)
    # The browser reads its pipe at 3 and writes at 4: a shell puts them there.
    shell = f'exec "$@" 3<&{high[0]} 4>&{high[1]}'
    process = subprocess.Popen(
        ["bash", "-c", shell, "bash", CHROMIUM, *_FLAGS, f"--user-data-dir={home}", "about:blank"],
        pass_fds=high,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    for one in high:
        os.close(one)
    try:
        yield Browser(commands, events)
    finally:
        os.close(commands)  # which ends it
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            process.wait()
        os.close(events)
