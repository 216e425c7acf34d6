"""The live view of the emulated world alone, written to a real viewer's file."""

from pathlib import Path
from typing import Any

import pytest

from khepera_hil.onlooker import Onlooker, shown
from khepera_hil.recording import Tick
from khepera_hil.viewer import open_file
from khepera_hil.viewer.scene import trails
from khepera_hil.world import World
from tests.recording.rrd import entities

_ABOUT: dict[str, Any] = {
    "robot": "khepera",
    "name": "socket://127.0.0.1:4000",
    "arena": "push",
    "seed": 3,
    "started": "2026-01-02T03:04:05",
}


def test_the_world_is_looked_at_ten_times_a_second_and_shown(tmp_path: Path) -> None:
    world = World("push", 3)
    ticks: list[Tick] = []
    onlooker = Onlooker(world, ticks.append)
    world.set_speed(60, 60)
    for step in range(301):
        world.advance(step * 0.01)
        onlooker.watch(step * 0.01)
    assert 29 <= len(ticks) <= 31
    last = ticks[-1]
    assert last.pose is not None
    assert last.pose == pytest.approx(world.pose(), abs=0.02)
    assert set(last.moved) == set(world.poses()) - {"robot"}
    assert [len(last.raw[letter].split(",")) for letter in "NO"] == [9, 9]
    assert last.command == (7, 7)
    path = tmp_path / "view.rrd"
    sink = open_file(path, shown(_ABOUT, world), rows=2)
    for tick in ticks:
        sink.write(tick, 0)
    sink.close()
    assert path.stat().st_size > 10_000


def test_other_robots_are_shown_too_each_with_its_trail(tmp_path: Path) -> None:
    world = World("furnished", 3, robots=3)
    ticks: list[Tick] = []
    onlooker = Onlooker(world, ticks.append)
    for robot in world.robots:
        robot.set_speed(40, 40)
    for step in range(200):
        world.advance(step * 0.01)
        onlooker.watch(step * 0.01)
    assert ticks[-1].moved["robot 3"] == pytest.approx(world.robots[2].pose(), abs=0.02)
    manifest = shown({**_ABOUT, "arena": "furnished"}, world)
    assert trails(manifest) == ["/world/trail", r"/world/trails/robot\ 2", r"/world/trails/robot\ 3"]
    path = tmp_path / "view.rrd"
    sink = open_file(path, manifest, rows=2)
    for tick in ticks:
        sink.write(tick, 0)
    sink.close()
    found = entities(path)
    assert {r"/world/robots/robot\ 2/body", r"/world/robots/robot\ 3/disc", *trails(manifest)} <= found
    assert not any("/robot 1" in name or r"robot\ 1" in name for name in found)
