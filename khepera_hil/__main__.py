"""The command line: the one place where everything meets.

Each command is a module of ``khepera_hil.commands`` with a function ``main(arguments) -> exit code``. What the
user got wrong, and what went wrong with the robot, ends here as one sentence on standard error.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from khepera_hil.commands import COMMANDS, run
from khepera_hil.errors import KheperaHilError

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """The console script; returns the exit code (0, or the error's own, see ``errors``)."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    command = run.main
    if words and words[0] in COMMANDS:
        command = COMMANDS[words.pop(0)].main
    try:
        return command(words)
    except KheperaHilError as error:
        print(f"khepera-hil: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # Whoever read our output has gone; Python would complain once more when it flushes at the exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


if __name__ == "__main__":
    sys.exit(main())
