"""What the emulated world spares itself is seen by nobody: every reading and every figure is as without it."""

from __future__ import annotations

from typing import Any

import pytest
import serial

from khepera_hil.units import SPEED_UNIT_MM_S
from khepera_hil.world import World
from khepera_hil.world.camera import Camera
from khepera_hil.world.scanner import Scanner


def lived(seed: int, scenario: str, seconds: float) -> list[Any]:
    """All that a robot reads which wanders about, ten times a second, and what the run was worth."""
    world = World("watchman", seed, scenario)
    told: list[Any] = []
    for tick in range(round(seconds * 10)):
        world.advance(tick / 10 + 0.0025 * (tick % 8))  # between any two sensors' scans
        near = world.proximity()
        told.append((near, world.light(), world.camera(), world.pose(), sorted(world.in_view())))
        left, right = (8, -8) if max(near[:6]) > 200 else (6, 5)
        world.set_speed(left * SPEED_UNIT_MM_S, right * SPEED_UNIT_MM_S)
    return [*told, world.score()]


@pytest.mark.parametrize(("scenario", "seconds"), [("visitors", 50.0), ("fire", 30.0)])
def test_movers_out_of_reach_and_view_change_no_reading(
    scenario: str, seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not one is dismissed by where it is, and nothing is otherwise; and some were dismissed, and some not."""
    asked: dict[str, set[bool]] = {"_may_see": set(), "_is_far": set(), "_is_aside": set()}

    def listened(owner: type, name: str) -> None:
        real = getattr(owner, name)

        def told(self: Any, *arguments: Any) -> bool:
            found: bool = real(self, *arguments)
            asked[name].add(found)
            return found

        monkeypatch.setattr(owner, name, told)

    listened(Camera, "_may_see")
    listened(Scanner, "_is_far")
    listened(Scanner, "_is_aside")
    spared = [lived(seed, scenario, seconds) for seed in (3, 4)]
    if scenario == "visitors":
        assert asked == {"_may_see": {True, False}, "_is_far": {True, False}, "_is_aside": {True, False}}
    monkeypatch.setattr(Camera, "_may_see", lambda self, *_: True)
    monkeypatch.setattr(Scanner, "_is_far", lambda self, *_: False)
    monkeypatch.setattr(Scanner, "_is_aside", lambda self, *_: False)
    assert [lived(seed, scenario, seconds) for seed in (3, 4)] == spared


@pytest.mark.parametrize("more", ["scenario=visitors", "scenario=bad-line", "faults=flip=0.002,drop=0.001"])
def test_a_world_that_is_moved_on_late_says_the_same(more: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In simulated time the world stands until the robot acts or somebody looks; here it is also kept up."""
    monkeypatch.setattr(serial, "protocol_handler_packages", ["serial.urlhandler", "khepera_hil.ports"])

    def said(*, keeps_up: bool) -> list[Any]:
        port: Any = serial.serial_for_url(f"emulator://watchman?seed=5&clock=simulated&{more}", 38400)
        with port:
            port.timeout = 0.05
            port._emulator.keeps_up = keeps_up
            told: list[Any] = []
            for tick in range(200):
                for request in (b"N\n", b"O\n", b"T,2,N\n", b"D,5,4\n" if tick % 9 else b"D,7,-7\n"):
                    port.write(request)
                    line = b""  # not read_until, whose timeout is the wall's
                    while not line.endswith(b"\n") and (more_of_it := port.read(max(1, port.in_waiting))):
                        line += more_of_it
                    told.append((line, port.clock.now()))
                if tick % 3 == 0:
                    told.append((port.witness.pose(), port.witness.poses(), sorted(port.witness.in_view())))
                port.clock.sleep_until((tick + 1) / 5)
            return [*told, port.witness.score()]

    assert said(keeps_up=False) == said(keeps_up=True)
