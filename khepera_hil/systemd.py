"""What a service manager is told (systemd's sd_notify): a datagram to the socket that it named, or nothing."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Mapping

__all__ = ["Manager"]


class Manager:
    """The manager that started us, if it wants to hear: ``NOTIFY_SOCKET`` names its socket.

    Nothing here waits or raises: what the manager does not take at once it does not get; the loop comes first.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._socket: socket.socket | None = None
        name = environment.get("NOTIFY_SOCKET", "")
        if name[:1] not in ("/", "@") or not hasattr(socket, "AF_UNIX"):
            return
        channel = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        channel.setblocking(False)
        try:
            # An @ stands for the zero byte with which an abstract name begins.
            channel.connect("\0" + name[1:] if name[0] == "@" else name)
        except OSError:
            channel.close()  # nobody is there, or the name is too long to be one
            return
        self._socket = channel

    def ready(self, status: str) -> None:
        """The robot is found and its wheels stand still; the loop begins."""
        self._tell(f"READY=1\nSTATUS={_line(status)}")

    def alive(self) -> None:
        """A tick is done and in the log. With ``WatchdogSec`` a manager that hears none of it ends us."""
        self._tell("WATCHDOG=1")

    def status(self, text: str) -> None:
        """One line for whoever asks how we are."""
        self._tell(f"STATUS={_line(text)}")

    def stopping(self) -> None:
        """The wheels are being stopped, the recording closed."""
        self._tell("STOPPING=1")

    def close(self) -> None:
        """No more to be told."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _tell(self, text: str) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.send(text.encode())


def _line(text: str) -> str:
    return " ".join(text.split())
