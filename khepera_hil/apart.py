"""A follower in a process of its own: what it does shares no interpreter's lock with the loop.

A thread that holds the lock may be put aside by a busy machine, and then the loop waits too, whatever its own
rights. So with the wall clock the viewer's file and a live view are made elsewhere, by a sink as
:class:`~khepera_hil.follower.Follower` feeds one in a thread. The process outlives us for as long as it needs to
finish what it was given: also the file of a killed run has its end.

The two are joined by a pair of sockets. From the loop come messages, pickled and each behind its length in eight
bytes: how to open the sink, then items, then a farewell. Back come lines of JSON: that it is open, that it failed,
what was lost. Past ``capacity`` items that wait on either side the newest are dropped and counted.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import pickle
import select
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Mapping
from typing import Any, Generic, TypeVar

from khepera_hil.follower import Follower, Sink

__all__ = ["Apart"]

T = TypeVar("T")

_LENGTH = 8
_FAREWELL = b""
_NICE = 10
"""Steps by which the process stands back behind the loop."""

_ENDED = "its process has ended"

_LONG = 60.0
"""Seconds that a sink may take to open or to finish, where no deadline of the loop's comes before."""


class Apart(Generic[T]):
    """Feeds a sink in another process. ``opening`` is ``module:function``, called there with ``arguments``.

    ``patience`` (s) bounds :meth:`wait_until_open`, ``deadline`` (s) bounds :meth:`close`. One thread calls.
    """

    def __init__(
        self,
        opening: str,
        arguments: Mapping[str, Any],
        *,
        name: str,
        capacity: int = 256,
        patience: float = 30.0,
        deadline: float = 10.0,
    ) -> None:
        self.name = name
        self.error: str | None = None
        """Why the sink gave up, or None."""
        self.dropped = 0
        """Items that never reached the sink so far."""
        self._capacity, self._patience, self._deadline = capacity, patience, deadline
        self._waiting: deque[bytes] = deque()
        self._process: subprocess.Popen[bytes] | None = None
        self._said = b""
        self._open = self._closed = self._finished = False
        try:
            self._pipe, self._process = _started()
        except OSError as error:
            self.error, self._finished = f"its process does not start: {error.strerror or error}", True
            return
        self._put(pickle.dumps((opening, dict(arguments), capacity)))

    @property
    def pid(self) -> int | None:
        """Of the process, if it was started."""
        return None if self._process is None else self._process.pid

    @property
    def waiting(self) -> int:
        """Items that the process has not taken yet; they go with us when we are killed."""
        return len(self._waiting)

    def wait_until_open(self) -> None:
        """Wait until the sink was opened, or has failed to be within ``patience`` seconds."""
        end = time.monotonic() + self._patience
        while not self._open and self.error is None and self.talk(end - time.monotonic()):
            pass
        if not self._open and self.error is None:
            self.error = f"it could not be opened within {self._patience:g} s"

    def offer(self, item: T) -> None:
        """Hand an item over, or drop and count it; never waits, never raises."""
        self.talk(0.0)
        if self.error is not None or self._closed or len(self._waiting) >= self._capacity:
            self.dropped += 1
            return
        try:
            message = pickle.dumps((item, self.dropped), pickle.HIGHEST_PROTOCOL)
        except Exception as error:  # noqa: BLE001 - as in a follower: it must not reach the loop
            self.error = f"{type(error).__name__}: {error}"
            self.dropped += 1
            return
        self._put(message)

    def close(self) -> list[str]:
        """Let the sink take what there is and close it; sentences about what was lost, told once."""
        if self._closed:
            return []
        self._closed = True
        late = self._process is not None and not self._ended(self._process, time.monotonic() + self._deadline)
        if self._process is not None and self.error == _ENDED:
            self.error = f"its process was ended by {_named(self._process.returncode)}"
        losses = []
        if self.error is not None:
            losses.append(f"{self.name} is incomplete: {self.error}")
        elif late:
            losses.append(f"{self.name} was not finished within {self._deadline:g} s")
        if self.dropped:
            losses.append(f"{self.name} lacks {self.dropped} ticks")
        return losses

    def _ended(self, process: subprocess.Popen[bytes], end: float) -> bool:
        """Have the process finish, or kill it at ``end``; whether it came to its own end."""
        self._put(_FAREWELL)
        while not self._finished and self.talk(end - time.monotonic()):
            pass
        self._pipe.close()
        try:
            process.wait(max(0.0, end - time.monotonic()))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            return False
        return True

    def _put(self, message: bytes) -> None:
        self._waiting.append(len(message).to_bytes(_LENGTH, "little") + message)
        self.talk(0.0)

    def talk(self, seconds: float) -> bool:
        """Send what is taken and hear what is said, waiting so long at most; False when there was nothing."""
        if self._finished or seconds < 0.0:
            return False
        poll = select.poll()
        poll.register(self._pipe, select.POLLIN | (select.POLLOUT if self._waiting else 0))
        events = poll.poll(1000 * seconds)
        if not events:
            return False
        if self._waiting:
            self._send()
        if events[0][1] & ~select.POLLOUT:
            self._listen()
        return True

    def _send(self) -> None:
        try:
            while self._waiting:
                taken = self._pipe.send(self._waiting[0])
                if taken < len(self._waiting[0]):
                    self._waiting[0] = self._waiting[0][taken:]
                else:
                    self._waiting.popleft()
        except BlockingIOError:
            pass
        except OSError:
            self._waiting.clear()  # the process has ended; what it said before is still to be heard

    def _listen(self) -> None:
        try:
            said = self._pipe.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            said = b""
        *lines, self._said = (self._said + said).split(b"\n")
        for line in lines:
            self._hear(json.loads(line))
        if not said and not self._finished:
            self._end()

    def _hear(self, said: dict[str, Any]) -> None:
        self._open = self._open or "open" in said
        if self.error is None:
            self.error = said.get("error")
        self.dropped += said.get("dropped", 0)
        self._finished = self._finished or "finished" in said

    def _end(self) -> None:
        """The process has closed its end without having said that it finished."""
        self._finished = True
        self.error = self.error or _ENDED


