"""The camera's image: the cells of each tick, the left edge first, drawn as high as they are seen best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from khepera_hil.recording import Tick
from khepera_hil.viewer.columns import Columns, Lane, Stamp

__all__ = ["PATH", "Eye", "camera_of"]

PATH = "/camera"

_ROWS = 4  # of the picture; it is stretched anyway


def camera_of(manifest: Mapping[str, Any]) -> str | None:
    """The request by which the program reads the K213, if it does: the name of its answers in the log."""
    needs = manifest.get("needs") or []
    return next((str(need) for need in needs if str(need).startswith("T,2,")), None)


class Eye:
    """Turns the camera's answers into rows; without a camera there are none."""

    def __init__(self, manifest: Mapping[str, Any]) -> None:
        self._name = camera_of(manifest)
        self.lanes: dict[str, Lane] = {} if self._name is None else {PATH: Lane(PATH, _pictures)}

    def write(self, tick: Tick, stamp: Stamp) -> None:
        """Keep the image, where there is a whole one."""
        if self._name is None:
            return
        words = tick.raw.get(self._name, "").strip().split(",")[3:]
        if words and all(word.isascii() and word.isdigit() and int(word) < 256 for word in words):
            self.lanes[PATH].add(stamp, np.array([int(word) for word in words], np.uint8))


def _pictures(rows: Sequence[NDArray[np.uint8]]) -> Columns:
    formats = [
        rr.components.ImageFormat(width=len(row), height=_ROWS, color_model="L", channel_datatype="U8")
        for row in rows
    ]
    return rr.Image.columns(buffer=[np.tile(row, _ROWS).tobytes() for row in rows], format=formats)
