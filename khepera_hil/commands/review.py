"""``khepera-hil review``: a recorded run in the viewer, or a picture of it."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from khepera_hil.commands.parser import Parser, number
from khepera_hil.commands.recorded import add_run, add_runs, controller_of, learning_of, opened
from khepera_hil.errors import RecordingError, UsageError, ViewerError
from khepera_hil.reading import Run
from khepera_hil.recording import Tick
from khepera_hil.replay import answered
from khepera_hil.viewer import files, remake
from khepera_hil.viewer.check import damage
from khepera_hil.viewer.live import Address, address
from khepera_hil.viewer.picture import picture
from khepera_hil.viewer.program import end, has_screen, program, start

__all__ = ["main"]

LOCAL = "127.0.0.1"

EPILOG = """\
examples:
  khepera-hil review last                                  open the latest run in the viewer
  khepera-hil review last --serve                          show it in a browser, until Ctrl-C
  khepera-hil review last --picture home.png --at 12.3     a picture of the viewer, which needs no screen

Where the viewer's file is missing or damaged it is made anew from the log, its distributions asked again.
"""


def main(arguments: Sequence[str]) -> int:
    """Show a run."""
    asked = _parser().parse_args(arguments)
    if asked.at is not None and asked.picture is None:
        raise UsageError("--at goes with --picture; in the viewer the time is chosen below")
    run = opened(asked)
    if asked.picture is None and asked.serve is None and not has_screen():
        raise UsageError(
            "there is no screen here to open the viewer on; --serve shows the run in a browser, --picture makes a "
            "picture"
        )
    where = None if asked.serve is None else address(asked.serve)
    with _good(run, anew=asked.anew) as shown:
        if asked.picture is not None:
            _picture(asked, run, shown)
        elif where is not None:
            _serve(run, where, shown)
        else:
            _open(shown)
    return 0


@contextmanager
def _good(run: Run, *, anew: bool) -> Iterator[list[Path]]:
    """The viewer's files of the run, made anew where they are not good: in its folder, or if that cannot be written
    for as long as they are needed."""
    why = "as asked" if anew else _wrong(run)
    if why is None:
        yield files(run.folder)
        return
    if run.going_on:
        raise RecordingError(f"{run.name} is being recorded; review it when it has ended, or run with --view")
    print(f"{run.name}: {why}; making it anew from the log", file=sys.stderr)
    if os.access(run.folder, os.W_OK):
        yield remake(run.folder, _ticks(run))
    else:
        with tempfile.TemporaryDirectory() as elsewhere:
            yield remake(run.folder, _ticks(run), into=elsewhere)


def _wrong(run: Run) -> str | None:
    """What is wrong with the viewer's files, or None."""
    found = files(run.folder)
    if not found:
        return "there is no viewer's file"
    if "ending" not in run.manifest and not run.going_on:
        return "the run was killed, and its viewer's file lacks the end"
    for path in found:
        if (why := damage(path)) is not None:
            return f"{path.name} is damaged ({why})"
    return None


def _ticks(run: Run) -> Iterator[Tick]:
    """With their distributions, if the program is still there to be asked."""
    try:
        controller = controller_of(run)
    except UsageError as error:
        print(f"{error}; its distributions are left out", file=sys.stderr)
        return run.ticks()
    return answered(run, controller.questions, learning_of(controller))


def _open(shown: list[Path]) -> None:
    if (code := start([*shown, "--port", "auto"], outlives=True).wait()) != 0:
        raise ViewerError(
            f"the viewer ended with code {code}; --serve shows the run in a browser, and "
            f"{program()} {shown[0]} says what the viewer lacks"
        )


def _picture(asked: argparse.Namespace, run: Run, shown: list[Path]) -> None:
    png, complaints = picture(shown, asked.at, asked.size)
    try:
        asked.picture.write_bytes(png)
    except OSError as error:
        raise RecordingError(f"{asked.picture} cannot be written: {error.strerror or error}") from None
    for complaint in complaints:
        print(f"khepera-hil: the viewer complains of {complaint}", file=sys.stderr)
    when = "its end" if asked.at is None else f"{asked.at:g} s"
    print(f"{run.name} at {when} in {asked.picture}")


def _serve(run: Run, where: Address, shown: list[Path]) -> None:
    arguments = ["--serve-web", "--bind", where.host, "--web-viewer-port", str(where.web_port)]
    # Whatever ends us ends the server too; a shell that starts us in the background has SIGINT ignored.
    for which in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(which, signal.default_int_handler)
    process = start([*shown, *arguments, "--port", str(where.grpc_port)])
    print(f"{run.name} at {where.page}; Ctrl-C ends it", flush=True)
    try:
        process.wait()
    except KeyboardInterrupt:
        pass
    finally:
        end(process)


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and 200 <= int(width) <= 8000 and 200 <= int(height) <= 8000):
        raise argparse.ArgumentTypeError(f"{text!r} is no size, such as 1600x900")
    return int(width), int(height)


def _parser() -> Parser:
    parser = Parser("khepera-hil review", "Open a recorded run in the viewer, or make a picture of it.", EPILOG)
    add_run(parser)
    add_runs(parser)
    add = parser.add_argument
    add("--picture", type=Path, metavar="PNG", help="make a picture of the viewer instead of opening it")
    add("--at", type=number(0.0, 1e9, "seconds"), metavar="SECONDS", help="of the picture (default: the end)")
    add("--size", type=_size, default=(1600, 900), metavar="WxH", help="of the picture (default: 1600x900)")
    add(
        "--serve",
        nargs="?",
        const=LOCAL,
        metavar="ADDRESS",
        help="show it in a browser, at HOST or HOST:PORT (default: %(const)s)",
    )
    add("--anew", action="store_true", help="make the viewer's file anew from the log")
    return parser
