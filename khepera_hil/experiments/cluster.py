"""A crew on other computers: a cluster of dask.distributed, of which we know its scheduler's address.

A worker tries one case at a time, by the code that it has itself: if that is not ours, to the last letter, it is
not used. It is asked when it comes and again at every case. Dask's own words (its futures, who has died) stay here.
"""

from __future__ import annotations

import asyncio
import math
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from khepera_hil.errors import CampaignError, UsageError
from khepera_hil.experiments.crew import Ended, Trial, measured
from khepera_hil.experiments.fingerprint import code_of

if TYPE_CHECKING:
    from distributed import Future

__all__ = ["Cluster"]

_PATIENCE = 5.0
"""Seconds for a scheduler to answer, and for its first worker to come."""

_LOOK = 1.0
"""Seconds between looks at who is there."""

_ALONE = threading.Lock()
"""A trial has its process to itself, also on a worker of many threads."""


class Cluster:
    """The workers of a dask cluster that have this code.

    ``say`` is told of those that have another one. Raises UsageError for what is no address, and CampaignError
    where no scheduler answers, or none of its workers has this code.
    """

    def __init__(self, address: str, trial: Trial, code: str, say: Callable[[str], None]) -> None:
        self._address, self._trial, self._code, self._say = address, trial, code, say
        _probe(address)
        from distributed import Client

        self._client = Client(address, timeout=_PATIENCE, set_as_default=False)
        self._workers: dict[str, str | None] = {}
        """What is wrong with each; None if nothing is."""
        self._running: dict[Future, str] = {}
        self._ended: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._looked = -math.inf
        self._known: list[str] = []
        self._workers_there = 0
        self._there = True
        try:
            self._first_workers()
        except BaseException:
            self._client.close()
            raise

    def _first_workers(self) -> None:
        until = time.monotonic() + _PATIENCE
        while not self._able():
            wrong = next(iter(filter(None, self._workers.values())), None)
            if wrong is not None or time.monotonic() > until:
                raise CampaignError(f"no worker of {self._address} can be used: {wrong or 'it has none'}")
            time.sleep(_LOOK / 5)

    def free(self) -> int:
        """How many more cases can be tried at this moment: one for each worker, so that none waits behind one that
        will kill its worker.
        """
        able = bool(self._able())
        if self._there and not able:
            self._say("there are no workers any more; it goes on when some come")
        self._there = able
        return self._workers_there - len(self._running) if able else 0

    def start(self, case: str) -> None:
        """Try it on any worker: one with other code hands it back. (A case that is for certain workers only would
        wait for ever when they die, whoever takes their place.)
        """
        future = self._client.submit(
            _task,
            self._trial.module,
            self._trial.name,
            case,
            self._code,
            pure=False,
        )
        self._running[future] = case
        future.add_done_callback(self._ended.put)

    def ended(self, seconds: float) -> list[Ended]:
        """What has ended."""
        found = []
        with suppress(queue.Empty):
            found.append(self._ended.get(timeout=seconds))
            while True:
                found.append(self._ended.get_nowait())
        if not found and self._client.status != "running":
            raise self._gone()
        return [self._one(future, self._running.pop(future)) for future in found]

    def close(self) -> None:
        """Give up what is under way; the workers stay, they are not ours."""
        with suppress(Exception):  # the scheduler may have gone
            self._client.cancel(list(self._running), force=True)
        self._running.clear()
        self._client.close(timeout=_PATIENCE)

    def _one(self, future: Future, case: str) -> Ended:
        from distributed import KilledWorker

        try:
            said = future.result(timeout=_PATIENCE)
        except KilledWorker:  # several, one after the other: the scheduler has tried it again itself
            return Ended(case, died="died, and so did those that took its place", again=False)
        except (CancelledError, TimeoutError):
            raise self._gone() from None
        except Exception as error:  # noqa: BLE001  (the trial's own, or dask's)
            return Ended(case, error=error)
        worker, result, wrong = said
        if wrong is not None:
            if self._workers.get(worker) is None:
                self._workers[worker], self._looked = wrong, -math.inf
                self._say(f"not used: {wrong}")
            return Ended(case)
        return Ended(case, result)

    def _able(self) -> list[str]:
        """The workers that have this code; those that have come are asked."""
        if time.monotonic() - self._looked < _LOOK:
            return self._known
        self._looked = time.monotonic()
        threads = self._client.nthreads()
        if new := set(threads) - set(self._workers):
            answers = self._client.run(_is, self._trial.module, workers=sorted(new), on_error="return", nanny=False)
            for worker, answer in answers.items():
                if isinstance(answer, OSError):
                    continue  # it went as it was asked; if it is still there it is asked again
                self._workers[worker] = wrong = self._wrong(worker, answer)
                if wrong is not None:
                    self._say(f"not used: {wrong}")
                elif threads[worker] > 1:
                    self._say(
                        f"the worker at {worker} has {threads[worker]} threads and tries one case at a time; "
                        "dask worker --nthreads 1 --nworkers N has N processes"
                    )
        self._workers_there = len(threads)
        self._known = [worker for worker in threads if self._workers.get(worker, "") is None]
        return self._known

    def _wrong(self, worker: str, answer: object) -> str | None:
        if isinstance(answer, ModuleNotFoundError):
            return f"the worker at {worker} does not have this program ({answer})"
        if isinstance(answer, BaseException):
            return f"the worker at {worker} cannot say which code it has ({answer})"
        if answer != self._code:
            return f"the worker at {worker} has another code ({answer}, here it is {self._code}); install this one"
        return None

    def _gone(self) -> CampaignError:
        return CampaignError(
            f"the scheduler at {self._address} has gone; what was measured is kept, the same command goes on"
        )


def _is(module: str) -> str:
    """Which code a worker has; or why it is not to be trusted. Runs there."""
    code = code_of(module)
    if (path := code.changed()) is not None:
        return f"{path} was changed since the worker was started"
    return code.digest


def _task(module: str, name: str, case: str, expected: str) -> tuple[str, str | None, str | None]:
    """The worker's address, the result, and what is wrong with the worker if there is none. Runs there."""
    from distributed import get_worker

    worker: str = get_worker().address
    with _ALONE:
        for turn in range(2):
            if (found := _is(module)) != expected:
                wrong = f"the worker at {worker} has another code ({found}, here it is {expected}); start it anew"
                time.sleep(_LOOK)  # meanwhile others are asked
                return worker, None, wrong
            if turn == 0:
                result = measured(Trial(module, name), case)
    return worker, result, None


def _probe(address: str) -> None:
    """Whether a scheduler is there; dask's own client would be silent for long, and loud then."""
    try:
        asyncio.run(asyncio.wait_for(_identity(address), _PATIENCE))
    except ImportError:
        raise CampaignError(
            "for a scheduler dask.distributed is needed: pip install 'khepera-hil[cluster]'"
        ) from None
    except (ValueError, TypeError) as error:
        raise UsageError(f"{address!r} is no address of a scheduler, such as tcp://HOST:8786: {error}") from None
    except Exception as error:  # noqa: BLE001  (whatever is there may answer anything)
        said = f" ({error})" if str(error) else ""
        raise CampaignError(f"no dask scheduler answers at {address} within {_PATIENCE:.0f} s{said}") from None


async def _identity(address: str) -> None:
    from distributed.core import rpc
    from distributed.security import Security

    async with rpc(address, timeout=_PATIENCE, connection_args=Security().get_connection_args("client")) as there:
        found: Any = await there.identity()
    if not isinstance(found, dict) or found.get("type") != "Scheduler":
        raise OSError("there is something else")
