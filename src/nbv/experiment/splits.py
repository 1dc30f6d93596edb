"""The folds of cross-validation: which objects train, calibrate and test.

With held-out calibration the roles are train, calibration and test. With cross-fitting they are
part1, part2, … and test: each part is calibrated by an estimator of the other parts, and test
objects are estimated by one that is trained on all parts.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from nbv.errors import UserError
from nbv.files import damaged, read_csv

ROLES = ("train", "calibration", "test")
_PART = re.compile(r"part([1-9]\d*)")


def make_splits(
    object_ids: Sequence[str],
    n_folds: int,
    calibration_fraction: float,
    rng: np.random.Generator,
    crossfit_parts: int | None = None,
) -> pd.DataFrame:
    """Divide objects into folds; each object is tested in exactly one.

    A fold divides its other objects: `calibration_fraction` of them calibrate (at least one, and
    at least one trains) and the others train; or they form parts for cross-fitting. A fraction of
    1 leaves none to train on. The test objects of a fold do not depend on this. `crossfit_parts` is
    the number of parts for cross-fitting, of equal size (to within one object).

    Returns
    -------
    DataFrame
        Columns ``object_id, fold, role``; folds count from 1; within a fold the objects stand in
        the order given.

    Raises
    ------
    UserError
        Where the number of objects is too small for the folds.
    """
    n_objects = len(object_ids)
    if not enough_objects(n_objects, n_folds):
        raise UserError(
            f"n_folds={n_folds}: {n_objects} objects cannot be divided into folds that train, "
            "calibrate and test; use more objects or another number of folds"
        )
    fold_of = np.empty(n_objects, dtype=int)
    fold_of[rng.permutation(n_objects)] = np.arange(n_objects) % n_folds + 1
    rows = []
    for fold in range(1, n_folds + 1):
        roles = np.where(fold_of == fold, "test", "train").astype(object)
        rest = np.flatnonzero(fold_of != fold)
        if crossfit_parts is None:
            most = len(rest) - (calibration_fraction < 1)
            n_calibration = int(np.clip(round(calibration_fraction * len(rest)), 1, most))
            roles[rng.choice(rest, n_calibration, replace=False)] = "calibration"
        elif crossfit_parts > len(rest):
            raise UserError(
                f"crossfit_parts={crossfit_parts}: fold {fold} has {len(rest)} objects to divide"
            )
        else:
            parts = np.arange(len(rest)) % crossfit_parts + 1
            roles[rng.permutation(rest)] = [f"part{part}" for part in parts]
        rows.append(pd.DataFrame({"object_id": object_ids, "fold": fold, "role": roles}))
    return pd.concat(rows, ignore_index=True)


def read_splits(path: str | Path) -> pd.DataFrame:
    """Read `splits/<category>.csv`.

    Raises
    ------
    UserError
        Where the file cannot be read or does not hold splits of `make_splits`: folds from 1, each
        with every object once and in a known role, and each object tested in one fold.
    """
    splits = read_csv(path)
    if list(splits.columns) != ["object_id", "fold", "role"]:
        raise UserError(f"{path}: the columns must be object_id, fold, role")
    others = {str(role) for role in splits["role"]} - set(ROLES)
    if unknown := sorted(role for role in others if not _PART.fullmatch(role)):
        raise UserError(f"{path}: role {unknown[0]!r} is none of {', '.join(ROLES)}, part1, …")
    folds = set(splits["fold"])
    if not folds or folds != set(range(1, len(folds) + 1)):
        raise damaged(path, "the folds must be 1, 2, …")
    if splits.duplicated(["object_id", "fold"]).any():
        raise damaged(path, "an object has more than one role in a fold")
    if len(splits) != len(folds) * splits["object_id"].nunique():
        raise damaged(path, "an object is missing from a fold")
    tested = splits.loc[splits["role"] == "test", "object_id"]
    if tested.duplicated().any() or len(tested) != splits["object_id"].nunique():
        raise damaged(path, "an object is not tested in exactly one fold")
    return splits


def calibration_roles(splits: pd.DataFrame) -> tuple[str, ...]:
    """Return the roles of calibration objects.

    ``calibration`` for held-out calibration, else every part in order. Each is estimated by an
    estimator that has not seen it.
    """
    parts = {role for role in splits["role"] if _PART.fullmatch(role)}
    return tuple(sorted(parts, key=lambda role: int(role[4:]))) or ("calibration",)


def training_roles(splits: pd.DataFrame, without: int | None = None) -> tuple[str, ...]:
    """Return the roles that an estimator trains on.

    `without` is the part that it calibrates; None for the estimator of test objects.
    """
    roles = calibration_roles(splits)
    if roles == ("calibration",):
        return ("train",)
    return tuple(role for role in roles if role != f"part{without}")


def objects_with_role(splits: pd.DataFrame, fold: int, *roles: str) -> list[str]:
    """Return the ids of the objects with some roles in one fold, in the order of the splits.

    Raises
    ------
    UserError
        Where the fold is absent.
    """
    in_fold = splits[splits["fold"] == fold]
    if in_fold.empty:
        raise UserError(f"fold {fold} is not in the splits: they have {splits['fold'].nunique()}")
    return [str(name) for name in in_fold.loc[in_fold["role"].isin(roles), "object_id"]]


def seen_at(object_ids: Sequence[str], place: int, n_places: int, most: int) -> list[str]:
    """Return the objects that are seen at one of several elevations.

    All objects, if that makes no more than `most` sweeps over all elevations; else each object at
    fewer elevations, at least one, distributed evenly.
    """
    each = min(max(most // max(len(object_ids), 1), 1), n_places)
    return [name for i, name in enumerate(object_ids) if (place - i) % n_places < each]


def check_objects(splits: pd.DataFrame, object_ids: Iterable[str]) -> None:
    """Raise UserError with an object that only the images or only the splits have."""
    if different := sorted(set(object_ids) ^ set(splits["object_id"])):
        raise UserError(
            f"object {different[0]!r} is not both in the splits and among the depth images: they "
            "come from different runs; make both again"
        )


def check_role(splits: pd.DataFrame, fold: int, role: str, object_ids: Iterable[str]) -> None:
    """Raise UserError where the objects in a file are not those with a role in a fold.

    No object may train and also calibrate or test, and none may be missing, wherever the file comes
    from. ``calibration`` stands for all `calibration_roles`.
    """
    roles = calibration_roles(splits) if role == "calibration" else (role,)
    read, planned = set(object_ids), set(objects_with_role(splits, fold, *roles))
    if different := sorted(read - planned) or sorted(planned - read):
        mistake = "does not belong to" if different[0] in read else "is missing from"
        raise UserError(
            f"object {different[0]!r} {mistake} the {role} objects of fold {fold}: estimates and "
            "splits come from different runs; make the estimates again"
        )


def enough_objects(n_objects: int, n_folds: int) -> bool:
    """Return whether each fold can test one object and has two more to train and calibrate."""
    largest = -(-n_objects // n_folds)
    return n_objects >= n_folds and n_objects - largest >= 2
