"""A very long run's file: the last hour, and two minutes around what happened; real files, read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from khepera_hil.recording import Tick
from khepera_hil.viewer import keeping
from khepera_hil.viewer.eye import PATH
from khepera_hil.viewer.keeping import Keeping
from tests.recording.rrd import entities, rows
from tests.recording.synthetic import manifest


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """An hour is 40 s here, two minutes are 10."""
    for name, value in (("_PIECE", 20.0), ("_LAST", 40.0), ("_BEFORE", 5.0), ("_AFTER", 5.0)):
        monkeypatch.setattr(keeping, name, value)


def write(folder: Path, ticks: int, happens: dict[int, tuple[str, str]]) -> None:
    sink = Keeping(folder / "run.rrd", {**manifest(world=False), "needs": ["N", "T,2,T"]}, rows=16)
    for number in range(ticks):
        tick = Tick(number, number / 10, raw={"T,2,T": "t,2,t," + ",".join(["90"] * 16)}, command=(4, 4))
        if number in happens:
            tick = replace(tick, events=[happens[number]])
        sink.write(tick, 0)
    sink.close()


def test_the_last_hour_is_kept_and_what_happened_before(tmp_path: Path) -> None:
    write(
        tmp_path, 1300, {300: ("info", "fire"), 320: ("alarm", "something moves"), 700: ("warning", "no data: x")}
    )
    assert sorted(path.name for path in tmp_path.glob("run*.rrd")) == [f"run-000{n}.rrd" for n in (4, 5, 6)]
    (clip,) = tmp_path.glob("event-*.rrd")
    assert clip.name == "event-00000250.rrd"
    ticks = rows(clip, "/motors", "Scalars:scalars")
    assert min(ticks) == 250
    assert max(ticks) == 370  # five seconds after the last of the two events


def test_what_the_camera_saw_is_there(tmp_path: Path) -> None:
    write(tmp_path, 50, {})
    assert PATH in entities(tmp_path / "run.rrd")


def test_a_night_full_of_events_keeps_the_last_of_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keeping, "_CLIPS", 2)
    write(tmp_path, 900, dict.fromkeys((100, 300, 500, 700), ("alarm", "something moves")))
    assert [path.name for path in sorted(tmp_path.glob("event-*"))] == ["event-00000450.rrd", "event-00000650.rrd"]
