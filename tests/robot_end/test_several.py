"""Several robots in one world: what they see of each other, what is each one's own, what happens in which order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from khepera_hil.disturbed import Disturbed, line_faults
from khepera_hil.emulator import Company, Emulator
from khepera_hil.errors import WorldError
from khepera_hil.faultspec import Specification
from khepera_hil.world import MOST_ROBOTS, LinkFault, Order, Reset, Scenario, World
from khepera_hil.world.arena import Arena, LampPlan, Start
from khepera_hil.world.crowd import Crowd
from khepera_hil.world.physics import Physics
from khepera_hil.world.scenario import BatterySet, Broken, Event, Fire
from khepera_hil.world.shapes import Pose, Shape, box, disc

BODY = 57.0


def meeting(*starts: Pose, seed: int = 3, events: Sequence[Event] = (), lamps: tuple[LampPlan, ...] = ()) -> World:
    """Robots at these places on an empty floor."""
    first, *others = starts
    arena = Arena("made", "", start=Start(pose=first), starts=tuple(enumerate(others, 2)), lamps=lamps)
    scenario = Scenario("made", "for a test", tuple(events)) if events else None
    return World(arena, seed, scenario, robots=len(starts))


def apart(world: World) -> float:
    """How far the nearest two robots' centres are, mm."""
    places = [robot.pose()[:2] for robot in world.robots]
    return 1000 * min(math.dist(a, b) for place, a in enumerate(places) for b in places[place + 1 :])


# What is each one's own


@pytest.mark.parametrize("seed", range(3))
def test_the_first_robot_and_the_furniture_are_as_without_others(seed: int) -> None:
    alone, company = World("furnished", seed), World("furnished", seed, robots=3)
    assert company.layout.shapes == alone.layout.shapes
    assert company.layout.starts[0] == alone.layout.start
    assert company.sensors._gain.tolist() == alone.sensors._gain.tolist()  # what the seed gave it
    gains = [robot.sensors._gain.tolist() for robot in company.robots]
    assert gains[0] != gains[1] != gains[2]
    fewer = World("furnished", seed, robots=2)
    assert fewer.robots[1].sensors._gain.tolist() == gains[1]
    assert fewer.layout.starts == company.layout.starts[:2]


def test_a_robot_that_nobody_can_see_or_touch_changes_nothing() -> None:
    corner = (60.0, 60.0, 0.0)
    alone, company = meeting((700, 700, 1.0)), meeting((700, 700, 1.0), corner)
    for world in (alone, company):
        world.set_speed(80, 65)
    for tick in range(1, 60):
        for world in (alone, company):
            world.advance(0.1 * tick)
        assert company.proximity() == alone.proximity()
        assert company.light() == alone.light()
        assert company.wheel_travel() == alone.wheel_travel()
        assert company.pose() == pytest.approx(alone.pose(), abs=1e-9)


def test_batteries_and_broken_sensors_are_each_ones_own() -> None:
    events = BatterySet(0.1, 0.3, robot=2), Broken(0.1, 2, "both", 77, robot=3)
    world = meeting((200, 200, 0), (500, 500, 0), (800, 800, 0), events=events)
    world.advance(0.5)
    assert [round(robot.battery.charge, 1) for robot in world.robots] == [1.0, 0.3, 1.0]
    assert [robot.light()[2] == 77 for robot in world.robots] == [False, False, True]


def test_what_a_scenario_says_to_one_robot_the_others_do_not_hear() -> None:
    events = Order(0.1, "vigil", True, robot=2), Order(0.2, "identify", True)
    world = meeting((200, 200, 0), (500, 500, 0), events=events)
    world.advance(1.0)
    assert [[order.order for order in robot.due(Order)] for robot in world.robots] == [["identify"], ["vigil"]]


def test_who_blows_a_fire_out_has_put_it_out() -> None:
    fire = Fire(0.0, "fire", (560.0, 500.0), 20.0, 1.0, True, 100.0)
    world = meeting((200, 200, 0), (500, 500, 0), events=[fire])
    world.robots[1].set_turbine(True)
    world.advance(3.0)
    assert [world.score(number)["fires_lit"] for number in (1, 2)] == [1, 1]
    assert [world.score(number)["fires_put_out"] for number in (1, 2)] == [0, 1]


# What they are to each other


