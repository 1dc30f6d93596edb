"""Which views count, what candidates are, and which of equal poses is the answer."""

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
    assert main([*options[:-1], "9.5"]) == 2
    assert "--sphere: '9.5' is not an integer" in capsys.readouterr().err
    assert main([*options, "--previous", "previous.npy"]) == 0
    assert "0.00000  -1.00000   0.00000" in capsys.readouterr().out
    np.save("camera.npy", np.eye(4))
    options += ["--camera-pose", "camera.npy"]
    assert main([*options, "--previous", "previous.npy"]) == 2
    assert "--previous and the last estimate" in capsys.readouterr().err


# Views


def turned(deg, distance_mm=700.0):
    """A view of an object at the base frame's origin, about whose y axis the camera has turned."""
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler("y", deg, degrees=True).as_matrix()
    made[:3, 3] = -distance_mm / 1000 * made[:3, 2]
    return PoseEstimate(made[:3, :3].T, np.array([0, 0, distance_mm]), None, made)


@pytest.fixture(scope="module")
def flipping():
    """Of an object whose estimates are flipped where it is seen from +x; low scores tell."""
    truth = Rotation.random(300, random_state=0).as_matrix()
    flips = truth[:, 2, 0] < -0.3
    estimate = np.where(flips[:, None, None], truth @ np.diag([-1.0, -1, 1]), truth)
    score = np.where(flips, 0.3, 0.8) + np.linspace(0, 0.1, 300)
    group = np.repeat(np.arange(20).astype(str), 15)
    return OrientationTable(np.full(300, "cup"), group, estimate, truth, score, True)


def test_a_view_from_the_same_place_counts_once(flipping):
    views = [turned(0), turned(100)]
    wanted = flipping.recommend(views, 20)
    for again in ([views[0], *views], [views[0], views[1], turned(95), views[1]]):
        answer = flipping.recommend(again, 20)
        assert answer.expected_error_deg == pytest.approx(wanted.expected_error_deg)
        assert np.allclose(answer.rotation, wanted.rotation)
        (warning,) = set(answer.warnings) - set(wanted.warnings)
        assert "within 15° of a later one" in warning
    (rolled,) = {flipping.recommend([turned(0)] * n, 20).expected_error_deg for n in (1, 2, 5)}
    assert rolled > wanted.expected_error_deg


def test_camera_poses_that_contradict_each_other_are_refused(flipping):
    views = [turned(0), turned(100)]
    wrong = [replace(view, camera_pose=np.linalg.inv(view.camera_pose)) for view in views]
    with pytest.raises(UserError, match=r"views 0 and 1 place .* inverted"):
        flipping.recommend(wrong, 20)


def test_a_camera_far_from_the_base_is_told(flipping):
    far = np.eye(4)
    for metres in (49.0, 51.0):
        far[2, 3] = metres
        answer = flipping.recommend([PoseEstimate(np.eye(3))], 9, camera_pose=far)
        assert any("millimetres" in text for text in answer.warnings) == (metres > 50)


@pytest.mark.parametrize("table_of", ["table", "flipping"])
def test_estimates_that_contradict_each_other_are_never_enough(request, table_of):
    made = request.getfixturevalue(table_of)
    if table_of == "flipping":
        made = replace(made, estimate=made.truth)
    views, flip = [turned(0), turned(100)], Rotation.from_euler("x", 180, degrees=True).as_matrix()
    for given in (views, [PoseEstimate(np.eye(3))]):
        assert made.recommend(given, 20).decision.verdict == "enough"
        last = given[-1]
        other = replace(last, rotation=last.rotation @ flip)
        answer = made.recommend([*given[: len(given) - 1 or 1], other], 20)
        assert answer.decision.verdict != "enough"


@pytest.mark.parametrize("score", [np.nan, np.inf, "high", [0.4, 0.5]])
def test_a_score_is_a_finite_number(score):
    with pytest.raises(UserError, match="score is not a finite number"):
        PoseEstimate(np.eye(3), score=score)


def test_what_is_no_list_of_estimates_is_named(table):
    view = PoseEstimate(np.eye(3))
    for given in (view, [np.eye(4)], np.eye(4)):
        with pytest.raises(UserError, match="`estimates`: give a list of PoseEstimate"):
            table.recommend(given, 9)
    with pytest.raises(UserError, match="`candidates`=9: give camera poses, or an integer"):
        table.recommend([view], 9.0)
    named = replace(table, object_id=np.full(20, "1"), symmetries={})
    wanted = named.recommend([view], 9, object_id="1")
    assert named.recommend([view], np.int64(9), object_id=1).decision == wanted.decision


