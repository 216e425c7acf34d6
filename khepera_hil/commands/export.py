"""``khepera-hil export``: a run's ticks as columns."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from khepera_hil.commands.parser import Parser
from khepera_hil.commands.recorded import add_run, add_runs, opened
from khepera_hil.export import to_csv, to_parquet

__all__ = ["main"]

EPILOG = """\
example:
  khepera-hil export last --parquet home.parquet
  python -c 'import pandas; print(pandas.read_parquet("home.parquet").Vrot.mean())'

Columns: tick, t (s), px1..px8 and l1..l8 (as the robot answered), left and right (pulse/10 ms, as it
acknowledged them), then the program's variables and draws. What was not had is empty. The units are in the schema
of the parquet file.
A file of that name is replaced when the new one is whole.
"""


def main(arguments: Sequence[str]) -> int:
    """Write the file."""
    parser = Parser("khepera-hil export", "Write the ticks of a recorded run as columns.", EPILOG)
    add_run(parser)
    add_runs(parser)
    kinds = parser.add_mutually_exclusive_group(required=True)
    kinds.add_argument("--parquet", type=Path, metavar="FILE", help="with units in the schema")
    kinds.add_argument("--csv", type=Path, metavar="FILE", help="as text, names in the first line")
    asked = parser.parse_args(arguments)
    run = opened(asked)
    count = to_parquet(run, asked.parquet) if asked.parquet is not None else to_csv(run, asked.csv)
    print(f"{count} ticks of {run.name} in {asked.parquet or asked.csv}")
    return 0