def test_a_robot_is_seen_near_by_the_camera_and_as_a_shadow() -> None:
    lamp = LampPlan("lamp", (900, 500), (40, 40), 7.0, 5.0)
    here = (500.0, 500.0, 0.0)
    alone, company = meeting(here, lamps=(lamp,)), meeting(here, (572.0, 500.0, 0.0), lamps=(lamp,))
    for world in (alone, company):
        world.advance(1.0)
    assert max(company.proximity()[2:4]) > 100 > max(alone.proximity()[2:4])
    assert company.proximity()[6:] == alone.proximity()[6:]
    assert min(company.light()[2:4]) > min(alone.light()[2:4]) + 100  # low is bright
    middle = slice(28, 36)
    assert np.abs(np.array(company.camera()[middle]) - alone.camera()[middle]).max() > 20
    # And the other one sees the first behind it.
    assert max(company.robots[1].proximity()[6:]) > 100


@pytest.mark.parametrize("speed", [60, 250, 1000])
def test_robots_that_drive_at_each_other_do_not_sink_into_each_other(speed: float) -> None:
    world = meeting((300, 500, 0), (700, 500, math.pi), (500, 300, math.pi / 2))
    for robot in world.robots:
        robot.set_speed(speed, speed)
    nearest, contacts = math.inf, None
    for tick in range(1, 1200):
        world.advance(0.005 * tick)
        nearest = min(nearest, apart(world))
        if contacts is None and world.score()["robots_met"]:
            contacts = world.score()["contacts"]
    assert contacts == 0  # nobody can say whose fault it was
    assert BODY - 0.5 < nearest < BODY + 1.0
    assert all(world.score(number)["robots_met"] > 0 for number in (1, 2, 3))


@pytest.mark.parametrize("seed", range(3))
def test_a_crowd_that_drives_about_sinks_into_nothing(seed: int) -> None:
    world = World("push", seed, robots=4)
    chance = np.random.default_rng(seed)
    for tick in range(1, 120):
        for robot in world.robots:
            ahead, turn = chance.uniform(40, 250), chance.uniform(-60, 60)
            robot.set_speed(ahead - turn, ahead + turn)
        world.advance(0.25 * tick)
        assert apart(world) > BODY - 0.5
        for robot in world.robots:
            x, y, _ = robot.pose()
            assert BODY / 2 - 0.5 < 1000 * x < 1000 * world.arena.size[0] - BODY / 2 + 0.5
            assert BODY / 2 - 0.5 < 1000 * y < 1000 * world.arena.size[1] - BODY / 2 + 0.5


def test_a_robot_that_goes_is_a_mover_for_others_and_one_that_stands_is_none() -> None:
    world = meeting((200, 500, 0), (500, 400, math.pi / 2))
    other = world.robots[1]
    world.advance(1.0)
    world.heard_alarm()
    assert world.in_view() == set()
    other.set_speed(40, 40)
    world.advance(2.0)
    assert world.in_view() == {"robot 2"}
    assert world.in_view(robot=2) == set()  # it looks elsewhere
    world.heard_alarm()
    figures = world.score()
    assert (figures["movers_seen"], figures["alarms"], figures["alarms_false"]) == (1, 2, 1)
    assert 0.5 < figures["movers_in_view_s"] <= 1.0
    assert world.score(2)["movers_seen"] == 0


def test_each_calls_itself_the_robot_and_the_others_by_their_numbers() -> None:
    world = meeting((200, 500, 0), (500, 400, 1.0), (700, 700, 0))
    assert set(world.poses()) >= {"robot", "robot 2", "robot 3"}
    assert set(world.poses(2)) >= {"robot", "robot 1", "robot 3"}
    assert world.poses(2)["robot"] == world.poses()["robot 2"] == world.robots[1].pose()
    shapes = {shape["name"]: shape for shape in world.shapes(2)}
    assert shapes["robot"]["pose"] == [0.5, 0.4, 1.0]
    assert shapes["robot"]["kind"] == shapes["robot 1"]["kind"] == "robot"
    assert world.score() != World("empty", 3).score()
    assert "robots_met" not in World("empty", 3).score()


# The engine


def test_one_robot_of_a_crowd_moves_as_one_alone() -> None:
    """The general step and the one that is written out for one robot are the same."""
    things: list[Shape] = [
        box("wall", "wall", 20, 1000, (1000, 500, 0), 100),
        disc("disc", "disc", 30, (300, 300, 0), 40, mass=40.0),
    ]
    start = (100.0, 100.0, 0.7)
    alone, crowd = Physics(things, [1], frozenset(), start), Crowd(things, [1], frozenset(), [start])
    alone.coasts = False
    chance = np.random.default_rng(5)
    for _ in range(60):
        ahead, turn = chance.uniform(-100, 400), chance.uniform(-3, 3)
        for _ in range(20):
            pose = alone.advance(0.005, ahead, turn)
            assert crowd.advance_all(0.005, [(ahead, turn)]) == [pose]
            assert crowd.movables() == alone.movables()
            assert crowd.contacts[0].touching == alone.touching


