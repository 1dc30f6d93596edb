"""A folder with a pose for each frame is BOP's table of the same poses."""

import shutil

import numpy as np
import pytest
from examples.bop_example import write_example

from nbv.errors import UserError
from nbv.tables.bop import read_orientation_table
from nbv.tables.pose_folders import read_pose_folders


@pytest.fixture
def example(tmp_path):
    write_example(tmp_path)
    return tmp_path


def read(example, **options):
    return read_pose_folders(example / "ob_in_cam", example / "truth", **options)


def test_a_folder_is_the_table_of_its_poses(example):
    bop = read_orientation_table(example / "results.csv")
    found = read(example, objects=["1"], models_info=example / "models_info.json")
    assert found.estimate == pytest.approx(bop.estimate, abs=1e-5)
    assert found.truth == pytest.approx(bop.truth, abs=1e-5)
    assert [found.straightened, found.object_ids, found.left_out] == [True, ["1"], ()]
    same = [bop.group[:, None] == bop.group, found.group[:, None] == found.group]
    assert np.array_equal(*same)
    assert read(example).object_ids == ["ob_in_cam"]


def test_what_has_no_pair_is_counted(example):
    scene, truths = example / "ob_in_cam/000001", example / "truth/000001"
    np.savetxt(scene / "000000.txt", np.full((4, 4), np.nan))
    np.savetxt(scene / "000001.txt", np.eye(4))
    np.savetxt(scene / "000005.txt", np.zeros((4, 4)))
    (scene / "000006.txt").write_text("")
    (scene / "000002.txt").unlink()
    (truths / "000003.txt").unlink()
    far = np.loadtxt(scene / "000004.txt")
    far[0, 3] += 0.08
    np.savetxt(scene / "000004.txt", far)
    found = read(example)
    assert len(found.estimate) == 153
    assert [text.split(" estimates ")[0] for text in found.left_out] == [
        "1 of 158",
        "1 of 159",
        "1 of 159 truths have no estimate",
        "4 of 157",
    ]
    assert len(read(example, nearest_mm=100).estimate) == 154


def test_what_is_no_pose_is_named(example):
    with pytest.raises(UserError, match="give `ground_truth`"):
        read_pose_folders(example / "ob_in_cam", None)
    for truth in (example / "none", example / "results.csv"):
        with pytest.raises(UserError, match=f"^`ground_truth`={truth} .*; give a folder of poses"):
            read_pose_folders(example / "ob_in_cam", truth)
    with pytest.raises(UserError, match="the name of its `object`"):
        read(example, models_info=example / "models_info.json")
    (example / "ob_in_cam/000002/000007.txt").write_text("1 2 3")
    with pytest.raises(UserError, match=r"000007\.txt: an array of shape \(3,\)"):
        read(example)
    shutil.rmtree(example / "ob_in_cam/000002")
    (example / "ob_in_cam/000001/000001.txt").write_text("0 0 1 0 0 0 1")
    with pytest.raises(UserError, match="7 numbers: give a 4 × 4 matrix, or JSON"):
        read(example)
    for nearest_mm in (-1, np.nan):
        with pytest.raises(UserError, match="give a distance above 0"):
            read(example, nearest_mm=nearest_mm)
    with pytest.raises(UserError, match="leave `least_score` out"):
        read(example, least_score=0.5)
    (example / "truth/000001/000000.txt").write_text("nan " * 16)
    with pytest.raises(UserError, match=r"000000\.txt holds no pose"):
        read(example)
