"""Poses as people have them: one reader for every form."""

import json

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from nbv.errors import UserError
from nbv.poses import as_pose, read_entries, read_pose
from nbv.tables.next_camera import PoseEstimate, as_view, read_views
from random_poses import random_pose, seeds


@given(seed=seeds)
def test_a_pose_is_16_numbers(seed):
    pose = random_pose(seed)
    assert np.array_equal(as_pose(pose), pose)
    assert np.array_equal(as_pose(pose.ravel().tolist()), pose)


def bad_poses():
    pose = random_pose(1)
    mirrored, scaled, unreal = (pose.copy() for _ in range(3))
    mirrored[:3, 0] *= -1
    scaled[:3, :3] *= 1.01
    unreal[0, 3] = np.nan
    return {
        "transposed": pose.T,
        "mirrored": mirrored,
        "scaled": scaled,
        "nan": unreal,
        "huge": 1e300 * pose,
    }


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", bad_poses())
def test_what_is_no_rotation_with_a_translation_is_refused(name):
    reasons = {"transposed": "transposed", "mirrored": "a reflection", "nan": "finite numbers"}
    with pytest.raises(UserError, match=reasons.get(name, "not a rotation|scaled")):
        as_pose(bad_poses()[name])


@pytest.mark.parametrize(
    ("row", "value", "message"),
    [
        ((3, 3), 2.0, "camera pose: the last row is 0 0 0 2, but a pose has 0 0 0 1"),
        ((1, 1), np.nan, "camera pose is not 16 finite numbers"),
    ],
)
def test_a_wrong_row_of_a_pose_is_shown(row, value, message):
    pose = np.eye(4)
    pose[row] = value
    with pytest.raises(UserError, match=message):
        as_pose(pose)


@pytest.mark.parametrize("values", [np.eye(3), np.ones((3, 4)), [], 1.0])
def test_a_pose_of_another_size_is_refused(values):
    with pytest.raises(UserError, match="give a "):
        as_pose(values)


def test_a_pose_is_within_reach():
    pose = random_pose(1)
    pose[1, 3] = 1e300
    with pytest.raises(UserError, match=r"the translation: 1e\+300 m away; give metres"):
        as_pose(pose)


@given(seed=seeds)
def test_every_form_of_file_gives_the_pose(tmp_path_factory, seed):
    folder, pose = tmp_path_factory.mktemp("pose"), random_pose(seed)
    np.save(folder / "a.npy", pose)
    np.save(folder / "flat.npy", pose.ravel())
    (folder / "a.json").write_text(json.dumps(pose.tolist()))
    (folder / "flat.json").write_text(json.dumps(pose.ravel().tolist()))
    np.savetxt(folder / "a.txt", pose, fmt="%.17g")
    np.savetxt(folder / "a.csv", pose, fmt="%.17g", delimiter=",")
    for name in ("a.txt", "a.json"):
        marked = (folder / name).with_stem("mark")
        marked.write_text((folder / name).read_text(), encoding="utf-8-sig")
    for path in folder.iterdir():
        assert np.array_equal(read_pose(path).camera_pose, pose), path.name


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(UserError, match=r"no\.npy does not exist"):
        read_pose(tmp_path / "no.npy")
    with pytest.raises(UserError, match="is a folder"):
        read_pose(tmp_path)


STAMPED = """\
header:
  stamp: {{sec: 1700000000, nanosec: 5}}
  frame_id: {frame}
pose:
  position: {{x: {0}, y: {1}, z: {2}}}
  orientation:
    x: {3}
    y: {4}
    z: {5}
    w: {6}
---
"""


def in_camera(seed):
    """A pose that a camera sees, and its position and quaternion x, y, z, w; metres."""
    pose = random_pose(seed)
    pose[2, 3] = 0.2 + abs(pose[2, 3])
    return pose, pose[:3, 3].tolist(), Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()


