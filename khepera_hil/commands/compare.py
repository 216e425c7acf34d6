"""``khepera-hil compare``: tell two recorded runs apart."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from khepera_hil.commands.parser import Parser
from khepera_hil.commands.recorded import add_run, add_runs, opened
from khepera_hil.compare import Comparison, compare

__all__ = ["main"]

EPILOG = """\
example:
  khepera-hil compare last 2026-11-22T06-16-15-home-3

Says what was set up otherwise, how each ended and scored, and for each column of the log in how many ticks it
differs, with the first of them. The host's own columns (lateness, work, wall time) do not count.

exit codes: 0 the same  1 they differ  2 wrong arguments  6 a damaged run
"""

MOST = 20
"""Lines for what was set up otherwise; two arenas differ in every shape."""


def main(arguments: Sequence[str]) -> int:
    """Compare two runs."""
    parser = Parser("khepera-hil compare", "Tell two recorded runs apart.", EPILOG)
    add_run(parser, "one")
    add_run(parser, "other")
    add_runs(parser)
    parser.add_argument("--json", action="store_true", help="the result as one JSON object")
    asked = parser.parse_args(arguments)
    one, other = opened(asked, "one"), opened(asked, "other")
    found = compare(one, other)
    if asked.json:
        print(json.dumps(_result(found)))
    else:
        print(f"one:   {one.name}\nother: {other.name}")
        _report(found)
    return 0 if found.same else 1


def _result(found: Comparison) -> dict[str, Any]:
    columns = {
        name: {"ticks": count, "first": {"tick": tick, "t": t, "one": a, "other": b}}
        for name, (count, tick, t, a, b) in found.columns.items()
    }
    return {
        "same": found.same,
        "set_up": found.set_up,
        "ended": found.ended,
        "ticks": found.ticks,
        "columns": columns,
    }


def _report(found: Comparison) -> None:
    _pairs("set up otherwise:", found.set_up)
    _pairs("ended otherwise:", found.ended)
    if found.ticks[0] != found.ticks[1]:
        print("{} ticks in one, {} in the other".format(*found.ticks))
    if found.columns:
        print(f"of the ticks that both have ({min(found.ticks)} at most):")
        for name, (count, tick, t, a, b) in found.columns.items():
            print(f"  {name} differs in {count}, first at tick {tick} ({t:g} s): {_short(a)} | {_short(b)}")
    if found.same:
        print(f"the same {found.ticks[0]} ticks")


def _pairs(title: str, pairs: Mapping[str, tuple[Any, Any]]) -> None:
    if not pairs:
        return
    print(title)
    for name, (a, b) in list(pairs.items())[:MOST]:
        print(f"  {name}: {_short(a)} | {_short(b)}")
    if len(pairs) > MOST:
        print(f"  and {len(pairs) - MOST} more (--json has them all)")


def _short(value: Any) -> str:
    text = (
        "nothing" if value is None else value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    )
    return text if len(text) <= 100 else text[:97] + "..."
