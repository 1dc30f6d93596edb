"""The answer for a symmetric object stays near an earlier pose."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nbv.cli import main
from nbv.errors import UserError
from nbv.tables.next_camera import PoseEstimate
from nbv.tables.orientation_table import OrientationTable

N_TURNS = 4


def quarter(k):
    return Rotation.from_euler("z", 90 * k, degrees=True).as_matrix()


@pytest.fixture(scope="module")
def table():
    poses, name = Rotation.random(20, random_state=0).as_matrix(), np.full(20, "nut")
    turn = np.eye(4)
    turn[:3, :3] = quarter(1)
    entry = {"symmetries_discrete": [turn.ravel().tolist()]}
    return OrientationTable(name, name, poses, poses, symmetries={"nut": entry})


def pose(seed):
    made = np.eye(4)
    made[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    made[:3, 3] = 0.1 * seed
    return made


@pytest.mark.parametrize("k", range(N_TURNS))
def test_the_answer_is_the_twin_nearest_to_the_previous_pose(table, k):
    small = Rotation.from_rotvec([5, -5, 10], degrees=True).as_matrix()
    view = PoseEstimate(pose(1)[:3, :3])
    previous = PoseEstimate(view.rotation @ quarter(k) @ small)
    answer = table.recommend([view], 9, previous=previous)
    assert np.allclose(answer.rotation, view.rotation @ quarter(k))
    # The camera has moved: the object stood still in whatever base frame.
    for base in (np.eye(4), pose(5)):
        earlier, now = base @ pose(2), base @ pose(3)
        in_earlier = earlier[:3, :3].T @ now[:3, :3] @ previous.rotation
        before = PoseEstimate(in_earlier, camera_pose=earlier)
        for given, camera_pose in ((view, now), (replace(view, camera_pose=now), None)):
            answer = table.recommend([given], 9, camera_pose=camera_pose, previous=before)
            assert np.allclose(answer.rotation, view.rotation @ quarter(k))
    with pytest.raises(UserError, match=r"`previous`.*both"):
        table.recommend([view], 9, previous=before)


def test_the_command_takes_a_previous_pose(table, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    table.save("t.npz")
    np.save("previous.npy", quarter(1))
    eye = " ".join(map(str, np.eye(3).ravel()))
    options = ["next", "t.npz", "--estimate", *eye.split(), "--sphere", "9"]
    assert main([*options, "--previous", "previous.npy"]) == 0
    assert "0.00000  -1.00000   0.00000" in capsys.readouterr().out
    np.save("camera.npy", np.eye(4))
    options += ["--camera-pose", "camera.npy"]
    assert main([*options, "--previous", "previous.npy"]) == 2
    assert "--previous and the last estimate" in capsys.readouterr().err
