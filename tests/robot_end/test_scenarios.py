"""What scenarios bring into the world, and what they say about a mistake."""

import math
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from khepera_hil.errors import WorldError
from khepera_hil.world import Arena, LinkFault, Order, Reset, Scenario, World, load_scenario, scenarios
from khepera_hil.world.arena import LampPlan, Start
from khepera_hil.world.scenario import (
    Agenda,
    BatterySet,
    Broken,
    Event,
    Fire,
    LampSet,
    Mover,
    PutDown,
    TakeAway,
)
from khepera_hil.world.shapes import BODY_RADIUS, Shape, box, disc, gap

LAMP = LampPlan("lamp", (500, 900), (60, 60), 7, 5)


def arena(*things: Shape, at: tuple[float, float, float] = (500, 500, 0), lamps: bool = False) -> Arena:
    return Arena("made", "for a test", things=things, start=Start(pose=at), lamps=(LAMP,) if lamps else ())


def world(
    *events: Event,
    things: Sequence[Shape] = (),
    at: tuple[float, float, float] = (500, 500, 0),
    lamps: bool = False,
) -> World:
    return World(arena(*things, at=at, lamps=lamps), 3, Scenario("made", "for a test", events))


def mouse(path: Sequence[tuple[float, float]], at: float = 0.0, speed: float = 200.0, rounds: int = 1) -> Mover:
    x, y = path[0]
    return Mover(at, disc("mouse", "mover", 18, (x, y, 0), 50, mass=25), tuple(path), speed, rounds)


def fire(at: float, x: float, y: float, *, real: bool = True, lasts: float = math.inf, name: str = "fire") -> Fire:
    return Fire(at, name, (x, y), 22, 1.2, real, lasts)


def test_the_shipped_scenarios_are_named_with_a_line_each_and_play_in_their_arenas() -> None:
    assert {"night", "fire", "broken-sensor", "visitors", "bad-line", "presentation"} <= set(scenarios())
    for name, line in scenarios().items():
        assert line
        assert "\n" not in line
        scenario = load_scenario(name)
        World(scenario.world or "furnished", 1, scenario)


def test_a_fire_lit_ahead_is_seen_flickers_and_is_drawn_where_it_burns() -> None:
    there = world(fire(1.0, 690, 500))
    there.advance(0.99)
    dark = min(there.light()[1:5])
    shelf = there.poses()["fire"]
    assert shelf[0] < 0
    bright = []
    for tick in range(11, 40):
        there.advance(tick * 0.1)
        bright.append(min(there.light()[1:5]))
    assert dark > 450
    assert max(bright) < 400
    assert max(bright) - min(bright) > 40
    assert there.poses()["fire"] == (0.69, 0.5, 0.0)
    assert there.score()["fires_lit"] == 1


def test_the_turbine_puts_a_near_fire_out_after_a_second_and_a_half_of_wind_all_told() -> None:
    there = world(fire(0.0, 580, 500))
    there.set_turbine(True)
    there.advance(1.0)
    there.set_turbine(False)
    there.advance(3.0)
    there.set_turbine(True)
    there.advance(3.45)
    assert there.score()["fires_put_out"] == 0
    there.advance(3.55)
    assert there.score()["fires_put_out"] == 1
    assert there.score()["fire_burned_longest_s"] == pytest.approx(3.5, abs=0.011)
    assert there.poses()["fire"][0] < 0
    there.advance(3.6)
    assert min(there.light()) > 300


@pytest.mark.parametrize(
    ("x", "y", "real"),
    [(500 + BODY_RADIUS + 61, 500, True), (560, 530, True), (440, 500, True), (570, 500, False)],
    ids=["too far", "too much aside", "behind", "no flame"],
)
def test_what_the_wind_does_not_reach_or_cannot_blow_out_burns_on(x: float, y: float, real: bool) -> None:
    there = world(fire(0.0, x, y, real=real))
    there.set_turbine(True)
    there.advance(5.0)
    assert there.score()["fires_put_out"] == 0
    assert there.poses()["fire"][0] > 0


def test_a_candle_stands_in_the_way_and_does_not_hide_its_own_flame() -> None:
    there = world(fire(0.0, 580, 500))
    there.set_speed(60, 60)
    there.advance(3.0)
    assert there.pose()[0] == pytest.approx(0.580 - 0.010 - BODY_RADIUS / 1000, abs=1e-3)
    assert there.score()["contacts"] == 1
    assert there.score()["objects_moved"] == 0
    assert min(there.light()[2:4]) < 120
    there.set_turbine(True)
    there.advance(5.0)
    assert there.score()["fires_put_out"] == 1
    assert there.pose()[0] > 0.56  # what burned is gone


