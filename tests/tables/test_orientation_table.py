"""From an estimator's files in three dimensions to ranked camera poses."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from examples.bop_example import HALF_TURN, write_example
from scipy.spatial.transform import Rotation

from nbv.cli import main
from nbv.errors import UserError
from nbv.poses import read_pose, read_poses
from nbv.tables.bop import read_orientation_table
from nbv.tables.next_camera import PoseEstimate, as_view, read_views
from nbv.tables.orientation_table import OrientationTable
from rotation_pairs import orientation_pairs

SHARED = Path(__file__).parents[3] / "shared" / "data" / "estimates"
HIDDEN = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])


@pytest.fixture(scope="module")
def example(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("bop")
    write_example(folder)
    return folder


@pytest.fixture(scope="module")
def pairs(example) -> OrientationTable:
    return read_orientation_table(example / "results.csv")


def table(path: Path, edit=lambda rows: rows) -> Path:
    """Pairs of two objects in a table, edited."""
    edit(orientation_pairs()).to_csv(path, index=False)
    return path


# Reading


def test_results_find_the_nearest_instance_once(example, tmp_path):
    rows = pd.read_csv(example / "results.csv", dtype=str)
    better, worse, far = rows[:1].copy(), rows[:1].copy(), rows[:1].copy()
    quarter = "0 -1 0 1 0 0 0 0 1"
    better["score"], better["R"], better["t"] = "2", quarter, "10 -20 740"
    worse["score"], far["t"] = "-1", "10 -20 760"
    far["score"] = "3"
    path = tmp_path / "results.csv"
    pd.concat([worse, rows, better, far]).to_csv(path, index=False)
    found = read_orientation_table(path, example)
    assert len(found.estimate) == len(rows)
    assert [text.split(" are ")[0] for text in found.left_out] == [
        "2 of 163 estimates",
        "1 of 163 estimates",
    ]
    assert (found.score == 2).sum() == 1
    assert np.allclose(found.score.max(), 2)


def test_truth_may_be_a_csv_file_in_the_form_of_results(example, tmp_path, pairs):
    rows = []
    for file in sorted(example.glob("*/scene_gt.json")):
        for image, (entry,) in json.loads(file.read_text()).items():
            r, t = (" ".join(map(str, entry[f"cam_{k}_m2c"])) for k in "Rt")
            rows.append((int(file.parent.name), image, entry["obj_id"], 1, r, t, -1))
    columns = ["scene_id", "im_id", "obj_id", "score", "R", "t", "time"]
    pd.DataFrame(rows, columns=columns).to_csv(tmp_path / "truth.csv", index=False)
    found = read_orientation_table(example / "results.csv", tmp_path / "truth.csv")
    assert not found.left_out
    assert np.allclose(found.truth, pairs.truth)
    assert np.allclose(found.estimate, pairs.estimate)


def test_a_table_is_read_as_it_was_written(pairs, tmp_path):
    pairs.save(tmp_path / "t.npz")
    again = OrientationTable.load(tmp_path / "t.npz")
    assert again.about() == pairs.about()
    again.save(tmp_path / "again.npz")
    assert (tmp_path / "t.npz").read_bytes() == (tmp_path / "again.npz").read_bytes()


def test_scores_are_used_where_every_pair_has_one(pairs, tmp_path):
    given = pairs.score.copy()
    given[3] = np.nan
    view = PoseEstimate(HIDDEN, np.array([10.0, -20.0, 700.0]), 0.4)
    without = replace(pairs, score=None)
    expected = without.recommend([view], 20)
    assert any("no scores" in warning for warning in expected.warnings)
    without.save(tmp_path / "t.npz")
    for table in (OrientationTable.load(tmp_path / "t.npz"), replace(pairs, score=given)):
        answer = table.recommend([view], 20)
        assert answer.expected_error_deg == expected.expected_error_deg
        assert answer.warnings == expected.warnings
    assert pairs.recommend([view], 20).expected_error_deg > expected.expected_error_deg


def test_what_is_thin_or_suspicious_is_said(example, pairs, tmp_path):
    (about,) = pairs.about()
    assert about.n_pairs == 160
    assert about.directions_covered > 0.95
    assert about.depends_on_view
    assert "are 180° about z" in " ".join(about.warnings)  # a half turn without an entry
    half_turn = np.eye(4)
    half_turn[:3, :3] = HALF_TURN
    entry = {"1": {"symmetries_discrete": [half_turn.ravel().tolist()]}}
    (tmp_path / "m.json").write_text(json.dumps(entry))
    known = read_orientation_table(example / "results.csv", None, tmp_path / "m.json")
    (about,) = known.about()
    assert about.n_flips == 0
    assert not about.depends_on_view
    assert "180°" not in " ".join(about.warnings)


def first(column, change):
    """Change the first row of a column."""

    def edit(rows):
        rows[column] = rows[column].astype(object)
        rows.loc[0, column] = change(rows.loc[0, column])
        return rows

    return edit


def matrix(change):
    def edit(text):
        array = np.array(text.split(), dtype=float).reshape(3, 3)
        return " ".join(map(str, change(array).ravel()))

    return edit


def transposed(rows):
    rows["R_estimate"] = rows["R_estimate"].map(matrix(lambda r: r.T))
    return rows


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (first("R_true", matrix(lambda r: r * [1, 1, -1])), "row 2: R_true is a reflection"),
        (first("R_estimate", matrix(lambda r: 2 * r)), "row 2: R_estimate is not a rotation"),
        (first("R_true", lambda text: text[:20]), "row 2: R_true"),
        (first("t_true_mm", lambda _: "0 0 0.7"), "row 2: t_true_mm is 0.7 mm away; give mm"),
        (first("t_true_mm", lambda _: "0 0 -700"), "object to camera, not camera to object"),
        (first("score", lambda _: "high"), "row 2: score 'high' is not a finite number"),
        (transposed, "transposed"),
        (lambda rows: rows[rows["instance"] == 0], "row 2: 6 pairs"),
        (lambda rows: rows.drop(columns="R_estimate"), "no column 'R_estimate'"),
    ],
)
def test_a_mistake_is_one_line_with_its_row(tmp_path, capsys, edit, message):
    path = table(tmp_path / "p.csv", edit)
    assert main(["calibrate", str(path), "--output", str(tmp_path / "t.npz")]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1
    assert not (tmp_path / "t.npz").exists()


def test_estimates_of_other_images_are_named(example, tmp_path):
    rows = pd.read_csv(example / "results.csv", dtype=str)
    rows.loc[3, "im_id"] = "77"
    rows.to_csv(tmp_path / "r.csv", index=False)
    with pytest.raises(UserError, match=r"row 5: scene 1 has no image 77.*different images"):
        read_orientation_table(tmp_path / "r.csv", example)


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("models_info.json", '{"1": [1]}', "object 1 of models_info is not an entry"),
        ("models_info.json", '{"1": {"symmetries_discrete": [[1, 2]]}}', "16 numbers"),
        ("000001/scene_gt.json", '{"0": 3}', "image 0: an instance lacks"),
        ("000001/scene_gt.json", "[]", "scene_gt.json"),
    ],
)
def test_files_that_are_not_bops_are_named(tmp_path, file, text, message):
    write_example(tmp_path)
    (tmp_path / file).write_text(text)
    with pytest.raises(UserError, match=message):
        read_orientation_table(
            tmp_path / "results.csv", None, tmp_path / "models_info.json"
        ).about()


# The next camera pose


def test_a_hidden_mark_is_looked_for(pairs):
    view = PoseEstimate(HIDDEN @ HALF_TURN, np.array([10.0, -20.0, 700.0]), 0.4)
    answer = pairs.recommend([view], 50)
    costs = [move.expected_error_deg for move in answer.moves]
    order = [(round(move.expected_error_deg, 9), move.travel_deg) for move in answer.moves]
    assert order == sorted(order)
    assert costs[0] < 0.7 * answer.expected_error_deg
    # In the first camera the mark is at +x or -x of the object.
    x = np.array([view.rotation.T @ move.direction for move in answer.moves])[:, 0]
    assert x[0] > 0.5
    assert np.mean(np.array(costs)[x > 0]) < np.mean(np.array(costs)[x < 0])
    assert answer.moves[0].probability_within["30"] > answer.probability_within["30"]
    target = answer.moves[0].target_camera_pose
    place = np.linalg.inv(target) @ [0.01, -0.02, 0.7, 1]
    assert np.allclose(place[:2], 0, atol=1e-9)


def test_turning_the_base_frame_changes_no_rank(pairs):
    poses = [m.target_camera_pose for m in _answer(pairs).moves]
    base = np.eye(4)
    base[:3, :3] = Rotation.from_euler("xyz", [20, 50, 70], degrees=True).as_matrix()
    base[:3, 3] = [1, 2, 3]
    wanted = pairs.recommend([VIEW], poses)
    moved = pairs.recommend([VIEW], [base @ pose for pose in poses], camera_pose=base)
    assert [m.index for m in wanted.moves] == [m.index for m in moved.moves]
    for a, b in zip(wanted.moves, moved.moves, strict=True):
        assert a.expected_error_deg == pytest.approx(b.expected_error_deg, abs=1e-4)
        assert a.travel_m == pytest.approx(b.travel_m)
    assert np.allclose(moved.rotation, VIEW.rotation)


VIEW = PoseEstimate(HIDDEN @ HALF_TURN, np.array([10.0, -20.0, 700.0]), 0.4)


def _answer(pairs, **options):
    return pairs.recommend([VIEW], 20, **options)


def test_a_second_view_that_sees_the_mark_decides(pairs):
    target = _answer(pairs).moves[0].target_camera_pose
    relative = target[:3, :3].T
    seen = PoseEstimate(relative @ HIDDEN, np.array([0.0, 0.0, 700.0]), 0.9, target)
    both = [PoseEstimate(VIEW.rotation, VIEW.position_mm, 0.4, np.eye(4)), seen]
    fused = pairs.recommend(both, 20)
    assert pairs.symmetry("1").distance_deg(fused.rotation, seen.rotation) < 5
    assert fused.expected_error_deg < 0.5 * _answer(pairs).expected_error_deg


def test_two_hypotheses_share_the_belief(pairs):
    other = PoseEstimate(HIDDEN, VIEW.position_mm, 0.4)
    both = pairs.recommend([VIEW, other], 20)
    assert both.probability_within["30"] == pytest.approx(0.5, abs=0.1)
    surer = pairs.recommend([VIEW, PoseEstimate(HIDDEN, VIEW.position_mm, 0.95)], 20)
    assert np.allclose(surer.rotation, HIDDEN, atol=1e-6)
    assert surer.probability_within["30"] > both.probability_within["30"]


def test_a_small_travel_keeps_near_candidates(pairs):
    answer = _answer(pairs, max_travel_deg=60)
    assert min(move.travel_deg for move in answer.moves) >= 15
    assert max(move.travel_deg for move in answer.moves) <= 60
    with pytest.raises(UserError, match="none of 1 candidate"):
        pairs.recommend([VIEW], [np.eye(4)])


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (np.diag([1.0, -1, -1, 1]), "178° off the optical axis"),
        ([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -700], [0, 0, 0, 1]], "not millimetres"),
        (np.diag([1.0, 1, -1, 1]), "a reflection"),
    ],
)
def test_a_wrong_candidate_is_named(pairs, pose, message):
    with pytest.raises(UserError, match=f"^candidate 0.*{message}"):
        pairs.recommend([VIEW], [np.asarray(pose)])


def test_a_printed_rotation_has_no_negative_zero(pairs):
    answer = pairs.recommend([PoseEstimate(np.eye(3))], 8)
    rotation = np.array([[1.0, -1e-9, 0.0], [0.0, 1.0, -0.0], [-2e-5, 0.0, 1.0]])
    printed = replace(answer, rotation=rotation).pose_lines("object")[1:4]
    assert [line.split() for line in printed] == [
        ["1.00000", "0.00000", "0.00000"],
        ["0.00000", "1.00000", "0.00000"],
        ["-0.00002", "0.00000", "1.00000"],
    ]


def test_where_flips_do_not_depend_on_the_view_candidates_are_ranked_by_travel():
    rng = np.random.default_rng(0)
    truth = Rotation.random(200, rng=rng).as_matrix()
    flips = np.where(rng.random((200, 1, 1)) < 0.2, HALF_TURN, np.eye(3))
    group, names = np.repeat(np.arange(20).astype(str), 10), np.repeat(["a", "b"], 100)
    pairs = OrientationTable(names, group, truth @ flips, truth)
    answer = pairs.recommend([PoseEstimate(np.eye(3))], 50, object_id="a")
    assert not answer.depends_on_view
    no_dependence, no_scores = answer.warnings
    assert "no dependence" in no_dependence
    assert "a stop rests on little" in no_scores
    travel = [move.travel_deg for move in answer.moves]
    far = [deg for deg in travel if deg >= 60]
    near = travel[len(far) :]
    assert far == sorted(far)
    assert near == sorted(near, reverse=True)
    # One further view cannot say which of two is flipped.
    assert answer.decision.verdict == "no view helps"
    assert answer.moves[0].target_camera_pose is None
    with pytest.raises(UserError, match="2 objects; give `object_id`"):
        pairs.recommend([PoseEstimate(np.eye(3))], 20)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"t": [0, 0, 1]}, "has no R"),
        ({"R": np.eye(3).tolist(), "t": [0, 0, 0.7]}, "give mm, not metres"),
        ({"R": np.eye(3).tolist(), "t": [0, 0, -700]}, "not camera to object"),
        ({"R": np.diag([1, 1, -1]).tolist()}, "reflection"),
        ({"R": [1, 0, 0]}, "9 finite numbers"),
        ({"R": np.eye(3).tolist(), "T": [0, 0, 700]}, "has 'T'"),
    ],
)
def test_a_wrong_estimate_is_named(given, message):
    with pytest.raises(UserError, match=message):
        as_view(given, "e.json, estimate 0")


def test_the_commands_of_the_page(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_example("example")
    assert main(["calibrate", "example/results.csv", "--output", "table.npz"]) == 0
    options = ["next", "table.npz", "--estimate", "example/estimate.json"]
    options += ["--sphere", "50", "--until", "5"]
    assert main(options) == 0
    out = capsys.readouterr().out
    assert "one more view" in out
    assert "seen from the direction " in out
    rows = re.findall(r"^ +(-?\d\.\d{5}) +(-?\d\.\d{5}) +(-?\d\.\d{5})$", out, re.M)
    assert main([*options, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["enough"] is False
    assert np.allclose(np.array(rows, dtype=float), answer["rotation"], atol=1e-5)
    assert answer["move"]["expected_error_deg"] < answer["expected_error_deg"]
    assert answer["decision"]["verdict"] == "one more view"
    probable = [*options[:5], "50", "--until-probability", "0.01", "--within"]
    assert [main([*probable, within]) for within in ("20", "0")] == [0, 2]
    out, err = capsys.readouterr()
    assert out.startswith("decision   enough: ")
    assert "--within=0: give degrees" in err
    poses = np.array([m["target_camera_pose"] for m in [answer["move"], *answer["alternatives"]]])
    np.save("poses.npy", poses)
    assert len(read_poses("poses.npy")) == len(poses)
    options = ["next", "table.npz", "--estimate", *map(str, np.eye(3).ravel())]
    assert main([*options, "--candidates", "poses.npy"]) == 0
    assert main(options) == 2
    assert "--candidates and --sphere: give one of them" in capsys.readouterr().err


def test_the_next_pose_is_read_back_in_every_form(tmp_path, monkeypatch, capsys):
    """The commands of the page for a folder of poses, and the other forms."""
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[2] / "docs/your-estimator.md").read_text("utf-8")
    page = re.sub(r"\\\n|  +#.*", "", page)
    made, calibrate, command = re.findall(
        r"^    ((?:python|nbv) .*(?:ob_in|FOLDER).*)$", page, re.M
    )
    write_example(made.split()[-1])
    assert main(calibrate.split()[1:]) == 0
    *options, _, target = command.split()[1:]
    options.remove("--format"), options.remove("pose-stamped")
    capsys.readouterr()
    assert main([*options, "--json", "--format", "4x4"]) == 0
    wanted = json.loads(capsys.readouterr().out)["target_camera_pose"]
    for form, order in (
        ("pose-stamped", None),
        ("4x4", None),
        ("quaternion", "xyzw"),
        ("quaternion", "wxyz"),
    ):
        more = [] if order is None else ["--quaternion", order]
        assert main([*options, "--format", form, *more]) == 0
        out = capsys.readouterr().out
        assert out.startswith("# decision   one more view")
        Path(target).write_text(out)
        assert read_pose(target, order).camera_pose == pytest.approx(np.array(wanted), abs=1e-8)


def test_the_keys_of_an_azimuth_are_a_subset(tmp_path, monkeypatch, capsys, pairs):
    monkeypatch.chdir(tmp_path)
    pairs.save("table.npz")
    options = ["--json", "--estimate"]
    np.save("r.npy", np.eye(3))
    assert np.array_equal(read_views("r.npy")[0].rotation, np.eye(3))
    assert main(["next", "table.npz", *options, "r.npy", "--sphere", "9"]) == 0
    answer = json.loads(capsys.readouterr().out)
    azimuths = "object_id,azimuth_deg,estimate_deg\n" + "".join(f"a,{k},{k}\n" for k in range(360))
    Path("pairs.csv").write_text(azimuths)
    assert main(["calibrate", "pairs.csv", "--output", "circle.npz"]) == 0
    capsys.readouterr()
    assert main(["next", "circle.npz", *options, "10"]) == 0
    one_axis = json.loads(capsys.readouterr().out)
    assert set(one_axis) - {"criterion", "cost_unit"} <= set(answer)
    assert set(one_axis["move"]) - {"cost"} <= set(answer["move"])
    assert main(["next", "circle.npz", *options, "r.npy", "--sphere", "9"]) == 2
    assert "circle.npz holds azimuths" in capsys.readouterr().err
    with pytest.raises(UserError, match="holds no orientations"):
        OrientationTable.load("circle.npz")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("score", np.full(160, "a")),
        ("estimate", np.zeros((160, 3, 3))),
        ("truth", np.ones((3, 3))),
        ("object_index", np.full(160, 7)),
        ("symmetries", np.array("[1]")),
        ("detections", np.array("[1]")),
        ("bounds", np.array("[1]")),
        ("group", np.zeros(160)),
    ],
)
def test_a_damaged_table_is_refused(pairs, tmp_path, name, value):
    pairs.save(tmp_path / "t.npz")
    with np.load(tmp_path / "t.npz") as stored:
        arrays = dict(stored)
    np.savez(tmp_path / "t.npz", **(arrays | {name: value}))
    with pytest.raises(UserError, match=r"t\.npz"):
        OrientationTable.load(tmp_path / "t.npz")


@pytest.mark.skipif(not SHARED.is_dir(), reason="../shared/data/estimates is absent")
def test_a_published_estimators_files_give_its_table():
    models = SHARED / "bop" / "models_info.json"
    whole = read_orientation_table(SHARED / "tless_megapose.csv", None, models)
    scenes = read_orientation_table(SHARED / "bop" / "megapose_tless-test.csv", None, models)
    about = {summary.object_id: summary for summary in whole.about()}
    assert round(about["23"].mean_error_deg, 1) == 44.7
    assert about["23"].n_flips == 49
    # The same pairs, as far as these scenes go.
    texts = {r.tobytes() for r in np.round(whole.truth, 3) + 0.0}
    found = [r.tobytes() in texts for r in np.round(scenes.truth, 3) + 0.0]
    assert np.mean(found) > 0.8
