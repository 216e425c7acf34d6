"""The battery: what is drawn, where it is charged, and what an empty one does."""

import pytest

from khepera_hil.world import Arena, World
from khepera_hil.world.arena import Base, Start
from khepera_hil.world.scenario import BatterySet, Scenario

BASE = Base(180, (0, 0), 95, 60, 10, 0.6)


def world(x: float, compression: float = 1.0, charge: float = 1.0) -> World:
    arena = Arena("made", "", base=BASE, start=Start(pose=(x, x, 0)))
    return World(arena, 0, Scenario("made", "", (BatterySet(0.0, charge),)), compression=compression)


def test_standing_still_draws_electronics_and_camera_and_the_wheels_and_the_turbine_come_on_top() -> None:
    there = world(500)
    there.advance(1.0)
    assert there.battery.current_ma == 150
    there.set_turbine(True)
    there.advance(2.0)
    assert there.battery.current_ma == 300
    there.set_turbine(False)
    there.set_speed(-10 * 100 / 12, 10 * 100 / 12)
    there.advance(4.0)
    assert there.battery.current_ma == pytest.approx(150 + 2 * 40, rel=0.02)


def test_the_charge_goes_down_by_what_is_drawn_and_the_compression_makes_it_faster() -> None:
    slow, fast = world(500), world(500, 20)
    for there in (slow, fast):
        there.advance(36.0)
    assert 1 - slow.battery.charge == pytest.approx(150 * 36 / 3600 / 180, rel=1e-6)
    assert 1 - fast.battery.charge == pytest.approx(20 * (1 - slow.battery.charge), rel=1e-6)
    assert slow.score()["energy_mah"] == pytest.approx(1.5, rel=1e-6)
    assert slow.battery.volts > fast.battery.volts > 4.5


def test_only_the_bases_contacts_charge_it_and_it_is_never_more_than_full() -> None:
    inside = world(90, 100, 0.5)
    inside.advance(13.5)
    assert inside.battery.charging
    assert inside.battery.charge == pytest.approx(1.0, abs=0.01)
    inside.advance(30.0)
    assert inside.battery.charge == 1.0
    outside = world(300, 100, 0.5)
    outside.advance(1.0)
    assert not outside.battery.charging


def test_an_empty_battery_moves_nothing() -> None:
    there = world(500, 1000, 0.5)
    there.set_speed(50, 50)
    there.advance(60.0)
    assert there.battery.charge == 0
    pose, travel = there.pose(), there.wheel_travel()
    there.advance(61.0)
    assert there.pose() == pytest.approx(pose, abs=1e-9)
    assert there.wheel_travel() == travel
