"""``khepera-hil order``: an order to a run that is going on."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from khepera_hil.commands.parser import Parser
from khepera_hil.errors import OrderRefused, UsageError
from khepera_hil.orders import SOCKET, deliver, ordered

__all__ = ["main"]

EPILOG = """\
orders:
  vigil on|off   the watchman shall keep watch, or come home
  identify       the watchman shall look at the object in front of it
  stop           end the run, as Ctrl-C does; every program takes it
  resume         after a reset of the robot: set it in motion again; every program takes it

Without --run the order goes to the newest run in --runs that answers.
exit codes: 0 obeyed  2 wrong arguments  8 refused, or no run answers
"""


def main(arguments: Sequence[str]) -> int:
    """Deliver the order and say what came of it."""
    asked = _parser().parse_args(arguments)
    try:
        words = ordered(" ".join(asked.order))
    except OrderRefused as error:
        raise UsageError(str(error)) from None
    if asked.run is not None:
        try:
            print(deliver(asked.run, words))
        except FileNotFoundError:
            raise OrderRefused(f"{asked.run} takes no orders: it is no folder of a run that is going on") from None
        except OSError as error:
            raise OrderRefused(f"{asked.run} takes no orders: {error.strerror or error}") from None
        return 0
    print(_to_the_newest(asked.runs, words))
    return 0


def _to_the_newest(runs: Path, words: str) -> str:
    """What the newest run that is there says. One that hangs is there: its order is not given to another."""
    for path in sorted(runs.glob(f"*/{SOCKET}"), key=_made, reverse=True):
        try:
            said = deliver(path.parent, words)
        except OSError:
            continue  # left behind by a run that was killed, or somebody else's
        return f"{path.parent.name}: {said}"
    raise OrderRefused(f"no run in {runs} takes orders; name its folder with --run, or where runs are with --runs")


def _made(path: Path) -> float:
    try:
        return path.lstat().st_ctime
    except OSError:
        return 0.0  # the run has just ended


def _parser() -> Parser:
    parser = Parser("khepera-hil order", "Give an order to a run that is going on.", EPILOG)
    add = parser.add_argument
    add("--run", type=Path, metavar="RUN", help="the run's folder (default: the newest that answers)")
    add("--runs", type=Path, default=Path("runs"), metavar="DIR", help="where runs are (default: %(default)s)")
    add("order", nargs=argparse.ONE_OR_MORE, help="see below")
    return parser
