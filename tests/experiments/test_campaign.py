"""Campaigns on this computer: the same results whatever happens, each kept, none measured twice."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pyarrow.parquet as pq  # type: ignore[import-untyped]  # it ships no types
import pytest

from khepera_hil.errors import CampaignError, RecordingError
from khepera_hil.experiments import results
from khepera_hil.experiments.campaign import run, table
from khepera_hil.experiments.fingerprint import code_of
from khepera_hil.experiments.results import kept, parts
from tests.experiments.trials import cases, log, nan, pids, trial, until
from tests.runs.cli import ROOT, environment

EXPECTED = [
    {"twice": 2 * seed, "half": seed / 2, "name": f"n{seed}", "seed": str(seed), "list": [seed, {"a": None}]}
    for seed in range(12)
]
CODE = code_of("tests.experiments.trials").digest


def started(folder: Path, number: int, held: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tests.experiments.interrupted", str(folder), str(number), held],
        cwd=ROOT,
        env=environment(),
        stderr=subprocess.PIPE,
        text=True,
    )


def gone(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_results_and_their_table_are_the_same_by_any_number_of_workers(tmp_path: Path, workers: int) -> None:
    some = cases(tmp_path, 12, s2={"deaths": 1}, s7={"deaths": 2})
    assert run("any", trial, some, tmp_path / "out", workers=workers) == EXPECTED
    rows = pq.read_table(table(trial, tmp_path / "out"))
    assert rows["seed"].to_pylist() == list(range(12))
    assert rows["half"].to_pylist() == [seed / 2 for seed in range(12)]
    assert rows["result_seed"].to_pylist() == [str(seed) for seed in range(12)]
    assert [json.loads(text) for text in rows["list"].to_pylist()] == [one["list"] for one in EXPECTED]
    assert [json.loads(text) for text in rows["result_json"].to_pylist()] == EXPECTED
    # The deaths cost their own cases, and nothing else was begun twice.
    assert sorted(log(tmp_path, "begun")) == sorted([*range(12), 2, 7, 7])
    assert not parts(tmp_path / "out", CODE)


def test_what_came_before_and_after_parts_are_put_together_on_the_way_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(results, "_PARTS", 3)
    some = cases(tmp_path, 8)
    assert run("many", trial, some, tmp_path / "out", workers=1) == EXPECTED[:8]


def test_a_worker_that_is_killed_from_outside_costs_only_its_own_case(tmp_path: Path) -> None:
    def kill() -> None:
        until(lambda: 0 in log(tmp_path, "begun"))
        until(lambda: sorted(log(tmp_path)) == [1, 2, 3, 4, 5])  # one worker is held, the other does the rest
        os.kill(pids(tmp_path)[0], signal.SIGKILL)
        (tmp_path / "go").touch()

    killer = threading.Thread(target=kill)
    killer.start()
    told = io.StringIO()
    some = cases(tmp_path, 6, s0={"held": True})
    assert run("killed", trial, some, tmp_path / "out", workers=2, progress=told) == EXPECTED[:6]
    killer.join()
    assert sorted(log(tmp_path, "begun")) == [0, 0, 1, 2, 3, 4, 5]
    assert "a worker was killed by SIGKILL; its case is tried again (1 of 3)" in told.getvalue()


def test_a_case_that_kills_every_worker_is_named_and_costs_no_other(tmp_path: Path) -> None:
    some = cases(tmp_path, 6, s3={"deaths": 99})
    with pytest.raises(CampaignError, match=r'the worker was killed by SIGKILL each time it tried .*"seed": 3'):
        run("deadly", trial, some, tmp_path / "out", workers=2)
    assert sorted(log(tmp_path, "begun")) == [0, 1, 2, 3, 3, 3, 4, 5]
    rows = pq.read_table(table(trial, tmp_path / "out"))
    assert rows["seed"].to_pylist() == [0, 1, 2, 4, 5]


def test_an_error_is_passed_on_when_what_was_under_way_beside_it_is_kept(tmp_path: Path) -> None:
    some = cases(tmp_path, 9, s0={"held": True}, s1={"fails": True})

    def go() -> None:
        until(lambda: "failed; what is under way is finished" in told.getvalue())
        (tmp_path / "go").touch()

    told = io.StringIO()
    going = threading.Thread(target=go)
    going.start()
    with pytest.raises(ZeroDivisionError, match="as it was told") as raised:
        run("failing", trial, some, tmp_path / "out", workers=2, progress=told)
    going.join()
    assert any('"seed": 1' in note for note in raised.value.__notes__)
    assert any("in trial" in note for note in raised.value.__notes__), "where it was raised"
    assert log(tmp_path) == [0]
    assert run("failing", trial, some[:1], tmp_path / "out") == EXPECTED[:1]
    assert log(tmp_path) == [0]


@pytest.mark.parametrize("signals", [[signal.SIGINT], [signal.SIGINT, signal.SIGINT], [signal.SIGKILL]])
def test_an_interrupted_campaign_goes_on(tmp_path: Path, signals: list[signal.Signals]) -> None:
    """By Ctrl-C, once or twice, or by a kill -9 of all but the workers, who then end by themselves."""
    process = started(tmp_path, 8, "4,5")
    until(lambda: len(kept(tmp_path / "out", CODE)) == 4 and {4, 5} <= set(log(tmp_path, "begun")))
    for number in signals:
        process.send_signal(number)
    _, told = process.communicate(timeout=60)
    assert process.returncode == (130 if signals[0] == signal.SIGINT else -signal.SIGKILL)
    assert "Error" not in told
    for pid in set(pids(tmp_path).values()):
        until(lambda pid=pid: gone(pid))  # type: ignore[misc]  # the loop's, at this moment
    assert sorted(log(tmp_path)) == [0, 1, 2, 3]
    (tmp_path / "go").touch()
    again = cases(tmp_path, 8, s4={"held": True}, s5={"held": True})
    assert run("held", trial, again, tmp_path / "out", workers=3) == EXPECTED[:8]
    assert sorted(log(tmp_path)) == list(range(8)), "none twice"
    rows = pq.read_table(table(trial, tmp_path / "out"))
    assert rows["seed"].to_pylist() == list(range(8))
    assert not parts(tmp_path / "out", CODE)


def test_what_is_known_needs_nothing_and_more_seeds_only_themselves(tmp_path: Path) -> None:
    run("grows", trial, cases(tmp_path, 3), tmp_path / "out")
    before = table(trial, tmp_path / "out").stat().st_mtime_ns
    run("grows", trial, cases(tmp_path, 3), tmp_path / "out", scheduler="nonsense")  # nobody is asked
    assert table(trial, tmp_path / "out").stat().st_mtime_ns == before
    assert run("grows", trial, cases(tmp_path, 5), tmp_path / "out") == EXPECTED[:5]
    assert sorted(log(tmp_path)) == [0, 1, 2, 3, 4]
    assert run("grows", trial, cases(tmp_path, 2), tmp_path / "out", fresh=True) == EXPECTED[:2]
    assert len(log(tmp_path)) == 7


def test_what_other_processes_cannot_find_or_json_cannot_hold_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="a function of a module's own"):
        run("local", lambda case: {}, cases(tmp_path, 1), tmp_path / "out")
    with pytest.raises(ValueError, match="not JSON compliant"):
        run("nan", nan, [{"seed": 1}], tmp_path / "out")


def test_code_that_is_changed_while_a_campaign_runs_ends_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own_trial.py").write_text(
        "from pathlib import Path\n"
        "def trial(case):\n"
        "    if case['seed'] == 2:\n"
        "        Path(__file__).write_text('def trial(case): return {}')\n"
        "    return {'seed': case['seed']}\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    import own_trial  # type: ignore[import-not-found]  # written just now

    with pytest.raises(CampaignError, match=r"own_trial.py was changed while the campaign was running"):
        run("changing", own_trial.trial, [{"seed": seed} for seed in range(9)], tmp_path / "out", workers=1)
    assert pq.read_table(table(own_trial.trial, tmp_path / "out"))["seed"].to_pylist() == [0, 1]


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match=r"results cannot be kept in .*: Not a directory"):
        run("nowhere", trial, cases(tmp_path, 1), tmp_path / "file" / "out")
