"""The linear camera: what it sees, how long it holds it, and by what light."""

import math

import numpy as np
import pytest

from khepera_hil.emulator import Emulator
from khepera_hil.world import Arena, World
from khepera_hil.world.arena import Start
from khepera_hil.world.camera import FIELD, PIXELS
from khepera_hil.world.shapes import Shape, box


def world(
    *things: Shape, at: tuple[float, float, float] = (500, 500, 0), seed: int = 0, plain: bool = False
) -> World:
    stripes = None if plain else (10.0, 20.0)
    return World(Arena("made", "", things=things, wall_stripes=stripes, start=Start(pose=at)), seed)


def painted(name: str, y: float, albedo: float, height: float = 80) -> Shape:
    """A board 300 mm ahead of the robot in the middle of the floor, 40 mm wide."""
    shape = box(name, "fixed", 10, 40, (813 - 8, y, 0), height)
    return Shape(name, "fixed", shape.pose, height, shape.corners, albedo=albedo)


def test_a_frame_is_sixty_four_grey_levels_with_the_left_edge_first() -> None:
    there = world(painted("left", 560, 0.0), painted("right", 440, 1.0), plain=True)
    frame = there.camera()
    assert len(frame) == PIXELS
    assert all(type(value) is int for value in frame)
    assert min(frame) >= 0
    assert max(frame) <= 255
    # Boards 60 mm aside at 287 mm are 11.8 degrees off the middle; a pixel is 36/63 of a degree.
    dark, bright = np.argmin(frame), np.argmax(frame)
    step = math.degrees(FIELD) / (PIXELS - 1)
    assert 18 - dark * step == pytest.approx(math.degrees(math.atan2(60, 287)), abs=4)
    assert 18 - bright * step == pytest.approx(-math.degrees(math.atan2(60, 287)), abs=4)


def test_what_is_lower_than_the_camera_is_not_in_the_picture() -> None:
    empty, low, high = world(plain=True), world(painted("b", 500, 0.0, 38)), world(painted("b", 500, 0.0, 42))
    assert low.camera() == world().camera()
    assert min(empty.camera()) > 100
    assert min(high.camera()[28:36]) < min(empty.camera())


def test_striped_walls_show_their_stripes_and_other_seeds_other_stripes() -> None:
    near = world(at=(850, 500, 0))
    plain = world(at=(850, 500, 0), plain=True)
    assert np.abs(np.diff(near.camera())).mean() > 2 * np.abs(np.diff(plain.camera())).mean()
    assert world(seed=1).camera() != world(seed=2).camera()


def test_a_frame_is_held_for_the_scan_period_and_longer_periods_hold_longer() -> None:
    there = world()
    taken = [0]
    frame = there.camera()
    for step in range(1, 401):
        there.advance(step * 0.005)
        if there.camera() != frame:
            taken.append(step)
            frame = there.camera()
    assert taken == list(range(0, 401, 40))
    there.set_camera_period(0.05)
    changes = 0
    for step in range(401, 601):
        there.advance(step * 0.005)
        changes += there.camera() != frame
        frame = there.camera()
    assert changes == 20
    there.set_camera_period(7)
    there.advance(3.1)
    frame = there.camera()
    there.advance(10.0)
    assert there.camera() == frame
    there.set_camera_period(0)
    there.advance(10.1)
    assert there.camera() != frame


def test_a_frame_shows_where_the_robot_was_when_it_was_taken() -> None:
    read_late, read_at_once = world(), world()
    for there in (read_late, read_at_once):
        there.set_speed(40, -40)
    read_at_once.advance(0.4)
    frame = read_at_once.camera()
    read_late.advance(0.595)
    assert read_late.camera() == frame


def test_the_exposure_brightens_a_dark_view_step_by_step_and_does_not_need_to_be_looked_at() -> None:
    wall = Shape("wall", "fixed", (700, 500, 0), 90, ((-5, -400), (5, -400), (5, 400), (-5, 400)), albedo=0.05)
    looked, unseen = (
        World(Arena("made", "", things=(wall,), start=Start(pose=(500, 500, 0))), 4) for _ in range(2)
    )
    means = []
    for frame in range(20):
        looked.advance(frame * 0.2)
        means.append(float(np.mean(looked.camera())))
    unseen.advance(19 * 0.2)
    assert unseen.camera() == looked.camera()
    assert looked.camera_light() == unseen.camera_light() > 800
    assert means[-1] > 150


def test_a_turning_robots_picture_is_smeared() -> None:
    still, turning = world(at=(800, 500, 0)), world(at=(800, 500, 0))
    turning.set_speed(100, -100)
    for there in (still, turning):
        there.advance(1.0)
    assert np.abs(np.diff(turning.camera())).mean() < np.abs(np.diff(still.camera())).mean()


@pytest.mark.parametrize(("off", "inside"), [(17.0, True), (19.0, False)])
@pytest.mark.parametrize("side", [-1, 1])
def test_the_field_is_thirty_six_degrees(off: float, inside: bool, side: int) -> None:
    # A dark post 250 mm from the lens, seen at that angle from straight ahead.
    angle = side * math.radians(off)
    x, y = 513 + 250 * math.cos(angle), 500 + 250 * math.sin(angle)
    shape = box("post", "fixed", 4, 4, (x, y, angle), 80)
    post = Shape("post", "fixed", shape.pose, 80, shape.corners, albedo=0.0)
    with_it, without = (there.camera() for there in (world(post, plain=True), world(plain=True)))
    assert (with_it != without) == inside
    if inside:
        assert np.argmin(np.subtract(with_it, without)) == pytest.approx((18 - side * off) / 36 * 63, abs=2)


def test_a_striped_object_shows_its_stripes() -> None:
    board = Shape("board", "fixed", (700, 500, 0), 80, ((-5, -90), (5, -90), (5, 90), (-5, 90)), stripes=(10, 20))
    plain = Shape("board", "fixed", (700, 500, 0), 80, ((-5, -90), (5, -90), (5, 90), (-5, 90)))
    striped, smooth = (np.array(world(thing, plain=True).camera()) for thing in (board, plain))
    assert np.abs(np.diff(striped)).mean() > 3 * np.abs(np.diff(smooth)).mean()


def test_every_frame_has_its_own_noise_of_four_grey_levels() -> None:
    there = world(plain=True, at=(800, 500, 0))
    frames = []
    for frame in range(40, 80):  # when the exposure has settled
        there.advance(frame * 0.2)
        frames.append(there.camera())
    assert np.median(np.std(frames, axis=0)) == pytest.approx(4, abs=1)


@pytest.mark.parametrize(("code", "milliseconds"), [(0, 200), (1, 50), (2, 100), (3, 150), (4, 250), (5, 500)])
def test_the_host_sets_how_long_a_frame_is_held(code: int, milliseconds: int) -> None:
    robot = Emulator(World("watchman", 1), 38400)
    robot.receive(f"T,2,U,{code}\n".encode(), 0.5)
    assert robot.transmitted(0.6).endswith(b"t,2,u\r\n")
    moments, frame = [], robot.world.camera()
    for step in range(121, 601):
        robot.advance(step * 0.005)
        if robot.world.camera() != frame:
            moments.append(step * 5)
            frame = robot.world.camera()
    assert set(np.diff(moments)) == {milliseconds}
