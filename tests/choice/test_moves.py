"""Poses of the camera after a rotation about the object."""

import io
import re

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from nbv.choice.moves import (
    ROLL_LIMIT_DEG,
    as_rotations,
    check_axis,
    down_of_axis,
    elevation_from_gravity,
    moved_camera,
    read_rotations,
    roll_warnings,
    rotation_about,
)
from nbv.data.camera import viewpoint_frames
from nbv.errors import FrameError, UserError
from nbv.poses import read_pose
from random_poses import random_pose, seeds

points = arrays(np.float64, (3,), elements=st.floats(-3, 3))
directions = points.filter(lambda axis: np.linalg.norm(axis) > 1e-3)
angles = st.floats(-720, 720)


def camera_at(elevation: float, azimuth: float, distance: float, centre) -> np.ndarray:
    """An optical frame (z forward, x right, y down) that is directed at a point."""
    right, up, forward = (axes[0] for axes in viewpoint_frames(elevation, [azimuth]))
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, -up, forward], axis=1)
    pose[:3, 3] = centre - distance * forward
    return pose


def azimuth_of(pose, centre, up=(0.0, 0.0, 1.0)) -> float:
    """Of a camera about an upright axis, degrees, from some direction across it."""
    unit = np.asarray(up) / np.linalg.norm(up)
    across = np.cross(np.eye(3)[np.abs(unit).argmin()], unit)
    across /= np.linalg.norm(across)
    offset = np.asarray(pose)[:3, 3] - centre
    return float(np.degrees(np.arctan2(offset @ np.cross(unit, across), offset @ across)))


# Rotations


@given(point=points, direction=directions, angle=angles)
def test_rotations_are_those_of_scipy(point, direction, angle):
    motion = rotation_about(point, direction, angle)
    unit = direction / np.linalg.norm(direction)
    expected = Rotation.from_rotvec(np.radians(angle) * unit).as_matrix()
    assert motion[:3, :3] == pytest.approx(expected, abs=1e-9)
    assert motion[:3, 3] == pytest.approx(point - expected @ point, abs=1e-8)
    assert motion[3].tolist() == [0, 0, 0, 1]


@given(point=points, direction=directions, first=angles, second=angles)
def test_rotations_about_one_axis_add_up(point, direction, first, second):
    both = rotation_about(point, direction, first) @ rotation_about(point, direction, second)
    assert both == pytest.approx(rotation_about(point, direction, first + second), abs=1e-7)


@given(point=points, direction=directions, angle=angles, scale=st.floats(0.01, 100.0))
def test_only_the_direction_of_the_axis_matters(point, direction, angle, scale):
    one = rotation_about(point, direction, angle)
    assert rotation_about(point, scale * direction, angle) == pytest.approx(one, abs=1e-7)
    assert rotation_about(point, -direction, -angle) == pytest.approx(one, abs=1e-7)


@pytest.mark.parametrize(
    ("point", "direction"),
    [
        ([0, 0, 0], [0, 0, 0]),
        ([0, 0, 0], [np.nan, 0, 1]),
        ([1e300, 0, 0], [0, 0, 1]),
        ([0, 0, 0], [0, 0, 1, 0]),
        ("origin", [0, 0, 1]),
    ],
)
@pytest.mark.filterwarnings("error")
def test_an_axis_has_a_point_and_a_direction(point, direction):
    with pytest.raises(UserError, match="axis"):
        rotation_about(point, direction, 10.0)


@pytest.mark.parametrize("angle", [np.nan, np.inf, "left", None, [10, 20], 1j])
def test_a_rotation_is_one_finite_number(angle):
    with pytest.raises(UserError, match="rotation is not a finite number; give degrees"):
        moved_camera(np.eye(4), [0, 0, 0], [0, 0, 1], angle)


def test_the_pose_of_the_camera_is_checked():
    with pytest.raises(UserError, match="camera pose"):
        moved_camera(2 * np.eye(4), [0, 0, 0], [0, 0, 1], 30.0)


