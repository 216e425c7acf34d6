"""A stream into rerun that gives back what it took: a long run opens a new one for every piece of its file.

rerun (0.41) holds on to what it made. Every stream stands in a list of its own until that is swept, and the stream
by which a layout travels is held by a memory that it holds itself: two threads and some megabytes each, for ever.
So the layout's is disconnected when it was sent, and the list is swept whenever a new stream is opened.
"""

from __future__ import annotations

import atexit
import ctypes
from typing import Any

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

__all__ = ["abandon", "open_stream"]


def open_stream(
    application: str, recording: str, where: rr.FileSink | rr.GrpcServerSink, look: rrb.Blueprint
) -> rr.RecordingStream:
    """A stream to ``where`` that opens with the layout ``look``."""
    rerun_bindings.flush_and_cleanup_orphaned_recordings()  # those that nobody holds any more
    stream = rr.RecordingStream(
        application,
        recording_id=recording,
        # What is sent comes in chunks already; said here, since the SDK waits otherwise for files and networks.
        batcher_config=rr.ChunkBatcherConfig(flush_tick=0.2),
    )
    stream.set_log_time_enabled(False)
    layout = _Layout(look)
    try:
        stream.set_sinks(where, default_blueprint=layout)  # type: ignore[arg-type] # it asks for these two methods only
    except BaseException:
        abandon(stream)
        raise
    layout.free()
    return stream


def abandon(stream: rr.RecordingStream) -> None:
    """Never free a stream that takes no more, as on a full disk: to finish or to forget it may wait for ever.

    So may what rerun does at the end of the program; all other streams were finished by whoever had them.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(stream))
    atexit.unregister(rr.rerun_shutdown)


class _Layout:
    """A blueprint that remembers on which stream it was sent."""

    def __init__(self, look: rrb.Blueprint) -> None:
        self._look = look
        self._streams: list[Any] = []

    def to_blueprint(self) -> _Layout:
        return self

    def _log_to_stream(self, stream: Any) -> None:
        self._look._log_to_stream(stream)
        self._streams.append(stream)

    def free(self) -> None:
        while self._streams:
            self._streams.pop().disconnect()
