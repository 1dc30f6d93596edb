"""Poses as users type them, from numbers and from files."""

import json

import numpy as np
import pytest
from hypothesis import given

from nbv.errors import UserError
from nbv.numbers import as_pose, read_pose
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
    with pytest.raises(UserError, match="not 16 finite numbers; give a 4 × 4 matrix"):
        as_pose(values)


def test_a_pose_is_within_reach():
    pose = random_pose(1)
    pose[1, 3] = 1e300
    with pytest.raises(UserError, match=r"the translation: 1e\+300 m away; give metres"):
        as_pose(pose)


def test_rounded_numbers_are_a_pose():
    as_pose(random_pose(3).round(4))


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
        assert np.array_equal(read_pose(path), pose), path.name


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(UserError, match=r"no\.npy does not exist"):
        read_pose(tmp_path / "no.npy")
    with pytest.raises(UserError, match="is a folder"):
        read_pose(tmp_path)