def test_a_fire_waits_until_its_place_is_free_and_a_bulb_hangs_above_it() -> None:
    there = world(fire(0.5, 510, 500, lasts=3.0), fire(0.5, 500, 500, real=False, name="bulb"))
    there.advance(1.0)
    assert there.poses()["bulb"] == (0.5, 0.5, 0.0)
    assert there.score()["fires_lit"] == 0
    there.set_speed(-80, -80)
    there.advance(2.5)
    assert there.poses()["fire"] == (0.51, 0.5, 0.0)
    assert there.score()["fires_lit"] == 1
    there.advance(3.6)  # it burns until three seconds after its moment, and not after it came
    assert there.poses()["fire"][0] < 0
    never = world(fire(0.5, 510, 500, lasts=1.0))
    never.advance(2.0)
    never.set_speed(-80, -80)
    never.advance(4.0)
    assert never.score()["fires_lit"] == 0


def test_a_fire_of_the_same_name_burns_elsewhere_later_and_only_there() -> None:
    there = world(fire(0.0, 700, 500, lasts=1.0), fire(2.0, 300, 500), fire(3.0, 500, 800))
    found = []
    for now in (0.5, 1.5, 2.5, 3.5):
        there.advance(now)
        found.append(there.poses()["fire"][:2])
    assert found[0] == (0.7, 0.5)
    assert found[1][0] < 0
    assert found[2:] == [(0.3, 0.5), (0.5, 0.8)]


def test_a_shaken_bulb_looks_like_a_flame_and_ends_by_itself() -> None:
    there = world(fire(0.0, 620, 500, real=False, lasts=2.0))
    there.advance(1.9)
    assert min(there.light()[1:5]) < 300
    there.advance(2.1)
    assert min(there.light()[1:5]) > 300
    assert there.score()["fires_lit"] == 0


def test_a_mouse_goes_its_way_and_leaves_at_its_end() -> None:
    there = world(mouse([(100, 100), (900, 100), (900, 900)], at=0.5))
    there.advance(0.4)
    assert there.poses()["mouse"][0] < 0
    there.advance(2.5)
    x, y, _ = there.poses()["mouse"]
    assert x == pytest.approx(0.5, abs=0.05)
    assert y == pytest.approx(0.1, abs=0.01)
    there.advance(9.5)
    assert there.poses()["mouse"][0] < 0
    assert there.score()["movers_entered"] == 1


@pytest.mark.parametrize("mass", [10.0, 1000.0])
def test_a_mouse_sinks_into_nothing_and_moves_only_what_is_light(mass: float) -> None:
    block = box("block", "block", 40, 60, (300, 500, 0.2), 40, mass=mass)
    there = world(mouse([(100, 500), (900, 500)]), things=[block])
    for tick in range(1, 80):
        there.advance(tick * 0.1)
        poses = {name: (x * 1000, y * 1000, theta) for name, (x, y, theta) in there.poses().items()}
        if poses["mouse"][0] > 0:
            inner = disc("mouse", "mover", 17.5, poses["mouse"], 50)
            assert gap(inner, block.at(poses["block"])) > 0
            assert gap(inner, disc("robot", "robot", BODY_RADIUS - 0.5, poses["robot"], 29)) > 0
    assert (there.score()["objects_moved"] == 1) == (mass < 100)


def test_a_mover_ahead_is_in_view_and_one_behind_a_wall_or_the_robots_back_is_not() -> None:
    tall = box("wall", "fixed", 16, 400, (650, 500, 0), 80)
    path = [(800, 450), (800, 550)]
    seen = world(mouse(path, rounds=5))
    hidden = world(mouse(path, rounds=5), things=[tall])
    behind = world(mouse(path, rounds=5), at=(500, 500, math.pi))
    for one in (seen, hidden, behind):
        one.advance(2.0)
        one.heard_alarm()
    assert seen.score()["movers_in_view_s"] == pytest.approx(2.0, abs=0.11)
    assert [one.score()["movers_seen"] for one in (seen, hidden, behind)] == [1, 0, 0]
    assert [one.score()["alarms_false"] for one in (seen, hidden, behind)] == [0, 1, 1]


