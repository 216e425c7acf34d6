"""The engine's laws on many more random programs than a test run has: ``python -m benchmarks.laws --times 30``.

They are the tests that hypothesis draws programs for: every exact answer against the joint written out in full
(trees, polytrees, loops, several searched and unknown variables, Switches, subroutines within subroutines), soft
evidence, batches against single asks, folded questions against unfolded ones, rules for impossible rows, the rules
of section 3.2, learning one datum at a time. ``--times 30`` tries some 27 000 examples.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

LAWS = {
    "answers": "test_answers.py",
    "cases": "test_plan.py",
    "soft": "test_soft.py",
    "batch": "test_batch.py",
    "rules": "test_impossible.py",
    "section-3.2": "test_laws.py",
    "propositions": "test_propositions.py",
    "learning": "test_learning.py",
}


def main() -> int:
    """Run them, print what hypothesis saw, and return pytest's exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.laws", description=__doc__)
    parser.add_argument("laws", nargs="*", metavar="LAW", help=f"of {', '.join(LAWS)}; all")
    parser.add_argument("--times", type=int, default=30, help="how many times a test run's examples (30)")
    options = parser.parse_args()
    for law in options.laws:
        if law not in LAWS:
            parser.error(f"there is no law {law!r}; there are {', '.join(LAWS)}")
    files = [f"tests/brp/{LAWS[law]}" for law in options.laws or LAWS]
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-n0",
        "-q",
        "--hypothesis-show-statistics",
        "-m",
        "hypothesis",
        *files,
    ]
    return subprocess.run(command, env=os.environ | {"BRP_LAWS_TIMES": str(options.times)}, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
