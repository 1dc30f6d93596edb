"""What of a file of BOP becomes calibration pairs, and what becomes of the rest."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from nbv.errors import UserError
from nbv.tables.bop import read_orientation_table
from nbv.tables.next_camera import PoseEstimate
from nbv.tables.orientation_table import OrientationTable
from rotation_pairs import orientation_pairs

N_IMAGES = 40
PLACES = np.array([[-100.0, 0, 700], [100, 0, 700]])
IDENTITY = "1 0 0 0 1 0 0 0 1"


def text(numbers):
    return " ".join(f"{x:.6f}" for x in np.ravel(numbers))


@pytest.fixture
def scene(tmp_path):
    """A scene of two instances of an object, all of them estimated: its rows and truths."""
    moves = Rotation.random(N_IMAGES, random_state=0).as_matrix()
    start = Rotation.random(2, random_state=1).as_matrix()
    truths, rows = {}, []
    for image, move in enumerate(moves):
        poses = move @ start
        truths[str(image)] = [
            {"obj_id": 1, "cam_R_m2c": r.ravel().tolist(), "cam_t_m2c": t.tolist()}
            for r, t in zip(poses, PLACES, strict=True)
        ]
        rows += [
            (5, image, 1, 0.5, text(r), text(t), -1) for r, t in zip(poses, PLACES, strict=True)
        ]
    columns = ["scene_id", "im_id", "obj_id", "score", "R", "t", "time"]
    return pd.DataFrame(rows, columns=columns), truths


def read(folder, rows, truths, **options) -> OrientationTable:
    (folder / "000005").mkdir(exist_ok=True)
    (folder / "000005" / "scene_gt.json").write_text(json.dumps(truths))
    rows.to_csv(folder / "results.csv", index=False)
    return read_orientation_table(folder / "results.csv", **options)


def test_every_estimate_and_instance_is_accounted_for(scene, tmp_path):
    rows, truths = scene
    rng = np.random.default_rng(0)
    rows["score"] = rng.permutation(len(rows)) / 100
    failed, missed, far, twice = np.split(rng.choice(len(rows), 20, replace=False), 4)
    rows.loc[failed, "R"] = ["nan " * 9, "0 " * 9, IDENTITY, "", "1 0 nan 0 1 0 0 0 1"]
    rows.loc[failed, "t"] = ["0 0 700", "0 0 0", "0.0 -0 0", "0 0 700", "0 0 700"]
    rows.loc[far, "t"] = "0 100 700"
    worse = rows.loc[twice].assign(score=-1.0)
    found = read(tmp_path, pd.concat([rows.drop(index=missed), worse]), truths)
    (about,) = found.about()
    assert about.n_pairs == len(rows) - 15
    others = found.detections["1"]
    assert sorted(others.farther) == sorted(rows.loc[far, "score"])
    assert (list(others.surpassed), others.n_missed, others.n_failed) == ([-1] * 5, 15, 5)
    found.save(tmp_path / "t.npz")
    again = OrientationTable.load(tmp_path / "t.npz")
    assert again.about() == [about]
    is_pair = ~rows.index.isin([*failed, *missed, *far])
    for score in rows["score"][::7]:
        n_right = (rows["score"][is_pair] >= score).sum()
        n_all = n_right + (rows.loc[far, "score"] >= score).sum()
        answer = again.recommend([PoseEstimate(np.eye(3), score=score)], 9)
        assert f" {n_right} of {n_all} detection" in answer.holds_where
        assert answer.holds_where in answer.pose_lines("object")


def test_limits_of_distance_and_score_are_the_users(scene, tmp_path):
    rows, truths = scene
    rows["score"] = np.arange(len(rows)) / len(rows)
    rows["t"] = np.where(rows.index % 4 == 0, text(PLACES[0] + [0, 0, 70]), rows["t"])
    assert len(read(tmp_path, rows, truths).score) == 60
    found = read(tmp_path, rows, truths, nearest_mm=80, least_score=0.5)
    assert found.score.tolist() == rows["score"][40:].tolist()
    warned = [
        " ".join(found.recommend([PoseEstimate(np.eye(3), score=score)], 9).warnings)
        for score in (0.49, 0.5)
    ]
    assert "0.49 is below 0.5" in warned[0]
    assert "below" not in warned[1]
    with pytest.raises(UserError, match=r"no score is 2 or more.*`least_score`"):
        read(tmp_path, rows, truths, least_score=2)
    with pytest.raises(UserError, match="`least_score` is not a finite number"):
        read(tmp_path, rows, truths, least_score=np.nan)
    rows.loc[41, "score"] = -1
    assert "1 of 60 pairs have the score -1" in " ".join(read(tmp_path, rows, truths).left_out)
    assert "-1" not in " ".join(read(tmp_path, rows, truths, least_score=0).left_out)


def test_a_failure_is_no_mistake(scene, tmp_path):
    rows, truths = scene
    for wrong, message in (
        ("none", "row 5: R_estimate 'none'"),
        (f"{IDENTITY} 0", "row 5: R_estimate .* is not 9 finite"),
    ):
        with pytest.raises(UserError, match=message):
            read(tmp_path, rows.assign(R=rows["R"].where(rows.index != 3, wrong)), truths)
    rows.loc[:40, "R"] = "nan"
    with pytest.raises(UserError, match=r"41 of 80 estimates are failures"):
        read(tmp_path, rows, truths)
    rows.loc[0, "R"] = rows.loc[79, "R"]
    assert len(read(tmp_path, rows, truths).truth) == 40


def test_a_table_of_pairs_has_failures_and_no_detections(tmp_path):
    rows = orientation_pairs()
    rows.loc[1, "R_estimate"] = ""
    rows.loc[0, "R_estimate"] = IDENTITY  # without a position this may be an estimate
    twice = pd.concat([rows, rows])
    twice.to_csv(tmp_path / "p.csv", index=False)
    found = read_orientation_table(tmp_path / "p.csv")
    about = found.about()[0]
    assert (about.n_pairs, found.detections["0"].n_failed, about.holds_where) == (22, 2, None)
    with pytest.raises(UserError, match="leave `nearest_mm` out"):
        read_orientation_table(tmp_path / "p.csv", nearest_mm=10)
    twice.drop(columns="score").to_csv(tmp_path / "p.csv", index=False)
    with pytest.raises(UserError, match="no column 'score'"):
        read_orientation_table(tmp_path / "p.csv", least_score=0.1)


def test_an_image_without_objects_has_no_partner(scene, tmp_path):
    rows, truths = scene
    truths["3"] = []
    found = read(tmp_path, rows, truths)
    assert len(found.truth) == 78
    assert found.left_out == (
        "2 of 80 estimates are farther than 50 mm from every instance of their object",
    )


def test_truths_may_have_matrices_of_rows(scene, tmp_path):
    rows, truths = scene
    plain = read(tmp_path, rows, truths)
    for entry in truths["3"]:
        entry["cam_R_m2c"] = np.reshape(entry["cam_R_m2c"], (3, 3)).tolist()
    assert np.array_equal(read(tmp_path, rows, truths).truth, plain.truth)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("cam_R_m2c", [float("nan")] * 9, "cam_R_m2c is not 9 finite"),
        ("cam_R_m2c", [1] * 9, "cam_R_m2c is not a rotation"),
        ("cam_t_m2c", [0, 0, 0.7], "cam_t_m2c is 0.7 mm away"),
        ("obj_id", 1.7, "obj_id 1.7 is no integer"),
    ],
)
def test_a_fault_of_the_truth_is_named_in_its_file(scene, tmp_path, key, value, message):
    rows, truths = scene
    truths["3"][1][key] = value
    with pytest.raises(UserError, match=rf"scene_gt\.json, image 3, instance 1: {message}"):
        read(tmp_path, rows, truths)
    # Faults of images without estimates do no harm.
    assert len(read(tmp_path, rows[rows["im_id"] != 3], truths).truth) == 78


def test_a_scene_has_its_number_with_zeros_before_it_or_without(scene, tmp_path):
    found = read(tmp_path, *scene)
    (tmp_path / "000005").rename(tmp_path / "5")
    again = read_orientation_table(tmp_path / "results.csv")
    np.testing.assert_array_equal(again.truth, found.truth)


def test_truths_of_one_of_several_cameras_are_named(scene, tmp_path):
    rows, truths = scene
    read(tmp_path, rows, truths)
    file = tmp_path / "000005" / "scene_gt.json"
    file.rename(file.with_name("scene_gt_cam1.json"))
    for other in ("camera_coco", "camera_info", "info"):
        (file.parent / f"scene_gt_{other}.json").touch()
    with pytest.raises(UserError, match=r"copy .*000005/scene_gt_cam1\.json, .* to scene_gt"):
        read_orientation_table(tmp_path / "results.csv")


def test_a_part_of_an_object_is_none(scene, tmp_path):
    rows, truths = scene
    with pytest.raises(UserError, match=r"results\.csv, row 5: obj_id 1.7 is no integer"):
        read(tmp_path, rows.assign(obj_id=np.where(rows.index == 3, 1.7, 1)), truths)


def test_objects_without_an_entry_are_named(scene, tmp_path):
    rows, truths = scene
    (tmp_path / "m.json").write_text('{"000001": {}, "2": {}}')
    found = read(tmp_path, rows, truths, models_info=tmp_path / "m.json")
    assert "m.json has no entry for object 1 (it has 000001, 2)" in found.left_out[0]
    (tmp_path / "m.json").write_text('{"000001": {}, "1": {}}')
    with pytest.raises(UserError, match=r"m\.json has an object twice"):
        read(tmp_path, rows, truths, models_info=tmp_path / "m.json")


def test_instances_of_a_static_scene_are_told_apart(scene, tmp_path):
    rows, truths = scene
    assert set(read(tmp_path, rows, truths).group) == {"5/0", "5/1"}
    truths["7"] = truths["7"][::-1]
    assert set(read(tmp_path, rows, truths).group) == {"5"}
