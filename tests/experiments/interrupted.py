"""A campaign in a process of its own, for a test to interrupt: ``FOLDER NUMBER HELD,HELD``."""

from __future__ import annotations

import sys
from pathlib import Path

from khepera_hil.experiments.campaign import run
from tests.experiments.trials import cases, trial


def main() -> int:
    """As the command line does, 130 after Ctrl-C."""
    folder, number, held = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3].split(",")
    some = cases(folder, number, **{f"s{seed}": {"held": True} for seed in held})
    try:
        run("held", trial, some, folder / "out", workers=2, progress=sys.stderr)
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
