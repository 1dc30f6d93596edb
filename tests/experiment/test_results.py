import numpy as np
import pandas as pd
import pytest

import synthetic
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.estimates import Estimates
from nbv.core.circle.evidence import gather_evidence
from nbv.core.circle.lookup import build_lookup
from nbv.errors import UserError
from nbv.experiment import results
from nbv.experiment.results import COLUMNS, evaluate_method
from nbv.files import write_csv

MUG = ("mug", 0)


def load(path):
    return results.load_evaluations({(*MUG, 1, "single"): path})[MUG]


def test_a_unit_has_every_method_fold_object_and_view(evaluations):
    frame = evaluations[MUG]
    assert list(frame.columns) == ["method", "fold", *COLUMNS]
    assert len(frame) == 4 * 9 * synthetic.N_VIEWS
    assert list(frame["method"].cat.categories) == list(synthetic.METHODS)
    assert set(frame["object_id"]) == {f"{index:04d}" for index in range(9)}
    assert frame.loc[frame["method"] == "single", "delta_deg"].isna().all()


def test_what_a_file_is_about_is_told_and_not_read_from_its_path(tree, tmp_path):
    path = synthetic.evaluation_files(tree, [MUG], 1)[*MUG, 1, "single"]
    copy = tmp_path / "anything.csv"
    copy.write_bytes(path.read_bytes())
    units = results.load_evaluations({("spoon", 45, 7, "other"): copy, (*MUG, 1, "single"): path})
    assert list(units) == [("spoon", 45), MUG]
    assert set(units["spoon", 45]["fold"]) == {7}
    assert set(units["spoon", 45]["method"]) == {"other"}
    pd.testing.assert_frame_equal(
        units["spoon", 45][list(COLUMNS)], units[MUG][list(COLUMNS)], check_exact=True
    )


def test_units_and_methods_keep_the_order_of_the_files(tree):
    methods = synthetic.METHODS[::-1]
    files = synthetic.evaluation_files(tree, [("chair", 0), MUG], synthetic.N_FOLDS, methods)
    units = results.load_evaluations(files)
    assert list(units) == [("chair", 0), MUG]
    assert list(units[MUG]["method"].cat.categories) == list(methods)
    assert list(units[MUG]["method"].unique()) == list(methods)


def test_objects_come_in_the_order_of_the_splits(tree):
    ids = results.load_object_ids(synthetic.split_files(tree, [MUG])["mug"])
    assert ids == tuple(f"{index:04d}" for index in range(9))


def test_a_missing_file_is_named(tree):
    with pytest.raises(UserError, match=r"el00/fold4/single\.csv does not exist"):
        results.load_evaluations(synthetic.evaluation_files(tree, [MUG], synthetic.N_FOLDS + 1))
    with pytest.raises(UserError, match=r"spoon\.csv does not exist"):
        results.load_object_ids(tree / "splits/spoon.csv")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "cannot be read"),
        ("object_id,initial_deg\n", "no column 'initial_estimate_deg'"),
        (",".join(COLUMNS) + "\n", "holds no rows"),
    ],
)
def test_a_broken_file_is_named(tmp_path, text, message):
    path = tmp_path / "single.csv"
    path.write_text(text)
    with pytest.raises(UserError, match=rf"single\.csv: {message}"):
        load(path)


def test_object_ids_are_names_whatever_they_look_like(tree, tmp_path):
    names = ["0007", "NA", "null", "None", "nan", "1e3", "inf", "-", "true"]
    path = synthetic.evaluation_files(tree, [MUG], 1)[*MUG, 1, "single"]
    sweep = pd.read_csv(path).head(synthetic.N_VIEWS)
    write_csv(tmp_path / "single.csv", pd.concat([sweep.assign(object_id=name) for name in names]))
    unit = load(tmp_path / "single.csv")
    assert unit["object_id"].drop_duplicates().tolist() == names
    assert unit["delta_deg"].isna().all()
    splits = [pd.DataFrame({"object_id": names, "fold": fold, "role": "train"}) for fold in (1, 2)]
    splits[0].loc[::2, "role"] = splits[1].loc[1::2, "role"] = "test"
    write_csv(tmp_path / "mug.csv", pd.concat(splits))
    assert results.load_object_ids(tmp_path / "mug.csv") == tuple(names)


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("error_deg", None),
        ("error_deg", 180.5),
        ("delta_deg", None),
        ("initial_deg", 17.0),
        ("object_id", "other"),
    ],
)
def test_a_value_that_cannot_be_is_refused(tree, tmp_path, column, value):
    path = synthetic.evaluation_files(tree, [MUG], 1)[*MUG, 1, "opposite"]
    frame = pd.read_csv(path, dtype={"object_id": str})
    frame.loc[500, column] = value
    write_csv(tmp_path / "single.csv", frame)
    with pytest.raises(UserError, match=r"single\.csv: .*; delete the file and run"):
        load(tmp_path / "single.csv")