@pytest.mark.filterwarnings("error")
def test_a_direction_may_be_of_any_length():
    wanted = rotation_about([1, 2, 3], [1, 2, 2], 40.0)
    for length in (1e-8, 1e200, 1e300):
        found = rotation_about([1, 2, 3], np.array([1, 2, 2]) * length, 40.0)
        assert found == pytest.approx(wanted)


# The camera


@given(
    elevation=st.floats(0, 80),
    azimuth=st.floats(0, 360),
    centre=points,
    rotation=st.floats(-179, 179),
)
def test_the_azimuth_grows_by_the_rotation(elevation, azimuth, centre, rotation):
    camera = camera_at(elevation, azimuth, 0.6, centre)
    target = moved_camera(camera, centre, [0, 0, 1], rotation)
    gained = azimuth_of(target, centre) - azimuth_of(camera, centre)
    assert (gained - rotation + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-6)
    # It is the same camera at the new azimuth: directed at the object and as upright as before.
    assert target == pytest.approx(camera_at(elevation, azimuth + rotation, 0.6, centre), abs=1e-9)


@given(seed=seeds, centre=points, up=directions, rotation=st.floats(-179, 179))
@example(seed=0, centre=np.zeros(3), up=np.array([1e-160, 0.0, -2.0]), rotation=1.0)
def test_the_azimuth_grows_about_any_upright_axis(seed, centre, up, rotation):
    camera = random_pose(seed)
    apart = np.cross(camera[:3, 3] - centre, up / np.linalg.norm(up))
    if np.linalg.norm(apart) < 0.05:
        return
    target = moved_camera(camera, centre, up, rotation)
    gained = azimuth_of(target, centre, up) - azimuth_of(camera, centre, up)
    assert (gained - rotation + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-6)


@given(seed=seeds, centre=points, up=directions, rotation=angles)
def test_distances_to_the_axis_and_along_it_are_kept(seed, centre, up, rotation):
    camera, unit = random_pose(seed), up / np.linalg.norm(up)
    target = moved_camera(camera, centre, up, rotation)
    before, after = camera[:3, 3] - centre, target[:3, 3] - centre
    assert after @ unit == pytest.approx(before @ unit, abs=1e-8)
    assert np.linalg.norm(np.cross(after, unit)) == pytest.approx(
        np.linalg.norm(np.cross(before, unit)), abs=1e-8
    )
    # What the camera sees of the axis does not move in its image.
    for along in (-1.0, 0.0, 2.0):
        point = [*(centre + along * unit), 1]
        assert np.linalg.solve(target, point) == pytest.approx(
            np.linalg.solve(camera, point), abs=1e-6
        )


@given(seed=seeds, base=seeds, centre=points, up=directions, rotation=angles)
def test_another_base_frame_gives_the_same_move(seed, base, centre, up, rotation):
    camera, change = random_pose(seed), random_pose(base)
    moved = moved_camera(
        change @ camera, (change @ [*centre, 1])[:3], change[:3, :3] @ up, rotation
    )
    assert moved == pytest.approx(change @ moved_camera(camera, centre, up, rotation), abs=1e-6)


@given(
    elevation=st.floats(-90, 90),
    azimuth=st.floats(0, 360),
    length=st.floats(1e-200, 1e200),
)
def test_the_direction_down_in_the_camera_tells_its_elevation(elevation, azimuth, length):
    camera = camera_at(elevation, azimuth, 0.6, np.zeros(3))
    down = camera[:3, :3].T @ [0.0, 0.0, -1.0]
    assert down == pytest.approx(-camera[2, :3])
    assert elevation_from_gravity(length * down) == pytest.approx(elevation, abs=1e-6)


@pytest.mark.parametrize("down", [(0, -9.81, 0), (0, -1, 1), (3, -1, 1), (0, -0.2, -1)])
def test_gravity_does_not_point_up_in_the_image(down):
    with pytest.raises(UserError, match="points up, but y is down in the optical frame"):
        elevation_from_gravity(down)


