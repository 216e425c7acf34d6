"""Campaigns on a cluster of dask's, here its local one: two worker processes, a scheduler, and TCP between them."""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq  # type: ignore[import-untyped]  # it ships no types
import pytest

from khepera_hil.errors import CampaignError, UsageError
from khepera_hil.experiments.campaign import run, table
from khepera_hil.experiments.cluster import Cluster
from khepera_hil.experiments.crew import Ended, Trial
from khepera_hil.experiments.results import kept
from tests.experiments.test_campaign import CODE, EXPECTED
from tests.experiments.trials import cases, log, pids, trial, until
from tests.runs.cli import khepera_hil

distributed = pytest.importorskip("distributed", reason="an extra")


def started() -> Any:
    import dask

    dask.config.set({"distributed.scheduler.allowed-failures": 1})
    return distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0")


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with started() as cluster:
        yield cluster.scheduler_address


def test_it_finds_what_this_computer_finds_although_workers_die(tmp_path: Path, address: str) -> None:
    some = cases(tmp_path, 12, s2={"deaths": 1}, s5={"held": True})

    def kill() -> None:
        until(lambda: len(log(tmp_path)) == 11)
        os.kill(pids(tmp_path)[5], signal.SIGKILL)
        (tmp_path / "go").touch()

    killer = threading.Thread(target=kill)
    killer.start()
    assert run("dask", trial, some, tmp_path / "out", scheduler=address) == EXPECTED
    killer.join()
    assert sorted(log(tmp_path)) == list(range(12))
    assert sorted(log(tmp_path, "begun")) == sorted([*range(12), 2, 5])
    assert len(set(pids(tmp_path).values())) >= 2
    found = pq.read_table(table(trial, tmp_path / "out"))
    assert found["seed"].to_pylist() == list(range(12))
    # In a folder of its own, here: the same table.
    run("here", trial, some, tmp_path / "here", workers=1)
    assert pq.read_table(table(trial, tmp_path / "here")) == found


def test_a_case_that_kills_every_worker_is_named_and_costs_no_other(tmp_path: Path, address: str) -> None:
    some = cases(tmp_path, 4, s1={"deaths": 99})
    with pytest.raises(CampaignError, match=r'the worker died, and so did .* each time it tried .*"seed": 1'):
        run("deadly", trial, some, tmp_path / "out", scheduler=address)
    assert sorted(log(tmp_path)) == [0, 2, 3]
    assert len(kept(tmp_path / "out", CODE)) == 3


def test_an_error_of_a_trial_comes_back(tmp_path: Path, address: str) -> None:
    with pytest.raises(ZeroDivisionError, match="as it was told"):
        run("failing", trial, cases(tmp_path, 2, s1={"fails": True}), tmp_path / "out", scheduler=address)
    assert len(kept(tmp_path / "out", CODE)) == 1


def test_a_worker_with_other_code_is_not_used(address: str) -> None:
    said: list[str] = []
    of = Trial.of(trial)
    with pytest.raises(CampaignError, match=r"no worker of tcp.* can be used: the worker at .* has another code"):
        Cluster(address, of, "0" * 16, said.append)
    assert any("has another code" in text for text in said)
    # A worker that turns out at the case to have other code, although it said otherwise when it came.
    cluster = Cluster(address, of, CODE, said.append)
    cluster._code = "0" * 16
    said.clear()
    cluster.start("{}")
    (ended,) = until_ended(cluster)
    assert ended == Ended("{}"), "it was not tried"
    assert "has another code" in said[0]
    cluster.close()
    # And none that cannot even find the trial.
    with pytest.raises(CampaignError, match="can be used: the worker at"):
        Cluster(address, Trial("no_such_module", "trial"), CODE, said.append)


def until_ended(cluster: Cluster) -> Any:
    end = time.monotonic() + 60
    while not (found := cluster.ended(1.0)):
        assert time.monotonic() < end
    return found


def test_a_scheduler_that_goes_is_told_and_what_was_measured_is_kept(tmp_path: Path) -> None:
    cluster = started()

    def close() -> None:
        until(lambda: len(kept(tmp_path / "out", CODE)) == 3)
        cluster.close()

    closing = threading.Thread(target=close)
    closing.start()
    with pytest.raises(CampaignError, match=r"the scheduler at tcp.* has gone; what was measured is kept"):
        run(
            "going",
            trial,
            cases(tmp_path, 4, s0={"held": True}),
            tmp_path / "out",
            scheduler=cluster.scheduler_address,
        )
    closing.join()
    (tmp_path / "go").touch()
    assert run("going", trial, cases(tmp_path, 4, s0={"held": True}), tmp_path / "out") == EXPECTED[:4]
    assert sorted(log(tmp_path)) == [0, 1, 2, 3]


def test_a_scheduler_that_is_not_there_is_told(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:  # takes calls, and never says a word
        port = silent.getsockname()[1]
        with pytest.raises(CampaignError, match=f"no dask scheduler answers at tcp://127.0.0.1:{port} within 5 s"):
            run("nobody", trial, cases(tmp_path, 1), tmp_path / "out", scheduler=f"tcp://127.0.0.1:{port}")
    for address in ("nonsense", "http://127.0.0.1:1", "tls://127.0.0.1:1", ""):
        with pytest.raises(UsageError, match="is no address of a scheduler, such as tcp://HOST:8786"):
            run("nobody", trial, cases(tmp_path, 1), tmp_path / "out", scheduler=address)
    done = khepera_hil("paper", "push", "--seeds", "1", "--scheduler", f"127.0.0.1:{port}", cwd=tmp_path)
    assert done.code == 1
    assert done.err.splitlines()[-1].startswith("khepera-hil: no dask scheduler answers at 127.0.0.1:")
    assert "Traceback" not in done.err


def test_without_the_extra_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed.core", None)
    with pytest.raises(CampaignError, match=r"pip install 'khepera-hil\[cluster\]'"):
        run("nobody", trial, cases(tmp_path, 1), tmp_path / "out", scheduler="tcp://127.0.0.1:1")