# Where they start


@pytest.mark.parametrize("seed", range(4))
def test_starts_that_are_drawn_are_free_of_each_other(seed: int) -> None:
    world = World("furnished", seed, robots=6)
    assert apart(world) > BODY + world.arena.start.clearance


def test_given_starts_are_kept_and_those_that_are_drawn_keep_away() -> None:
    arena = Arena("made", "", size=(240.0, 240.0), start=Start(clearance=10.0), starts=((2, (120.0, 60.0, 1.0)),))
    for seed in range(5):
        world = World(arena, seed, robots=2)
        assert world.layout.starts[1] == (120.0, 60.0, 1.0)
        assert apart(world) > BODY + 9
    assert World(arena, 1).layout.starts == (World(arena, 1).layout.start,)  # there is no second one


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[[robot]]\nnumber = 1\nat_mm = [500, 500]", "number must be a whole number from 2 to 32, not 1"),
        ("[[robot]]\nat_mm = [500, 500]", "number is missing"),
        (
            "[[robot]]\nnumber = 2\nat_mm = [500, 500]\n[[robot]]\nnumber = 2\nat_mm = [100, 100]",
            "number must be new; robot 2 has its start already",
        ),
        ("[[robot]]\nnumber = 2\nat_mm = [10, 500]", "the start of robot 2 has no room for the robot"),
        (
            "size_mm = [400, 800]\n[[robot]]\nnumber = 2\nat_mm = [500, 100]",
            "the start of robot 2 is not on the floor",
        ),
        (
            "[start]\nat_mm = [500, 500]\n[[robot]]\nnumber = 2\nat_mm = [540, 500]",
            "since 'robot' is there",
        ),
        (
            "[[robot]]\nnumber = 2\nat_mm = [500, 500]\n[[robot]]\nnumber = 3\nat_mm = [540, 500]",
            "since 'robot 2' is there",
        ),
        ("[[block]]\nname = 'robot 2'\nsize_mm = [20, 20]\nat_mm = [500, 500]\nheight_mm = 20\nmass_g = 9", "new"),
    ],
)
def test_a_mistake_in_an_arenas_file_is_a_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "made.toml"
    path.write_text(f"title = 'made'\n{text}\n")
    with pytest.raises(WorldError, match=f"made.toml: .*{sentence}"):
        World(str(path), robots=3)


def test_a_scenario_places_robots_and_speaks_to_them(tmp_path: Path) -> None:
    path = tmp_path / "meeting.toml"
    path.write_text(
        "title = 'made'\n[start]\nat_mm = [200, 200]\n[[robot]]\nnumber = 2\nat_mm = [800, 800]\nheading_deg = 90\n"
        "[[event]]\nat_s = 1\nkind = 'reset'\nrobot = 2\n[[event]]\nat_s = 1\nkind = 'battery'\ncharge = 0.2\n"
    )
    world = World("empty", 1, str(path), robots=2)
    assert list(world.layout.starts) == [(200, 200, 0), (800, 800, math.pi / 2)]
    assert [robot.next_due(Reset) for robot in world.robots] == [None, 1.0]
    with pytest.raises(WorldError, match="robot must be the number of a robot, and the only one here is 1"):
        World("empty", 1, str(path))
    path.write_text("title = 'made'\n[[event]]\nat_s = 1\nkind = 'fire'\nname = 'f'\nat_mm = [5, 5]\nrobot = 2\n")
    with pytest.raises(WorldError, match="robot is not known here"):
        World("empty", 1, str(path), robots=2)
    path.write_text("title = 'made'\n[[robot]]\nnumber = 2\nat_mm = [4000, 1]\n")
    with pytest.raises(
        WorldError, match=r"scenario .*: the start of robot 2 is not on the floor of 1000 x 1000 mm"
    ):
        World("empty", 1, str(path), robots=2)


def test_more_robots_than_there_is_room_for_are_a_sentence() -> None:
    small = Arena("made", "", size=(300.0, 300.0))
    with pytest.raises(WorldError, match=r"the arena made has no room for robot \d; ask for fewer"):
        World(small, robots=9)
    for count in (0, -1, MOST_ROBOTS + 1, 1000):
        with pytest.raises(WorldError, match=f"an arena takes from 1 to {MOST_ROBOTS} robots, not {count}"):
            World("empty", robots=count)