def test_a_camera_that_looks_straight_up_may_be_an_accelerometers_sign():
    (warning,) = roll_warnings([0, 0, -9.81])
    assert "reverse all three signs" in warning
    assert roll_warnings([0, 0, 9.81]) == roll_warnings([0, 9.81, 0]) == ()


@given(
    elevation=st.floats(-80, 79),
    azimuth=st.floats(0, 360),
    roll=st.floats(-44, 44),
    length=st.floats(1e-200, 1e200),
)
def test_a_camera_that_is_rolled_is_told_to_which_side_the_object_leans(
    elevation, azimuth, roll, length
):
    camera = camera_at(elevation, azimuth, 0.6, np.zeros(3))
    cos, sin = np.cos(np.radians(roll)), np.sin(np.radians(roll))
    # Turned clockwise about its line of sight: objects lean to the left.
    rolled = camera.copy()
    rolled[:3, :3] = camera[:3, :3] @ [[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]
    for down in (
        length * (rolled[:3, :3].T @ [0.0, 0.0, -1.0]),
        down_of_axis(rolled, (0.1, 0, 0), (0, 0, 2.0)),
    ):
        warnings = roll_warnings(down)
        if abs(abs(roll) - ROLL_LIMIT_DEG) < 1e-6:
            continue
        assert len(warnings) == (abs(roll) > ROLL_LIMIT_DEG)
        for line in warnings:
            leans, side = re.findall(r"leans (\d+)° to the (\w+)", line)[0]
            assert abs(int(leans) - abs(roll)) < 0.51
            assert side == ("left" if roll > 0 else "right")


def test_of_a_camera_that_is_directed_straight_down_no_roll_is_told():
    assert roll_warnings((0.1, 0.0, 1.0)) == ()
    assert len(roll_warnings((1.0, 0.0, 1.0))) == 1


# Rotations from a mask


@given(mask=st.lists(st.booleans(), min_size=1, max_size=400).filter(any))
def test_an_entry_of_a_mask_is_its_share_of_the_circle(mask):
    wanted = [360 * k / len(mask) for k, may in enumerate(mask) if may]
    assert as_rotations(mask) == pytest.approx(wanted)
    assert as_rotations(np.array(wanted)) == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([], "give at least one"),
        ([30.0, np.nan], "one is not finite, or beyond 1e6"),
        (np.ones((4, 4), dtype=bool), "a mask of 2 axes"),
        (["30", "60"], "give degrees or booleans"),
        ([[1.0], [2.0, 3.0]], "rows of different lengths"),
    ],
)
def test_what_is_no_rotation_is_refused_in_an_array_and_in_a_file(tmp_path, values, message):
    with pytest.raises(UserError, match=f"^allowed rotations: .*{message}"):
        as_rotations(values)
    if message != "rows of different lengths":
        np.save(tmp_path / "a.npy", values)
        with pytest.raises(UserError, match=rf"a\.npy: .*{message}"):
            read_rotations(tmp_path / "a.npy")


# Files


def damaged_poses() -> dict[str, bytes]:
    buffer = io.BytesIO()
    np.save(buffer, np.eye(4))
    npy, archive, objects = buffer.getvalue(), io.BytesIO(), io.BytesIO()
    np.savez(archive, pose=np.eye(4))
    np.save(objects, np.array([{}], dtype=object))
    return {
        "empty.npy": b"",
        "cut.npy": npy[:-8],
        "archive.npy": archive.getvalue(),
        "objects.npy": objects.getvalue(),
        "names.json": b'{"pose": 1}',
        "deep.json": b"[" * 100_000,
        "bytes.txt": b"\xff\xfe\x00",
        "short.txt": b"1 0 0 0 1 0 0 0 1",
    }


@pytest.mark.parametrize("name", damaged_poses())
def test_a_damaged_file_is_named_in_one_line(tmp_path, name):
    (tmp_path / name).write_bytes(damaged_poses()[name])
    with pytest.raises(UserError, match=name) as error:
        _ = read_pose(tmp_path / name).camera_pose
    assert "\n" not in str(error.value)
    with pytest.raises(UserError, match=name) as error:
        read_rotations(tmp_path / name)
    assert "\n" not in str(error.value)


