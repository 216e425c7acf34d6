"""The campaigns of ``python -m benchmarks.faults``, short: the same laws on fewer ticks."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from benchmarks.faults import byte_faults, clean, recovery, structural
from benchmarks.wall import campaign
from tests.runs.cli import ROOT


@pytest.mark.parametrize("seed", range(3))
def test_no_stale_and_no_wrong_value_is_accepted_whatever_happens_to_lines(seed: int) -> None:
    found = structural(300, seed=seed + 100)
    assert found["faults"] >= 300
    assert found["accepted"] > 1000
    assert (found["stale"], found["wrong"]) == (0, 0)


def test_the_campaign_would_notice_wrong_values() -> None:
    found = structural(300, seed=1, faults="bytes=0.01")
    assert found["wrong"] > 0, "byte changes inside numbers cannot be seen without --verify"


def test_nor_is_one_in_wall_time() -> None:
    found = campaign(5.0, seed=3, faults="lines=0.1,frame=0.003,disconnect@3+0.3/3600")
    assert found["faults"] > 3
    assert found["accepted"] > 10
    assert (found["stale"], found["wrong"]) == (0, 0)


def test_under_verify_no_value_is_off_by_more_than_60_counts() -> None:
    found = byte_faults(1000, seed=50, rate=3e-3)
    assert found["valid_ticks"] > 600
    assert found["third_readings"] > 10
    assert found["wrong_by_more_than_60"] == 0


def test_without_it_some_are() -> None:
    assert byte_faults(800, seed=50, rate=3e-3, verify=False)["wrong_by_more_than_60"] > 0


def test_after_one_fault_there_are_valid_data_again_within_two_ticks() -> None:
    found = recovery(8, seed=9)
    assert found["all"]["faults"] == 9 * 8
    assert found["all"]["p99"] <= 2


def test_on_a_clean_line_hardly_a_tick_is_refused() -> None:
    for found in clean(400, seed=7).values():
        assert found["refused_share"] < 0.01


def test_a_run_on_a_bad_line_loses_no_tick() -> None:
    command = (sys.executable, "-m", "benchmarks.soak", "--hours", "0.02", "--part", "0.01", "--json")
    bad = ("--faults", "lines=0.01,bytes=1e-3,disconnect@10+2")
    done = subprocess.run([*command, *bad], capture_output=True, text=True, check=False, cwd=ROOT)
    found = json.loads(done.stdout)
    assert found["ticks"] == 720
    assert (found["failed_parts"], found["gaps"]) == (0, 0)
    assert found["without_data"] > 40
    assert found["faults"] > 20
