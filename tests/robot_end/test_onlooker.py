"""The live view of the emulated world alone, written to a real viewer's file."""

from pathlib import Path
from typing import Any

import pytest

from khepera_hil.onlooker import Onlooker, shown
from khepera_hil.recording import Tick
from khepera_hil.viewer import open_file
from khepera_hil.world import World

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