def _started() -> tuple[socket.socket, subprocess.Popen[bytes]]:
    ours, theirs = socket.socketpair()
    with theirs:
        try:
            process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # out of reach of the terminal's Ctrl-C
            )
        except BaseException:
            ours.close()
            raise
    ours.setblocking(False)
    return ours, process


def _named(code: int | None) -> str:
    """What ended a process."""
    if code is None or code >= 0:
        return "itself"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"


class _Counted:
    """A sink that is told what was lost on both sides."""

    def __init__(self, sink: Sink[Any]) -> None:
        self._sink = sink
        self.flush, self.close = sink.flush, sink.close

    def write(self, item: tuple[Any, int], dropped: int) -> None:
        """Take an item, and with it how many were lost before it came here."""
        self._sink.write(item[0], item[1] + dropped)


class _Feeding:
    """The other end of the pipe: what comes is taken off it at once, and waits here for the sink."""

    def __init__(self, pipe: socket.socket) -> None:
        self._pipe = pipe
        self._told = False

    def run(self) -> None:
        """Until the farewell, or until the loop's process has ended."""
        message = self._message()
        if message is None:
            return
        # Our own process has the other end, and nobody else.
        opening, arguments, capacity = pickle.loads(message)  # noqa: S301
        follower: Follower[tuple[Any, int]] = Follower(
            lambda: _Counted(_called(opening, arguments)),
            name=opening,
            waits=False,
            capacity=capacity,
            patience=_LONG,
            deadline=_LONG,
        )
        follower.wait_until_open()
        if follower.error is None:
            self._say(open=True)
        self._tell(follower)
        while message := self._message():
            follower.offer(pickle.loads(message))  # noqa: S301
            self._tell(follower)
        follower.close()
        self._tell(follower)
        self._say(finished=True, dropped=follower.dropped)

    def _tell(self, follower: Follower[Any]) -> None:
        if follower.error is not None and not self._told:
            self._told = True
            self._say(error=follower.error)

    def _message(self) -> bytes | None:
        """The next whole one; None when the other end is gone."""
        length = self._exactly(_LENGTH)
        return None if length is None else self._exactly(int.from_bytes(length, "little"))

    def _exactly(self, count: int) -> bytes | None:
        data = bytearray()
        while len(data) < count:
            try:
                chunk = self._pipe.recv(min(count - len(data), 1 << 20))
            except OSError:
                chunk = b""
            if not chunk:
                return None
            data += chunk
        return bytes(data)

    def _say(self, **what: Any) -> None:
        with contextlib.suppress(OSError):  # nobody is there to hear it
            self._pipe.sendall(json.dumps(what).encode() + b"\n")


def _called(opening: str, arguments: dict[str, Any]) -> Sink[Any]:
    module, _, function = opening.partition(":")
    sink: Sink[Any] = getattr(importlib.import_module(module), function)(**arguments)
    return sink


def main(fd: int) -> None:
    """Be the process at this descriptor of the pipe."""
    # What ends the service lets us finish: a manager's signals go to all of a group.
    for which in (signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP, signal.SIGABRT):
        signal.signal(which, signal.SIG_IGN)
    os.nice(_NICE)
    with socket.socket(fileno=fd) as pipe:
        _Feeding(pipe).run()
    os._exit(0)  # all is written; a library's threads must not hold up the end


if __name__ == "__main__":
    main(int(sys.argv[1]))
