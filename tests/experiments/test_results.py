from __future__ import annotations

import pandas as pd
import pytest

import synthetic
from conftest import N_FOLDS
from nbv.errors import UserError
from nbv.experiments import results
from nbv.experiments import two_views as methods
from nbv.files import write_csv


def test_a_unit_has_every_method_fold_object_and_view(evaluations):
    frame = evaluations["mug", 0]
    assert list(frame.columns) == ["method", "fold", *methods.COLUMNS]
    assert len(frame) == 4 * 9 * synthetic.N_VIEWS
    assert list(frame["method"].cat.categories) == list(synthetic.METHODS)
    assert set(frame["object_id"]) == {f"{index:04d}" for index in range(9)}
    assert frame.loc[frame["method"] == "single", "delta_deg"].isna().all()


def test_objects_come_in_the_order_of_the_depth_images(tree):
    assert results.load_object_ids(tree, "mug") == tuple(f"{index:04d}" for index in range(9))
    assert results.load_depth(tree, "mug", 0).shape[:2] == (9, 360)


def test_a_missing_file_is_named(tree):
    with pytest.raises(UserError, match=r"el00/fold4/single\.csv does not exist"):
        results.load_unit(tree, "mug", 0, N_FOLDS + 1, synthetic.METHODS)
    with pytest.raises(UserError, match=r"el45\.npy does not exist"):
        results.load_depth(tree, "mug", 45)
    with pytest.raises(UserError, match=r"spoon\.csv does not exist"):
        results.load_object_ids(tree, "spoon")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column 'object_id'"),
        ("object_id,initial_deg\n", "no column 'initial_estimate_deg'"),
    ],
)
def test_a_broken_file_is_named(tmp_path, text, message):
    path = results.evaluation_path(tmp_path, "mug", 0, 1, "single")
    path.parent.mkdir(parents=True)
    path.write_text(text)
    with pytest.raises(UserError, match=message):
        results.load_unit(tmp_path, "mug", 0, 1, ["single"])


def test_an_empty_table_is_named(tmp_path):
    path = results.evaluation_path(tmp_path, "mug", 0, 1, "single")
    path.parent.mkdir(parents=True)
    path.write_text(",".join(methods.COLUMNS) + "\n")
    with pytest.raises(UserError, match="holds no rows"):
        results.load_unit(tmp_path, "mug", 0, 1, ["single"])


def test_object_ids_are_names_whatever_they_look_like(tree, tmp_path):
    names = ["0007", "NA", "null", "None", "nan", "1e3", "inf", "-", "true"]
    path = results.evaluation_path(tree, "mug", 0, 1, "single")
    frame = pd.read_csv(path, dtype={"object_id": str})
    short = frame.groupby("object_id").head(len(names)).head(len(names))
    target = results.evaluation_path(tmp_path, "mug", 0, 1, "single")
    write_csv(target, short.assign(object_id=names))
    unit = results.load_unit(tmp_path, "mug", 0, 1, ["single"])
    assert unit["object_id"].tolist() == names
    assert unit["delta_deg"].isna().all()
    splits = pd.DataFrame({"object_id": names, "fold": 1, "role": "test"})
    write_csv(results.splits_path(tmp_path, "mug"), splits)
    assert results.load_object_ids(tmp_path, "mug") == tuple(names)
