"""Whether a viewer's file is whole, found by reading it to its end.

That is done in a process of its own: what a damaged file makes of the reader may be an abort.
"""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from pathlib import Path

__all__ = ["damage"]

MAGIC = b"RRF2"
"""What a viewer's file begins with."""


def damage(path: Path) -> str | None:
    """What is wrong with the file in a few words, or None when it can be read to its end and has its footer.

    A bit that turned one number into another is not found.
    """
    if not path.is_file():
        return "it is no file"
    try:
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                return "it is no viewer's file"
    except OSError as error:
        return f"it cannot be read: {error.strerror or error}"
    done = subprocess.run(
        [sys.executable, "-m", __name__, str(path)],
        env={**os.environ, "RUST_LOG": "off", "RUST_BACKTRACE": "0"},
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    if done.returncode == 0:
        return None
    last = done.stderr.strip().split("\n")[-1] if done.returncode > 0 else ""
    return last[:200] or "reading it fails"


def _read(path: str) -> None:
    """Read it all; raises whatever the reader raises."""
    import rerun as rr  # late: half a second

    warnings.simplefilter("error")  # the reader warns where there is no footer
    reader = rr.chunk.RrdReader(path)
    if not reader.recordings() or not reader.blueprints():
        raise ValueError("it has no recording, or no layout")
    for chunk in reader.stream():
        chunk.to_record_batch()


if __name__ == "__main__":
    try:
        _read(sys.argv[1])
    except Exception as error:  # noqa: BLE001 - whatever the reader dies of, the file is not good
        sys.exit(str(error).split(". ")[0].split("\n")[0])
