"""The command line: the one place where everything meets.

Each command is a module of ``khepera_hil.commands`` with a function ``main(arguments) -> exit code``. What the
user got wrong, and what went wrong with the robot, ends here as one sentence on standard error.
"""

from __future__ import annotations

import io
import os
import sys
import threading
from collections.abc import Sequence

from khepera_hil.errors import KheperaHilError

__all__ = ["main", "outcome"]


def main(arguments: Sequence[str] | None = None) -> int:
    """The console script; returns the exit code (0, or the error's own, see ``errors``)."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a folder's name, or a terminal, may be of any alphabet
    code = outcome(sys.argv[1:] if arguments is None else arguments)
    if any(thread.name.startswith("follower of") for thread in threading.enumerate()):
        # A sink hangs, and said so; what it holds would keep the interpreter from ending.
        os._exit(code)
    return code


def outcome(arguments: Sequence[str]) -> int:
    """Do what the words say; the exit code. What went wrong is one sentence on standard error."""
    words = list(arguments)
    try:
        code = _main(words)
    except KheperaHilError as error:
        print(f"khepera-hil: {error}", file=sys.stderr)
        code = error.exit_code
    except KeyboardInterrupt:
        code = 130
    except BrokenPipeError:
        # Whoever read our output has gone; Python would complain once more when it flushes at the exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        code = 141
    except OSError as error:
        print(f"khepera-hil: {error}; is there room, and can standard output be written?", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        code = 1
    return code


def _main(words: list[str]) -> int:
    from khepera_hil.commands import COMMANDS, command  # late: an interrupt during the imports is no traceback

    name = words.pop(0) if words and words[0] in COMMANDS else "run"
    code = command(name).main(words)
    if sys.stdout is not None:
        sys.stdout.flush()
    return code


if __name__ == "__main__":
    sys.exit(main())