def test_methods_that_tested_other_objects_are_refused(tree, tmp_path):
    files = synthetic.evaluation_files(tree, [MUG], 1)
    frame = pd.read_csv(files[*MUG, 1, "opposite"], dtype={"object_id": str})
    fewer = frame[frame["object_id"] != frame["object_id"].iloc[0]]
    write_csv(tmp_path / "opposite.csv", fewer)
    files[*MUG, 1, "opposite"] = tmp_path / "opposite.csv"
    with pytest.raises(UserError, match=r"mug at 0°, fold 1: object '0000' is not evaluated by"):
        results.load_evaluations(files)


def test_an_object_tested_in_two_folds_is_refused(tree):
    files = synthetic.evaluation_files(tree, [MUG], 2)
    for method in synthetic.METHODS:
        files[*MUG, 2, method] = files[*MUG, 1, method]
    with pytest.raises(UserError, match="'0000' is tested in more than one fold"):
        results.load_evaluations(files)


RNG = np.random.default_rng(0)
SETTINGS = {"pose_likelihood": "given_estimate", "spread": "entropy"}


def estimates(n_objects: int = 4, n_views: int = 36, seed: int = 0) -> Estimates:
    rng = np.random.default_rng(seed)
    truth = np.arange(n_views) * 360.0 / n_views
    answer = (truth + rng.normal(0, 12, (n_objects, n_views))) % 360
    names = tuple(f"{index:03d}" for index in range(n_objects))
    return Estimates(names, np.round(answer, 4))


def method(policy: str) -> dict[str, str]:
    return {"policy": policy, "fusion": "average"}


def test_one_view_alone_is_the_estimate_itself():
    test = estimates()
    rows = evaluate_method(method("none"), test)
    assert tuple(rows.columns) == COLUMNS
    assert rows["delta_deg"].isna().all()
    assert rows["next_estimate_deg"].isna().all()
    np.testing.assert_allclose(rows["pose_estimate_deg"], test.estimate_deg.ravel())


def test_rows_follow_objects_and_then_views():
    test = estimates()
    rows = evaluate_method(method("opposite"), test, RNG)
    assert rows["object_id"].tolist() == [name for name in test.object_ids for _ in range(36)]
    assert rows["initial_deg"].tolist() == [*range(0, 360, 10)] * 4


def test_opposite_makes_the_same_error_from_either_side():
    rows = evaluate_method(method("opposite"), estimates(), RNG)
    error = rows["error_deg"].to_numpy().reshape(4, 36)
    np.testing.assert_allclose(error, np.roll(error, 18, axis=1), atol=2e-4)


def test_random_views_are_all_others_and_equally_likely():
    test = estimates(n_objects=200)
    rows = evaluate_method(method("random"), test, np.random.default_rng(1))
    counts = rows["delta_deg"].value_counts()
    assert sorted(counts.index) == list(range(10, 360, 10))
    expected = len(rows) / 35
    chi_squared = ((counts - expected) ** 2 / expected).sum()
    assert chi_squared < 66  # the 99.9th percentile for 34 degrees of freedom


def test_random_views_are_the_generators():
    test = estimates()
    first, again = (
        evaluate_method(method("random"), test, np.random.default_rng(7)) for _ in range(2)
    )
    assert first.equals(again)


def test_recommended_rotations_come_from_the_table_and_errors_from_what_is_seen():
    test = estimates()
    lookup = build_lookup(
        gather_evidence(
            estimates(seed=5).estimate_deg,
            SETTINGS,
            bandwidth_deg=15,
            pseudo_observations=5,
            n_bins=36,
        ),
        "pose_ambiguity",
    )
    rows = evaluate_method(method("pose_ambiguity"), test, lookup=lookup)
    for row in rows.itertuples():
        one = test.object_ids.index(row.object_id)
        delta = lookup.recommended_delta_deg[round(row.initial_estimate_deg / 10) % 36]
        assert row.delta_deg == delta
        second = test.estimate_deg[one, (row.initial_deg + delta) // 10 % 36]
        assert row.next_estimate_deg == second
        total = np.exp(1j * np.radians(row.initial_estimate_deg))
        total += np.exp(1j * np.radians(second - delta))
        pose = np.degrees(np.angle(total))
        assert circular_distance_deg(row.pose_estimate_deg, pose) < 1e-3
        assert row.error_deg == pytest.approx(
            float(circular_distance_deg(pose, row.initial_deg)), abs=1e-3
        )