# Candidates


def test_candidates_that_look_away_are_left_out_and_counted(flipping):
    poses = [move.target_camera_pose for move in flipping.recommend([turned(0)], 20).moves]
    wanted = flipping.recommend([turned(0)], poses)
    away = poses[0] @ np.diag([1.0, -1, -1, 1])
    answer = flipping.recommend([turned(0)], [away, *poses, away])
    assert [m.index - 1 for m in answer.moves] == [m.index for m in wanted.moves]
    assert [m.expected_error_deg for m in answer.moves] == pytest.approx(
        [m.expected_error_deg for m in wanted.moves]
    )
    (warning,) = set(answer.warnings) - set(wanted.warnings)
    assert warning.startswith(f"2 of {len(poses) + 2} candidates look away")
    with pytest.raises(UserError, match=r"^candidate 0: the object is 180° off .* OpenGL's"):
        flipping.recommend([turned(0)], [away, away, poses[0]])


@pytest.mark.parametrize("n", [0, -1, 10_001])
def test_a_sphere_has_a_limit(flipping, n):
    with pytest.raises(UserError, match=f"`sphere`={n}: give 1 to 10000"):
        flipping.recommend([turned(0)], n)


def test_many_candidates_rank_as_few(flipping):
    poses = [move.target_camera_pose for move in flipping.recommend([turned(0)], 60).moves]
    few = flipping.recommend([turned(0)], poses)
    many = flipping.recommend([turned(0)], poses * 40)
    assert len(many.moves) == 40 * len(few.moves)
    one, other = ([m.expected_error_deg for m in each.moves] for each in (few, many))
    # What the choice among them adds is the same for all.
    assert np.ptp(np.array(other) - np.repeat(one, 40)) < 1e-6


def test_without_a_camera_pose_targets_are_in_the_camera(flipping):
    view = replace(turned(0), camera_pose=None)
    for answer, frame in (
        (flipping.recommend([view], 9), "frame of the present camera"),
        (flipping.recommend([turned(0)], 9), "base frame"),
        (flipping.recommend([view], 9, camera_pose=np.eye(4)), "base frame"),
    ):
        assert answer.frame == frame
    targets = [move.target_camera_pose for move in answer.moves]
    behind = [target @ np.diag([1.0, -1, -1, 1]) for target in targets]
    with pytest.raises(UserError, match="if they are in the base frame, give `camera_pose`"):
        flipping.recommend([view], behind)
    for camera_pose, is_told in ((None, True), (np.eye(4), False)):
        told = flipping.recommend([view], targets, camera_pose=camera_pose).warnings
        assert any("give `camera_pose`" in text for text in told) == is_told


# Scores


def scored(table, *scores):
    answer = table.recommend([replace(turned(0), score=score) for score in scores], 9)
    return answer.expected_error_deg, set(answer.warnings)


def test_a_score_of_none_is_no_score(flipping):
    assert scored(flipping, -1) == scored(flipping, None)
    assert scored(flipping, 0.4) != scored(flipping, None)
    none = replace(flipping, score=np.full(300, -1.0))
    assert scored(none, -1) == scored(none, 0.5) == scored(replace(none, score=None), None)
    some = replace(none, score=np.where(np.arange(300) < 3, -1.0, flipping.score))
    assert scored(some, 0.5) == scored(none, 0.5)
    logits = replace(flipping, score=np.log(flipping.score / (1 - flipping.score)))
    assert scored(logits, -1) != scored(logits, None)


@pytest.mark.parametrize(
    ("unit", "score", "is_odd"),
    [(1, score, not 0.1 <= score <= 1) for score in (-0.1, 0.1, 1.0, 1.01, -0.5, 87.0)]
    + [(100, score, not 1 < score <= 120) for score in (20.0, 110.0, -5.0, 1000.0, 0.9)],
)
def test_a_score_of_another_scale_is_told(flipping, unit, score, is_odd):
    _, warnings = scored(replace(flipping, score=unit * flipping.score), score)
    assert any("another scale" in text for text in warnings) == is_odd


def test_a_low_score_is_told_where_calibration_has_none(flipping):
    narrow = replace(flipping, score=0.9 + 0.1 * flipping.score)
    for score, is_odd in ((0.95, False), (0.5, True)):
        assert any("worse than those" in text for text in scored(narrow, score)[1]) == is_odd