# The order of things

REQUESTS = (b"N\n", b"O\n", b"H\r", b"E\n", b"D,8,6\n", b"D,-5,9\n", b"D,9,9\n", b"T,2,N\n", b"K\n", b"run demo\n")


def talk(seed: int, polls: int, spec: str = "") -> tuple[list[bytes], list[Pose], list[dict[str, object]]]:
    """Two robots that are told the same at the same moments; who looks besides, and when, ``polls`` chooses.

    What each host got, where the robots are then, and what they were worth. With faults, which strike what passes
    when it is taken over, a host takes over its bytes when it speaks, and else its robot is only moved on.
    """
    events: list[Event] = [Reset(3.1, robot=1)]
    if spec:
        events.append(LinkFault(2.0, "lost", 0.05, 2.0, robot=2))
    world = World("furnished", seed, Scenario("made", "", tuple(events)), robots=2)
    faults = Specification.parse(spec) if spec else Specification(())
    emulators: list[Emulator] = [
        Disturbed(world, 38400, number=number, faults=line_faults(faults, seed, number), fifo=14)
        for number in (1, 2)
    ]
    Company(emulators)
    told, looks = np.random.default_rng(seed), np.random.default_rng(polls)
    said = sorted(
        (float(told.uniform(0, 6)), int(told.integers(2)), REQUESTS[int(told.integers(len(REQUESTS)))])
        for _ in range(150)
    )
    heard = [bytearray(), bytearray()]
    before = 0.0
    for moment, number, data in said:
        for look in np.sort(looks.uniform(before, moment, looks.integers(4))).tolist():
            one = int(looks.integers(2))
            if spec:
                emulators[one].advance(look)
            else:
                heard[one] += emulators[one].transmitted(look)
        for one in [number] if looks.random() < 0.5 else [number, 1 - number]:
            if spec and one != number:
                emulators[one].advance(moment)
            else:
                heard[one] += emulators[one].transmitted(moment)
        emulators[number].receive(data, moment)
        before = moment
    for one in looks.permutation(2).tolist():
        heard[one] += emulators[one].transmitted(8.0)
    return (
        [bytes(bytes_) for bytes_ in heard],
        [robot.pose() for robot in world.robots],
        [world.score(1), world.score(2)],
    )


@pytest.mark.parametrize("spec", ["", "flip=1e-3,late=0.02,lose=0.01"])
@pytest.mark.parametrize("seed", range(3))
def test_the_same_bytes_at_the_same_moments_get_the_same_answers_whoever_looks_first(seed: int, spec: str) -> None:
    first = talk(seed, 0, spec)
    assert all(len(heard) > 1000 for heard in first[0])
    assert first[0][0] != first[0][1]
    for polls in range(1, 4):
        assert talk(seed, polls, spec) == first


def test_each_line_has_faults_of_its_own_also_where_they_bring_a_seed() -> None:
    spec = Specification.parse("flip=0.05,seed=7")
    data = bytes(range(33, 120)) * 20
    lines = [
        line_faults(spec, seed, number).to_host(data, 1.0) for seed, number in ((1, 1), (2, 1), (1, 2), (2, 2))
    ]
    assert lines[0] == lines[1] != lines[2] == lines[3]


def test_robots_of_one_company_are_different_ones_of_one_world() -> None:
    world = World("empty", robots=2)
    for numbers, worlds in (((1, 1), (world, world)), ((1, 2), (world, World("empty", robots=2)))):
        with pytest.raises(ValueError, match="different ones of the same world"):
            Company(Emulator(one, 38400, number=number) for one, number in zip(worlds, numbers, strict=True))


def test_a_reset_and_a_new_rate_are_one_robots_own() -> None:
    world = World("empty", 1, robots=2)
    emulators = [Emulator(world, 38400, number=number) for number in (1, 2)]
    Company(emulators)
    for emulator in emulators:
        emulator.transmitted(1.0)
        emulator.receive(b"D,5,5\n", 1.0)
    emulators[0].receive(b"restart\n", 1.1)
    emulators[1].receive(b"serial 9600\n", 1.1)
    assert emulators[0].transmitted(2.0).endswith(b"Protocol\r\n")
    assert [emulator.baud for emulator in emulators] == [38400, 9600]
    assert [emulator.body.motion.orders for emulator in emulators] == [(0, 0), (5, 5)]
