"""Many trials on all cores, or on many computers; what is done is kept, so that an interrupted campaign goes on.

Each result is kept in the experiment's folder (`khepera_hil.experiments.results`) under the fingerprint of all code
that it depends on (`khepera_hil.experiments.fingerprint`) and its case. Other code, and it is measured anew.
"""

from __future__ import annotations

import json
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TextIO

from khepera_hil.errors import CampaignError
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.crew import Crew, Ended, Processes, Trial, cores
from khepera_hil.experiments.fingerprint import Code, code_of
from khepera_hil.experiments.progress import Progress, progress_stream
from khepera_hil.experiments.results import Results, forget, kept, parts, table_of

__all__ = ["Case", "Result", "progress_stream", "run", "table"]

TRIES = 3
"""So often is a case tried whose worker dies."""

_LOOK = 1.0
"""Seconds between looks at the clock while nothing ends."""


def run(
    name: str,
    trial: Callable[[Case], Result],
    cases: Sequence[Case],
    folder: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    fresh: bool = False,
    progress: TextIO | None = None,
) -> list[Result]:
    """The result of each case, in the cases' order.

    ``trial`` is a module's own function (other processes run it) and depends on nothing but its case and the code.
    ``workers`` are processes of this computer, one for each core if it is not said; ``scheduler`` is the address of
    a dask cluster to run on instead. ``fresh`` measures anew what is known. All results are as JSON gives them
    back, whether they are new or kept.

    Raises what a trial raised, when what was under way beside it has ended and is kept; KeyboardInterrupt, when
    what has ended is; CampaignError, when all others are done, for cases whose workers died, and where there is no
    scheduler or no worker with this code.
    """
    code = code_of(trial.__module__)
    keys = [json.dumps(case, sort_keys=True, allow_nan=False) for case in cases]
    if fresh:
        forget(folder, code.digest)
    known: Mapping[str, str] = kept(folder, code.digest)
    waiting = [key for key in dict.fromkeys(keys) if key not in known]
    if waiting or parts(folder, code.digest):
        with Results(folder, code.digest) as results:
            known = results.known
            waiting = [key for key in waiting if key not in known]
            telling = Progress(name, len(waiting), len(set(keys)) - len(waiting), progress)
            try:
                if waiting:
                    crew = _crew(Trial.of(trial), code, workers or min(cores(), len(waiting)), scheduler, telling)
                    _Campaign(crew, code, results, telling).work(waiting)
            finally:
                results.together(keys)
                known = results.known  # another mapping than before, once parts were put together
    return [json.loads(known[key]) for key in keys]


def table(trial: Callable[[Case], Result], folder: Path) -> Path:
    """Where a campaign's results are, as parquet."""
    return table_of(folder, code_of(trial.__module__).digest)


def _crew(trial: Trial, code: Code, workers: int, scheduler: str | None, telling: Progress) -> Crew:
    if scheduler is None:
        return Processes(trial, workers)
    from khepera_hil.experiments.cluster import Cluster  # late: an extra

    return Cluster(scheduler, trial, code.digest, telling.say)


class _Campaign:
    """Hands out cases and keeps results."""

    def __init__(self, crew: Crew, code: Code, results: Results, telling: Progress) -> None:
        self._crew, self._code, self._results, self._telling = crew, code, results, telling
        self._deaths: Counter[str] = Counter()
        self._lost: dict[str, str] = {}
        self._error: Exception | None = None

    def work(self, cases: Sequence[str]) -> None:
        """Try them all."""
        waiting = deque(cases)
        under_way = 0
        try:
            while waiting or under_way:
                while waiting and self._crew.free() > 0:
                    self._crew.start(waiting.popleft())
                    under_way += 1
                ended = self._crew.ended(_LOOK)
                under_way -= len(ended)
                self._keep(ended)
                for one in ended:
                    waiting += self._again(one)
                if self._error is not None:
                    waiting.clear()
                self._telling.tell()
        finally:
            self._crew.close()
            self._telling.end()
        if self._error is not None:
            raise self._error
        if self._lost:
            raise CampaignError(_lost(self._lost, len(cases)))

    def _keep(self, ended: Sequence[Ended]) -> None:
        rows = [(one.case, one.result) for one in ended if one.result is not None]
        if rows and (path := self._code.changed()) is not None:
            raise CampaignError(
                f"{path} was changed while the campaign was running; what was measured before is kept under the "
                "code of before, the same command measures all with the code of now"
            )
        self._results.keep(rows)
        self._telling.done(len(rows))

    def _again(self, ended: Ended) -> list[str]:
        """The case, if it is to be tried again."""
        if ended.error is not None:
            ended.error.add_note(f"in the case {ended.case}")
            self._telling.say(f"{_short(ended.case)} failed; what is under way is finished")
            self._error = self._error or ended.error
        if ended.died is None:
            return [ended.case] if ended.result is None and ended.error is None else []
        self._deaths[ended.case] += 1
        tried = self._deaths[ended.case]
        if ended.again and tried < TRIES:
            self._telling.say(
                f"a worker {ended.died}; its case is tried again ({tried} of {TRIES}): {_short(ended.case)}"
            )
            return [ended.case]
        self._telling.say(f"a worker {ended.died}; its case is given up: {_short(ended.case)}")
        self._lost[ended.case] = ended.died
        return []


def _lost(lost: dict[str, str], cases: int) -> str:
    case, how = next(iter(lost.items()))
    which = f"the worker {how} each time it tried {_short(case)}"
    if len(lost) > 1:
        which += f", and so with {len(lost) - 1} other cases"
    return f"{which}; the results of the other {cases - len(lost)} are kept"


def _short(case: str) -> str:
    return case if len(case) <= 300 else f"{case[:297]}..."
