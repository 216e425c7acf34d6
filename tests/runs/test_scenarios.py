"""A run in which something happens: --scenario, and the same in the port's name."""

from __future__ import annotations

from pathlib import Path

import pytest

from khepera_hil.commands.address import port_url
from khepera_hil.errors import UsageError
from khepera_hil.reading import read_manifest, read_ticks
from tests.runs.cli import khepera_hil
from tests.runs.test_mistakes import sentence

ORDERS = """
title = "two orders and a broken sensor"
world = "watchman"
[[event]]
at_s = 0.45
kind = "order"
order = "vigil"
[[event]]
at_s = 0.95
kind = "order"
order = "vigil"
on = false
[[event]]
at_s = 0.5
kind = "broken-sensor"
sensor = 3
reads = 777
"""


def test_a_scenario_brings_its_arena_its_orders_and_what_happens_in_the_world(tmp_path: Path) -> None:
    (tmp_path / "orders.toml").write_text(ORDERS)
    done = khepera_hil(
        "--fast", "--duration", "2", "--seed", "1", "--scenario", "orders.toml", "--json", cwd=tmp_path
    )
    assert done.code == 0, done.err
    run = tmp_path / done.result["run"]
    world = read_manifest(run)["world"]
    assert (world["name"], world["scenario"]) == ("watchman", "orders.toml")
    ticks = list(read_ticks(run))
    # home takes no such orders, and says so in the tick in which each came.
    told = [(tick["t"], text) for tick in ticks for _, text in tick["events"] if "'vigil o" in text]
    (on, refused), (off, refused_too) = told
    assert "home knows no order 'vigil on'" in refused
    assert "home knows no order 'vigil off'" in refused_too
    # Some tenths of a second of the world's time are over when the handshake is, and the loop begins.
    assert 0 < on < 0.6
    assert off == pytest.approx(on + 0.5)
    readings = [tick["raw"]["N"].split(",")[4] for tick in ticks]
    assert "777" not in readings[:2]
    assert set(readings[8:]) == {"777"}


def test_a_scenario_in_the_ports_name_is_the_same_as_the_flag() -> None:
    flag = port_url("emulator", None, "night", fast=True, seed=3)
    assert flag == port_url("emulator://?scenario=night", None, fast=True, seed=3)
    assert flag == port_url("emulator://watchman", "watchman", "night", fast=True, seed=3)
    assert flag.startswith("emulator://watchman?")
    assert port_url("emulator", "empty", "night", fast=True, seed=3).startswith("emulator://empty?")


@pytest.mark.parametrize(
    ("port", "world", "scenario", "words"),
    [
        ("/dev/ttyS0", None, "night", "--scenario goes with --port emulator only"),
        ("socket://x:1", None, "night", "--scenario goes with --port emulator only"),
        ("emulator://?scenario=fire", None, "night", "two different scenarios"),
        ("emulator://empty?scenario=fire", "furnished", None, "two different worlds"),
        ("emulator", None, "", "--scenario is empty"),
    ],
)
def test_flags_that_disagree_or_go_with_another_port_are_refused(
    port: str, world: str | None, scenario: str | None, words: str
) -> None:
    with pytest.raises(UsageError, match=words):
        port_url(port, world, scenario, fast=False, seed=1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--scenario", "doomsday"], ["doomsday", "night"]),
        (["--scenario", "presentation", "--world", "empty"], ["presentation.toml", "event[0].at_mm", "no stage"]),
        (["--port", "emulator://objects?object=moon"], ["moon", "square 60"]),
        (["--port", "emulator://?compression=much"], ["compression", "much"]),
        (["--port", "emulator://?seed=1&seed=2"], ["--seed"]),
    ],
)
def test_a_mistake_about_scenarios_ends_in_one_sentence(
    tmp_path: Path, arguments: list[str], words: list[str]
) -> None:
    sentence(khepera_hil(*arguments, "--fast", "--duration", "1", cwd=tmp_path), 2, *words)
