"""Many trials on all cores, with progress; what is done is kept, so that an interrupted campaign goes on.

Each result is a line of ``results.jsonl`` in the experiment's folder, under the hash of all that it depends on: the
code of both packages, their arenas and data, and the case. Other code, and it is measured anew.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, TextIO

from khepera_hil.errors import RecordingError

__all__ = ["Case", "Result", "fingerprint", "run"]

Case = Mapping[str, Any]
"""What is to be tried, the seed among it: plain values, as JSON has them."""

Result = dict[str, Any]

_LOG = "results.jsonl"


@cache
def fingerprint() -> str:
    """Of the code, the arenas and the data."""
    digest = hashlib.blake2b(digest_size=8)
    for package in ("brp", "khepera_hil"):
        root = Path(str(files(package)))
        for path in sorted(root.rglob("*")):
            if path.suffix in {".py", ".toml", ".json"}:
                digest.update(str(path.relative_to(root)).encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()


def run(
    name: str,
    trial: Callable[[Case], Result],
    cases: Sequence[Case],
    folder: Path,
    *,
    workers: int | None = None,
    progress: TextIO | None = None,
) -> list[Result]:
    """The result of each case, in the cases' order.

    ``trial`` is a module's own function (it is sent to other processes) and depends on nothing but its case and the
    code. Raises what a trial raised, after what was under way has ended and been kept, and KeyboardInterrupt after
    the results that were there have been.
    """
    keys = [_key(case) for case in cases]
    known = _known(folder / _LOG, set(keys))
    waiting = {key: case for key, case in zip(keys, cases, strict=True) if key not in known}
    if waiting:
        _work(name, trial, waiting, known, folder, workers or os.cpu_count() or 1, progress)
    return [known[key] for key in keys]


def _work(
    name: str,
    trial: Callable[[Case], Result],
    waiting: Mapping[str, Case],
    known: dict[str, Result],
    folder: Path,
    workers: int,
    progress: TextIO | None,
) -> None:
    done = 0

    def tell(end: str = "") -> None:
        if progress is not None:
            kept = len(known) - done
            more = f", {kept} known from before" if kept else ""
            live = progress.isatty()
            if live or end or done % 20 == 0:
                progress.write(f"{chr(13) if live else ''}{name}: {done} of {len(waiting)} trials{more}")
                progress.write(end or ("" if live else "\n"))
                progress.flush()

    try:
        folder.mkdir(parents=True, exist_ok=True)
        log = (folder / _LOG).open("a", encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"results cannot be kept in {folder}: {error.strerror or error}") from None
    with log, ProcessPoolExecutor(min(workers, len(waiting)), initializer=_deaf) as pool:
        running: dict[Future[Result], str] = {}
        todo = iter(waiting.items())
        error: BaseException | None = None
        try:
            while True:
                while len(running) < 2 * workers and (following := next(todo, None)) is not None:
                    running[pool.submit(trial, following[1])] = following[0]
                if not running:
                    break
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    key = running.pop(future)
                    if future.cancelled():
                        continue
                    if (wrong := future.exception()) is not None:
                        error, todo = error or wrong, iter(())
                        for other in running:
                            other.cancel()  # what is under way cannot be, and is kept when it is done
                        continue
                    known[key] = future.result()
                    done += 1
                    row = {"code": fingerprint(), "case": key, "result": known[key]}
                    log.write(json.dumps(row, allow_nan=False) + "\n")
                    log.flush()
                    tell()
        except BaseException:
            for future in running:
                future.cancel()
            raise
        finally:
            tell("\n")
    if error is not None:
        raise error


def _deaf() -> None:
    """Ctrl-C is for the process that started the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _key(case: Case) -> str:
    return json.dumps(case, sort_keys=True)


def _known(path: Path, wanted: set[str]) -> dict[str, Result]:
    """What was measured by this very code; half a line, left by a killed process, is no result."""
    known: dict[str, Result] = {}
    try:
        lines = path.read_text("utf-8").splitlines()
    except FileNotFoundError:
        return known
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path} cannot be read: {error}; remove it to measure anew") from None
    for line in lines:
        try:
            row = json.loads(line)
            code, key, result = row["code"], row["case"], row["result"]
        except (ValueError, KeyError, TypeError):
            continue
        if code == fingerprint() and key in wanted and isinstance(result, dict):
            known[key] = result
    return known


def progress_stream() -> TextIO | None:
    """Where progress is told: standard error, unless it is closed."""
    return sys.stderr
