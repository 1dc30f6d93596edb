from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nbv.errors import UserError
from nbv.experiment import splits as folds
from nbv.files import write_csv


def split(n: int, n_folds: int = 5, seed: int = 0, parts: int | None = None):
    names = [f"{i:03d}" for i in range(n)]
    return folds.make_splits(names, n_folds, 0.2, np.random.default_rng(seed), parts)


@settings(max_examples=40, deadline=None)
@given(st.integers(5, 140), st.integers(2, 5), st.integers(0, 9))
def test_every_object_is_tested_once_and_has_one_role_in_each_fold(n, n_folds, seed):
    frame = split(n, n_folds, seed)
    tested = frame[frame["role"] == "test"]
    assert sorted(tested["object_id"]) == sorted(frame["object_id"].unique())
    assert not frame.duplicated(["object_id", "fold"]).any()
    for fold in range(1, n_folds + 1):
        for role in folds.ROLES:
            assert folds.objects_with_role(frame, fold, role)


@settings(max_examples=40, deadline=None)
@given(st.integers(12, 60), st.integers(2, 5), st.integers(2, 4), st.integers(0, 9))
def test_cross_fitting_calibrates_everyone_by_an_estimator_of_the_others(n, n_folds, parts, seed):
    frame = split(n, n_folds, seed, parts)
    held_out = split(n, n_folds, seed)
    roles = folds.calibration_roles(frame)
    assert roles == tuple(f"part{part}" for part in range(1, parts + 1))
    for fold in range(1, n_folds + 1):
        test = folds.objects_with_role(frame, fold, "test")
        assert test == folds.objects_with_role(held_out, fold, "test")
        everyone = folds.objects_with_role(frame, fold, *folds.training_roles(frame))
        assert not set(test) & set(everyone)
        calibrated = []
        sizes = set()
        for part in range(1, parts + 1):
            own = set(folds.objects_with_role(frame, fold, roles[part - 1]))
            others = folds.objects_with_role(frame, fold, *folds.training_roles(frame, part))
            assert own.isdisjoint(others)
            assert own | set(others) == set(everyone)
            calibrated += own
            sizes.add(len(own))
        assert sorted(calibrated) == everyone
        assert len(test) + len(everyone) == n
        assert max(sizes) - min(sizes) <= 1


def test_held_out_calibration_trains_one_estimator_on_the_rest():
    frame = split(20)
    assert folds.calibration_roles(frame) == ("calibration",)
    assert folds.training_roles(frame) == ("train",)


def test_every_part_is_a_calibration_object():
    frame = split(12, 3, parts=2)
    everyone = folds.objects_with_role(frame, 1, "part1", "part2")
    folds.check_role(frame, 1, "calibration", everyone)
    with pytest.raises(UserError, match="does not belong to the test objects"):
        folds.check_role(frame, 1, "test", everyone)


def test_more_parts_than_objects():
    with pytest.raises(UserError, match="crossfit_parts=9: fold 1 has 4 objects"):
        split(6, 3, parts=9)


def test_the_papers_numbers():
    frame = split(125)
    counts = frame.groupby(["fold", "role"]).size().unstack()
    assert (counts["test"] == 25).all()
    assert (counts["calibration"] == 20).all()
    assert (counts["train"] == 80).all()


@pytest.mark.parametrize("parts", [None, 3])
def test_splits_come_back_and_the_order_of_their_rows_means_nothing(tmp_path, parts):
    whole = split(12, 3, parts=parts)
    shuffled = whole.sample(frac=1.0, random_state=1)
    write_csv(tmp_path / "s.csv", shuffled)
    read = folds.read_splits(tmp_path / "s.csv")
    for fold in (1, 2, 3):
        for role in {*whole["role"]}:
            found = folds.objects_with_role(read, fold, role)
            assert sorted(found) == folds.objects_with_role(whole, fold, role)


def without_a_row(frame):
    return frame.drop(index=4)


def without_an_objects_test(frame):
    frame.loc[frame["role"].eq("test").idxmax(), "role"] = "train"
    return frame


def with_a_second_test(frame):
    tested = frame.loc[frame["fold"].eq(1) & frame["role"].eq("test"), "object_id"].iloc[0]
    frame.loc[frame["fold"].eq(2) & frame["object_id"].eq(tested), "role"] = "test"
    return frame


def with_a_row_twice(frame):
    return frame.sort_index(key=lambda rows: rows % 35).iloc[[*range(len(frame)), 0]]


def without_a_fold(frame):
    return frame[frame["fold"] != 2]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (without_a_row, "missing from a fold"),
        (without_an_objects_test, "tested in exactly one fold"),
        (with_a_second_test, "tested in exactly one fold"),
        (with_a_row_twice, "more than one role in a fold"),
        (without_a_fold, "folds must be 1, 2"),
    ],
)
def test_splits_that_are_not_whole_are_refused(tmp_path, damage, message):
    write_csv(tmp_path / "s.csv", damage(split(12, 3)))
    with pytest.raises(UserError, match=message):
        folds.read_splits(tmp_path / "s.csv")


def test_images_of_other_objects_than_the_splits_are_refused():
    frame = split(10)
    names = sorted(set(frame["object_id"]))
    folds.check_objects(frame, names[::-1])
    for others in (names[1:], [*names, "stranger"]):
        with pytest.raises(UserError, match=r"'(000|stranger)' is not both in"):
            folds.check_objects(frame, others)


def test_reading_objects_of_another_role_is_refused():
    frame = split(10)
    train = folds.objects_with_role(frame, 1, "train")
    test = folds.objects_with_role(frame, 1, "test")
    with pytest.raises(UserError, match=f"{train[0]!r} does not belong to the test"):
        folds.check_role(frame, 1, "test", [*test, train[0]])
    with pytest.raises(UserError, match=f"{test[0]!r} is missing from the test"):
        folds.check_role(frame, 1, "test", test[1:])


def test_too_few_objects():
    with pytest.raises(UserError, match="n_folds=5: 4 objects"):
        split(4)


def test_an_unknown_role_is_refused(tmp_path):
    for role in ("part0", "trian"):
        (tmp_path / "x.csv").write_text(f"object_id,fold,role\na,1,{role}\nb,1,part2\n")
        with pytest.raises(UserError, match=rf"role '{role}' is none of"):
            folds.read_splits(tmp_path / "x.csv")


@given(n_objects=st.integers(4, 30), seed=st.integers(0, 1000))
def test_a_calibration_fraction_of_one_leaves_none_to_train_on(n_objects, seed):
    names = [f"o{place}" for place in range(n_objects)]
    found = folds.make_splits(names, 2, 1.0, np.random.default_rng(seed))
    trained = folds.make_splits(names, 2, 0.5, np.random.default_rng(seed))
    assert set(found["role"]) == {"calibration", "test"}
    assert found[found["role"] == "test"].equals(trained[trained["role"] == "test"])


@given(n=st.integers(1, 50), n_places=st.integers(1, 6), most=st.integers(1, 200))
def test_sweeps_are_shared_out_evenly_and_every_object_has_one(n, n_places, most):
    names = [str(i) for i in range(n)]
    seen = [folds.seen_at(names, place, n_places, most) for place in range(n_places)]
    sweeps = Counter(name for of_place in seen for name in of_place)
    assert set(sweeps) == set(names)
    assert len(set(sweeps.values())) == 1
    each = sweeps["0"]
    assert each == 1 or each * n <= most
    assert each == n_places or (each + 1) * n > most
    counts = [len(of_place) for of_place in seen]
    assert max(counts) - min(counts) <= each