def test_an_object_is_put_down_seen_moved_and_taken_away() -> None:
    shape = box("parcel", "block", 60, 60, (0, 0, 0), 60, mass=500)
    there = world(
        PutDown(1.0, "parcel", shape, (565, 500)),
        PutDown(2.0, "parcel", None, (200, 200), 0.5),
        TakeAway(3.0, "parcel"),
    )
    near = []
    for moment in (0.99, 1.99, 2.99, 3.99):
        there.advance(moment)
        near.append(max(there.proximity()[2:4]))
    assert [value > 500 for value in near] == [False, True, False, False]
    assert there.poses()["parcel"][0] < 0
    assert there.score()["objects_moved"] == 0, "a hand that moves it is not the robot"


def test_an_object_waits_until_its_place_is_free() -> None:
    shape = box("parcel", "block", 60, 60, (0, 0, 0), 60, mass=500)
    there = world(PutDown(1.0, "parcel", shape, (500, 500)))
    there.advance(2.0)
    assert there.poses()["parcel"][0] < 0
    there.set_speed(80, 80)
    there.advance(5.0)
    assert there.poses()["parcel"] == pytest.approx((0.5, 0.5, 0.0), abs=1e-4)


def test_a_broken_sensor_answers_what_it_was_told_and_a_mended_one_what_it_sees() -> None:
    there = world(Broken(1.0, 3, "proximity", 700), Broken(2.0, 3, "both", 9999), Broken(3.0, 3, "both", None))
    there.advance(0.9)
    assert there.proximity()[3] < 20
    there.advance(1.1)
    assert there.proximity()[3] == 700
    assert there.light()[3] > 100
    there.advance(2.1)
    assert (there.proximity()[3], there.light()[3]) == (1023, 511)
    there.advance(3.1)
    assert there.proximity()[3] < 20


def test_lamps_are_switched_and_the_battery_is_set() -> None:
    there = world(LampSet(1.0, "lamp", 0.0), BatterySet(1.0, 0.25), lamps=True)
    there.advance(0.9)
    lit = min(there.light())
    there.advance(1.1)
    assert min(there.light()) > lit + 40
    assert there.battery.charge == pytest.approx(0.25, abs=0.001)


def test_what_is_not_physical_is_handed_out_once_at_its_moment() -> None:
    there = world(
        Order(1.0, "vigil", True), Reset(2.0), LinkFault(2.0, "silent", 1.0, 0.5), Order(2.5, "vigil", False)
    )
    assert there.next_due(Reset, LinkFault) == 2.0
    there.advance(1.5)
    assert there.due(Order, Reset) == [Order(1.0, "vigil", True)]
    assert there.due(Order) == []
    there.advance(2.5)
    assert [type(event) for event in there.due(Reset, LinkFault)] == [Reset, LinkFault]
    assert there.due(Order) == [Order(2.5, "vigil", False)]
    assert there.next_due(Order, Reset, LinkFault) is None


@given(st.lists(st.tuples(st.integers(0, 5), st.sampled_from([Order, Reset])), max_size=12), st.data())
def test_an_agenda_hands_each_event_out_once_in_order_and_never_early(
    plan: list[tuple[int, type[Event]]], data: st.DataObject
) -> None:
    events: list[Event] = [Reset(at) if kind is Reset else Order(at, "vigil", True) for at, kind in plan]
    agenda = Agenda(events)
    taken: list[Event] = []
    for now in range(7):
        if data.draw(st.booleans()) or now == 6:
            due = agenda.due(now, Order, Reset)
            assert all(event.at <= now for event in due)
            taken += due
    assert taken == sorted(events, key=lambda event: event.at)


@settings(deadline=None, max_examples=15)
@given(st.lists(st.integers(1, 400), min_size=1, max_size=12), st.integers(0, 3))
def test_how_time_is_cut_and_who_reads_changes_nothing(cuts: list[int], seed: int) -> None:
    events = (
        fire(0.2, 560, 560),
        mouse([(600, 600), (600, 400)], at=0.3, rounds=20),
        PutDown(0.5, "block", None, (430, 480)),
        Broken(1.0, 2, "light", 100),
    )
    block = box("block", "block", 40, 60, (560, 480, 0), 45, mass=40)
    scenario = Scenario("made", "for a test", events)
    cut, whole = (World(arena(block, at=(500, 500, 0)), seed, scenario) for _ in range(2))
    end = sum(cuts) * 0.0025
    for one in (cut, whole):
        one.set_speed(70, 55)
    now = 0.0
    for part in cuts:
        now += part * 0.0025
        cut.advance(min(now, end))
        cut.proximity()
        cut.camera()
        cut.shapes()
        cut.score()
        if part % 2:
            cut.light()
    cut.advance(end)
    whole.advance(end)
    for look in (World.proximity, World.light, World.camera, World.camera_light, World.poses, World.score):
        assert look(cut) == look(whole)


