"""Several programs at once, each on a robot of its own in one world, in simulated time: the same every time."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType

from khepera_hil import chance
from khepera_hil.controllers import Controller
from khepera_hil.experiments.trial import Trial, Watch, drive

__all__ = ["meet"]

_SHARES = itertools.count(1)


def meet(
    programs: Sequence[Controller],
    *,
    world: str,
    seed: int,
    duration: float,
    record: Path | None = None,
    options: Mapping[str, str] = MappingProxyType({}),
) -> list[Trial]:
    """Run each program on a robot of its own for ``duration`` seconds; what was seen of each.

    The robots' numbers are the programs' places, from 1, and each draws from a stream of its own; the rest is as in
    :func:`~khepera_hil.experiments.trial.drive`. With ``record`` each run has its folder there. What goes wrong
    with one ends that one alone, and is raised when all have ended.
    """
    stop = threading.Event()
    share = {"share": f"meeting {next(_SHARES)}", "robots": str(len(programs))}
    trials: dict[int, Trial] = {}
    errors: dict[int, BaseException] = {}
    watch: Watch = lambda tick, trial: stop.is_set()  # noqa: E731 - it has a type so

    def run(number: int, program: Controller) -> None:
        try:
            trials[number] = drive(
                program,
                world=world,
                seed=seed,
                duration=duration,
                watch=watch,
                rng=chance.generator(seed, "program", number),
                record=record,
                options={**options, **share, "number": str(number)},
            )
        except BaseException as error:  # noqa: BLE001 - raised again in the caller's thread
            errors[number] = error

    threads = [
        threading.Thread(target=partial(run, number, program), name=f"robot {number}", daemon=True)
        for number, program in enumerate(programs, 1)
    ]
    for thread in threads:
        thread.start()
    try:
        for thread in threads:
            thread.join()
    except KeyboardInterrupt:
        stop.set()
        for thread in threads:
            thread.join()
        raise
    if errors:
        raise errors[min(errors)]
    return [trials[number] for number in sorted(trials)]