def test_a_suffix_may_be_in_capitals(tmp_path):
    with (tmp_path / "A.NPY").open("wb") as file:
        np.save(file, [90.0, 180.0])
    assert read_rotations(tmp_path / "A.NPY").tolist() == [90.0, 180.0]


# The object is where the axis is


@given(
    along=st.floats(-2, 2),
    apart_m=st.floats(0, 1),
    aside_deg=st.floats(0, 360),
    diagonal_m=st.floats(0.05, 0.5),
    elevation=st.floats(-25, 75),
    azimuth=st.floats(0, 360),
)
def test_an_object_farther_from_the_axis_than_its_diagonal_is_refused(
    along, apart_m, aside_deg, diagonal_m, elevation, azimuth
):
    assume(abs(apart_m - diagonal_m) > 1e-6)
    point, aside = np.array([0.5, 0.2, 0.1]), np.radians(aside_deg)
    pose = camera_at(elevation, azimuth, 0.7, point)
    place = point + np.array([apart_m * np.cos(aside), apart_m * np.sin(aside), along])
    seen = (np.linalg.inv(pose) @ [*place, 1.0])[:3]
    # The axis may have any length.
    check_axis(pose, point, (0, 0, 3))
    check_axis(pose, point, (0, 0, 3), object_position_m=seen)
    if apart_m < diagonal_m:
        check_axis(pose, point, (0, 0, 3), seen, diagonal_m)
        return
    with pytest.raises(FrameError, match=f"{apart_m:.3g} m from the axis") as error:
        check_axis(pose, point, (0, 0, 3), seen, diagonal_m)
    assert error.value.name == "axis"


@given(
    roll=st.floats(-180, 180), elevation=st.floats(-89, 89), azimuth=st.floats(0, 360), seed=seeds
)
def test_an_axis_that_does_not_point_up_in_the_image_is_refused(roll, elevation, azimuth, seed):
    edges = (abs(abs(roll) - 45), abs(elevation + 30), abs(elevation - 80))
    assume(min(edges) > 1e-6)
    pose = camera_at(elevation, azimuth, 0.7, np.zeros(3))
    angle = np.radians(roll)
    # About the optical axis, z.
    pose[:3, :2] = pose[:3, :2] @ [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    # In any base frame.
    base = random_pose(seed)
    point, up = base[:3, 3], base[:3, :3] @ [0, 0, 1]
    if abs(roll) < 45 and -30 < elevation < 80:
        check_axis(base @ pose, point, up)
        return
    with pytest.raises(FrameError, match="upright") as error:
        check_axis(base @ pose, point, up)
    assert error.value.name == "axis"
    what = f"elevation of {elevation:.0f}°" if not -30 < elevation < 80 else f"{abs(roll):.0f}°"
    assert what in str(error.value).replace("-0°", "0°")


def link_frame(pose):
    """The same camera's pose with x forward, y left, z up (ROS REP 103's camera_link)."""
    linked = pose.copy()
    linked[:3, :3] = pose[:3, :3] @ np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    return linked


def in_millimetres(pose):
    return np.block([[pose[:3, :3], 1000 * pose[:3, 3:]], [pose[3:]]])


@pytest.mark.parametrize("mistake", [np.linalg.inv, link_frame, in_millimetres])
@pytest.mark.parametrize(("elevation", "azimuth"), [(0.0, 10.0), (30.0, 130.0), (60.0, 250.0)])
def test_usual_mistakes_of_a_camera_pose_are_refused(mistake, elevation, azimuth):
    centre, seen, up = np.array([0.5, 0.2, 0.1]), (0.02, -0.01, 0.7), (0, 0, 1)
    pose = camera_at(elevation, azimuth, 0.7, centre)
    check_axis(pose, centre, up, seen, 0.17)
    with pytest.raises(FrameError, match="optical frame"):
        check_axis(mistake(pose), centre, up, seen, 0.17)