HEAD = "title = 'x'\n[[event]]\nat_s = 3\n"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", r"mine\.toml: title is missing; expected one line of text"),
        ("title = 'x'\n[[event]]\nkind = 'reset'", r"at_s is missing; expected a number from 0"),
        (HEAD, r"kind is missing; expected one of order, fire, mover, object"),
        (HEAD + "kind = 'flood'", r"kind must be one of order, .*, not 'flood'"),
        (HEAD + "kind = 'order'\norder = 'sing'", r"order must be one of vigil, identify, not 'sing'"),
        (HEAD + "kind = 'order'\norder = 'vigil'\non = 1", r"on must be true or false, not 1"),
        (
            HEAD + "kind = 'broken-sensor'\nsensor = 8",
            r"sensor must be a whole number from 0 to 7, not 8",
        ),
        (HEAD + "kind = 'battery'\ncharge = 2", r"charge must be a number from 0 to 1, not 2"),
        (HEAD + "kind = 'battery'\ncharge = nan", r"charge must be a number from 0 to 1, not nan"),
        (HEAD + "kind = 'mover'\nbody = 'cat'\npath_mm = [[1, 2], [3, 4]]", r"body must be one of mouse, ball"),
        (
            HEAD + "kind = 'mover'\nbody = 'ball'\npath_mm = [[1, 2]]",
            r"path_mm must be a list of at least 2",
        ),
        (HEAD + "kind = 'reset'\nhow = 'soft'", r"how is not known here; expected one of at_s, kind"),
        (HEAD + "kind = 'link-fault'\nfault = 'lost'\nlasts_s = 1", r"share is missing"),
    ],
)
def test_a_mistake_in_a_scenario_names_file_key_and_what_was_expected(
    tmp_path: Path, text: str, complaint: str
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(WorldError, match=complaint):
        load_scenario(str(path))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            "kind = 'take-away'\nname = 'moon'",
            r"name must be a thing that can be moved \(block 1, .*'moon'",
        ),
        (
            "kind = 'take-away'\nname = 'wall 1'",
            r"name must be a thing that can be moved .* not 'wall 1'",
        ),
        (
            "kind = 'lamp'\nname = 'sun'\nintensity = 1",
            r"name must be a lamp of the arena \(base lamp\)",
        ),
        (
            "kind = 'fire'\nname = 'robot'\nat_mm = [5, 5]",
            r"name must be new; there is a 'robot' already",
        ),
        ("kind = 'fire'\nat_mm = [1500, 5]", r"at_mm must be on the floor of 1000 x 1000 mm"),
        (
            "kind = 'mover'\nbody = 'ball'\npath_mm = [[500, 500], [2, 4]]",
            r"path_mm must be on the floor",
        ),
        ("kind = 'object'\nname = 'block 1'", r"at_mm is missing, and the arena has no stage"),
        (
            "kind = 'object'\nname = 'n'\nshape = 'box'\nsize_mm = [90, 90]\nmass_g = 5\nat_mm = [20, 500]",
            r"at_mm must be on the floor",
        ),
    ],
)
def test_an_event_that_makes_no_sense_in_the_arena_names_file_and_key(
    tmp_path: Path, text: str, complaint: str
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(HEAD + text)
    with pytest.raises(WorldError, match=r"mine\.toml: event\[0\]\." + complaint):
        World("furnished", 1, str(path))


def test_what_is_taken_away_from_under_the_robots_nose_is_touched_no_longer() -> None:
    block = box("block", "block", 40, 60, (560, 500, 0), 40, mass=1000)
    there = world(TakeAway(3.0, "block"), things=[block])
    there.set_speed(50, 50)
    there.advance(2.9)
    assert there._physics.touching == 1
    there.advance(5.0)
    assert there._physics.touching == 0
    assert there.score()["contact_longest_s"] < 3.0
    assert there.pose()[0] > 0.6