@given(seed=seeds)
def test_every_form_gives_the_estimate(tmp_path_factory, seed):
    folder = tmp_path_factory.mktemp("estimates")
    pose, at, (x, y, z, w) = in_camera(seed)
    row, t = pose[:3, :3].ravel().tolist(), (1000 * pose[:3, 3]).tolist()
    millimetres = pose.copy()
    millimetres[:3, 3] = t
    entries = [
        {"R": row, "t": t, "score": None, "camera_pose": None},
        {"R": pose[:3, :3].tolist(), "position": at},
        {"obj_id": 5, "cam_R_m2c": row, "cam_t_m2c": t},
        {"t": t, "quaternion_xyzw": [x, y, z, w]},
        {"position": at, "quaternion_wxyz": [w, x, y, z]},
        {"pose": pose.tolist(), "score": 0.5},
        {"pose": {"pose": {"position": dict(zip("xyz", at, strict=True)), "orientation": None}}},
    ]
    entries[-1]["pose"]["pose"]["orientation"] = {"x": x, "y": y, "z": z, "w": w}
    views = [as_view(entry, "e") for entry in [*entries, pose, pose.ravel().tolist(), millimetres]]
    views += [as_view([*at, x, y, z, w], "e", "xyzw"), as_view([*at, w, x, y, z], "e", "wxyz")]
    views.append(PoseEstimate(pose))
    (folder / "stamped.yaml").write_text(STAMPED.format(*at, x, y, z, w, frame="f") * 2)
    (folder / "printed.txt").write_text(f"# a comment\n{pose}\n")
    (folder / "list.json").write_text(json.dumps(entries))
    np.save(folder / "stack.npy", np.stack([pose] * 9))
    np.savetxt(folder / "blocks.txt", np.vstack([pose] * 3))
    for file, n in (("stamped.yaml", 2), ("printed.txt", 1), ("stack.npy", 9), ("blocks.txt", 3)):
        read = read_views(folder / file)
        assert len(read) == n
        views += read
    views += read_views(folder / "list.json")
    for view in views:
        assert view.rotation == pytest.approx(pose[:3, :3], abs=1e-7)
        assert view.position_mm == pytest.approx(np.array(t), abs=1e-3)


def test_the_shape_decides_and_not_the_count():
    poses, rotations = np.stack([np.eye(4)] * 9), np.stack([np.eye(3)] * 16)
    for given_poses, n, size in (
        (poses, 9, 16),
        (poses.reshape(9, 16), 9, 16),
        (poses.reshape(36, 4).tolist(), 9, 16),
        (rotations, 16, 9),
        (rotations.reshape(16, 9), 16, 9),
        (rotations[:3].ravel(), 3, 9),
        (np.ones((7, 7)), 7, 7),
    ):
        sizes = [np.size(entry) for _, entry in read_entries(given_poses, "estimate")]
        assert sizes == [size] * n
    with pytest.raises(UserError, match="16 of 9 numbers or 9 of 16 numbers"):
        read_entries(poses.ravel(), "estimate")


@pytest.mark.parametrize(
    ("given_pose", "message"),
    [
        ([0, 0, 0.7, 0, 0, 0, 1], "`quaternion` xyzw or wxyz"),
        ({"t": [0, 0, 700], "quaternion_xyzw": [0, 0, 0, 2]}, "length 2"),
        ({"position": [0, 0, 1], "orientation": [0, 0, 0, 1]}, "position and a quaternion"),
        ({"R": np.eye(3), "quaternion_xyzw": [0, 0, 0, 1]}, "R and quaternion_xyzw"),
        ({"pose": {"pose": {"pose": {"pose": np.eye(4)}}}}, "pose: pose"),
        ({"position": [0, 0, 700], "R": np.eye(3)}, "700 away, in metres or millimetres"),
        (np.block([[np.eye(3), np.array([[0, 0, 20]]).T], [0, 0, 0, 1]]), "20 away, in metres"),
        ({"R": np.eye(3), "t": [0, 0, 10**400]}, "not 3 finite numbers"),
        ({"R": np.eye(3), "t": [0, 0, 1e300]}, "1e\\+300 mm away"),
        (np.ones((3, 4)), "give a 3 × 3"),
    ],
)
def test_what_is_not_clear_is_asked(given_pose, message):
    with pytest.raises(UserError, match=f"e.json.*{message}"):
        as_view(given_pose, "e.json")


def test_a_camera_pose_is_in_metres():
    for lacking in ({"R": np.eye(3), "t": [0, 0, 700]}, {"R": np.eye(3)}):
        with pytest.raises(UserError, match="4 × 4 matrix in metres"):
            as_pose(lacking)


@pytest.mark.parametrize(("frame", "n_warnings"), [("camera_optical_frame", 0), ("base_link", 1)])
def test_the_frame_of_a_message_is_kept_and_one_that_is_not_optical_is_warned_of(
    tmp_path, frame, n_warnings
):
    (tmp_path / "m.yaml").write_text(STAMPED.format(0, 0, 1, 0, 0, 0, 1, frame=frame))
    (view,) = read_views(tmp_path / "m.yaml")
    assert view.frame_id == frame
    assert len(view.warnings) == n_warnings


@given(seed=seeds)
def test_three_decimals_are_the_nearest_rotation(seed):
    rotation = random_pose(seed)[:3, :3]
    view = PoseEstimate(rotation.round(3))
    assert np.degrees(np.linalg.norm(view.rotation - rotation) / np.sqrt(2)) < 0.1
    is_kept = np.array_equal(view.rotation, rotation.round(3))
    assert is_kept or np.allclose(view.rotation @ view.rotation.T, np.eye(3), atol=1e-12)
    assert len(view.warnings) == (not is_kept)
