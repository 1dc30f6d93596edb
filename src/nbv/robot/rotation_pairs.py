"""Calibration pairs in three dimensions, and the table of an estimator's errors that they make."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.rotation_errors import RotationErrors, ScoreRatio
from nbv.core.rotations import (
    ASYMMETRIC,
    Array,
    Rotations,
    Symmetry,
    along_ray,
    check_rotations,
    inverse,
    spiral,
    viewing_direction,
)
from nbv.errors import UserError, nearest
from nbv.files import (
    CALIBRATE_AGAIN,
    calibrated_file,
    damaged,
    read_arrays,
    read_given_json,
    read_rows,
    readable,
    write_arrays,
)
from nbv.labels import counted

BOP_COLUMNS = ("scene_id", "im_id", "obj_id", "score", "R", "t")
TABLE_COLUMNS = ("object_id", "R_true", "R_estimate")

NEAREST_MM = 50.0
"""An estimate farther from every instance of its object is of none of them."""

FEWEST_PAIRS = 12
"""An object with fewer says too little about where it flips."""

LEAST_MM = 10.0
"""No camera sees an object from nearer: such distances are metres."""

FLIP_DEG = RotationErrors.flip_deg
_NAMES = ("object_ids", "object_index", "group", "estimate", "truth", "score", "ray", "symmetries")


@dataclass(frozen=True)
class RotationPairs:
    """Pairs of an estimate and the truth of the same image, and the objects' symmetries.

    Attributes
    ----------
    object_id, group : ndarray (n,) str
        A group is an instance or a scene; "" is unknown.
    estimate, truth : ndarray (n, 3, 3)
        Poses, as a camera sees them that looks straight at the object if `ray`.
    score : ndarray (n,)
        NaN without scores.
    ray : bool
        Whether positions were known.
    models : mapping
        Entries of BOP's models_info by object.

    Examples
    --------
    >>> import nbv, numpy as np
    >>> n, pose = 12, np.stack([np.eye(3)] * 12)
    >>> text = np.array(["cup"] * n)
    >>> nbv.RotationPairs(text, text, pose, pose, np.full(n, np.nan), False, {}).object_ids
    ['cup']
    """

    object_id: NDArray[np.str_]
    group: NDArray[np.str_]
    estimate: Rotations
    truth: Rotations
    score: Array
    ray: bool
    models: Mapping[str, Any]

    @property
    def object_ids(self) -> list[str]:
        """The objects, in the order of the file."""
        return list(dict.fromkeys(map(str, self.object_id)))

    def symmetry(self, name: str) -> Symmetry:
        """Return an object's symmetry; without an entry it is asymmetric."""
        if name not in self.models:
            return ASYMMETRIC
        try:
            return Symmetry.from_bop(self.models[name])
        except UserError as error:
            raise error.about(f"object {name} of models_info") from error
        except (AttributeError, TypeError, ValueError):
            raise UserError(
                f"object {name} of models_info is not an entry of BOP: give symmetries_discrete "
                "and symmetries_continuous"
            ) from None

    def errors(self, name: str | None = None) -> RotationErrors:
        """Return the errors on an object, which may be unnamed if it is the only one.

        Raises
        ------
        UserError
            For an unknown object, or none where there are several.
        """
        known = self.object_ids
        if name is None and len(known) > 1:
            raise UserError(f"the table has {len(known)} objects; name one of {', '.join(known)}")
        name = known[0] if name is None else name
        if name not in known:
            raise UserError(f"object {name} is not in the table: {nearest(name, known)}")
        ratio = None
        if np.isfinite(self.score).all():
            flips = [self._plain(other).is_flip for other in known]
            scores = [self.score[self.object_id == other] for other in known]
            ratio = ScoreRatio.fit(np.concatenate(scores), np.concatenate(flips))
        own = self.object_id == name
        return RotationErrors(self.estimate[own], self.truth[own], self.symmetry(name), ratio=ratio)

    def _plain(self, name: str) -> RotationErrors:
        own = self.object_id == name
        return RotationErrors(self.estimate[own], self.truth[own], self.symmetry(name))

    def depends_on_view(self, name: str) -> bool:
        """Return whether calibration shows that an object's flips depend on the view."""
        errors, groups = self._plain(name), self.group[self.object_id == name]
        is_known = bool((groups != "").all() and errors.is_flip.any())
        return is_known and errors.depends_on_view(groups)

    def about(self) -> list[dict[str, Any]]:
        """Return what is known of each object, and what is thin or suspicious."""
        return [self._about(name) for name in self.object_ids]

    def _about(self, name: str) -> dict[str, Any]:
        errors, own = self._plain(name), self.object_id == name
        n, flips = int(own.sum()), errors.is_flip
        seen = viewing_direction(spiral(500))
        cosine = errors.symmetry.direction_cosine(seen, viewing_direction(errors.truth))
        weight = np.exp(errors.concentration * (cosine - 1)).sum(axis=1)
        said = []
        if (known := float((weight > 1).mean())) < 0.5:
            said.append(f"{1 - known:.0%} of the directions are seen by no pair nearby")
        if (n_groups := len(set(self.group[own]) - {""})) < 2:
            said.append("pairs are of one instance or scene: dependence on the view is unknown")
        if not flips.any():
            said.append(f"no estimate errs by more than {FLIP_DEG:g}°: one view is enough")
        elif hint := _common_axis(errors):
            said.append(hint)
        return {
            "object_id": name,
            "n_pairs": n,
            "n_groups": n_groups,
            "n_flips": int(flips.sum()),
            "mean_error_deg": float(errors.error_deg.mean()),
            "directions_covered": known,
            "depends_on_view": self.depends_on_view(name),
            "warnings": said,
        }

    def save(self, path: str | Path) -> None:
        """Write the pairs as ``.npz``."""
        names, index = self.object_ids, {name: i for i, name in enumerate(self.object_ids)}
        texts = json.dumps({n: self.models[n] for n in names if n in self.models}, sort_keys=True)
        values = (
            np.array(names),
            np.array([index[str(name)] for name in self.object_id]),
            self.group,
            self.estimate,
            self.truth,
            self.score,
            np.array(self.ray),
            np.array(texts),
        )
        write_arrays(path, dict(zip(_NAMES, values, strict=True)))

    @classmethod
    def load(cls, path: str | Path) -> RotationPairs:
        """Read a file of `save`.

        Raises
        ------
        UserError
            If the file cannot be read, or holds what `save` does not write.
        """
        stored = read_arrays(calibrated_file(path), (), CALIBRATE_AGAIN)
        if any(name not in stored for name in _NAMES):
            raise UserError(
                f"{path} holds no rotations: make it with nbv calibrate, from 3-D pairs"
            )
        with readable(path, CALIBRATE_AGAIN):
            names, index, group, estimate, truth, score, ray, texts = (stored[n] for n in _NAMES)
            n = len(index)
            shapes = [a.shape for a in (index, group, score, estimate, truth)]
            if not n or shapes != [(n,)] * 3 + [(n, 3, 3)] * 2:
                raise damaged(path, "its arrays have different lengths", CALIBRATE_AGAIN)
            if [a.dtype.kind for a in (names, index, group, score)] != ["U", "i", "U", "f"]:
                raise damaged(path, "an array has another type", CALIBRATE_AGAIN)
            if index.min() < 0 or sorted(set(index.tolist())) != list(range(len(names))):
                raise damaged(path, "its objects do not fit its pairs", CALIBRATE_AGAIN)
            estimate, truth = (
                check_rotations(f"{path}: {name}", a)
                for name, a in (("estimate", estimate), ("truth", truth))
            )
            models = json.loads(str(texts))
            if not isinstance(models, dict):
                raise damaged(path, "its symmetries are no entries by object", CALIBRATE_AGAIN)
            pairs = cls(names.astype(str)[index], group, estimate, truth, score, bool(ray), models)
            for name in pairs.object_ids:
                pairs.symmetry(name)
        return pairs


def is_rotation_pairs(path: Path) -> bool:
    """Return whether the head of a file names rotations: BOP's results, or a table of pairs."""
    try:
        columns = set(read_rows(path, ()))
    except UserError:
        return False  # whose reader says what is wrong
    return {"obj_id", "R"} <= columns or "R_true" in columns


def read_rotation_pairs(
    path: str | Path,
    truth: str | Path | None = None,
    models_info: str | Path | None = None,
    objects: Sequence[str] = (),
) -> tuple[RotationPairs, tuple[str, ...]]:
    """Read pairs, and what was left out of them.

    Parameters
    ----------
    path : path
        BOP's results, or a table with `TABLE_COLUMNS` and perhaps score, t_true_mm, scene_id and
        instance. Rotations are object to camera, row by row; positions are in millimetres.
    truth : path, optional
        Of BOP's results: a folder with ``<scene>/scene_gt.json``, or a CSV file in the form of
        results. By default the folder of the results.
    models_info : path, optional
        BOP's symmetries; without an entry an object is asymmetric.
    objects : sequence of str
        Objects to keep; all by default.

    Raises
    ------
    UserError
        Names the file and the row.
    """
    path = Path(path)
    rows = read_rows(path, ())
    said: list[str] = []
    if "obj_id" in rows:
        rows, said = _matched(path, Path(truth) if truth else path.parent)
    elif truth is not None:
        raise UserError(f"{path} has its own truths (R_true); leave `ground_truth` out")
    models = {} if models_info is None else _read_entries(Path(models_info))
    for name in TABLE_COLUMNS:
        if name not in rows:
            raise UserError(f"{path}: no column {name!r}; it needs {', '.join(TABLE_COLUMNS)}")
    known = list(dict.fromkeys(rows["object_id"]))
    for name in objects:
        if name not in known:
            raise UserError(f"{path}: no object {name}: {nearest(name, known)}")
    if objects:
        rows = rows[rows["object_id"].isin(objects)]
    counts = rows["object_id"].value_counts()
    for name in dict.fromkeys(rows["object_id"]):
        if counts[name] < FEWEST_PAIRS:
            few = (
                f"object {name}, row {rows.index[rows['object_id'] == name][0] + 2}: "
                f"{counted(int(counts[name]), 'pair')} of an estimate and the truth; "
                f"{FEWEST_PAIRS} are needed"
            )
            if name in objects or counts.max() < FEWEST_PAIRS:
                raise UserError(f"{path}: {few}")
            said.append(f"{few}: left out")
    rows = rows[rows["object_id"].map(counts) >= FEWEST_PAIRS]
    both = [_rotations(path, rows, name) for name in TABLE_COLUMNS[1:]]
    _check_way_round(path, rows, *both)
    ray = "t_true_mm" in rows
    if ray:
        turn = along_ray(_positions(path, rows, "t_true_mm"))
        both = [turn @ poses for poses in both]
    score = np.full(len(rows), np.nan)
    if "score" in rows:
        score = _numbers(path, rows, "score", 1)[:, 0]
    keys = [name for name in ("scene_id", "instance") if name in rows]
    group = rows[keys].agg("/".join, axis=1).to_numpy(dtype=str) if keys else [""] * len(rows)
    names = rows["object_id"].to_numpy(dtype=str)
    pairs = RotationPairs(names, np.array(group), both[1], both[0], score, ray, models)
    return pairs, tuple(said)


def _matched(path: Path, truth: Path) -> tuple[pd.DataFrame, list[str]]:
    """Return BOP's results with the truths of their instances."""
    rows = read_rows(path, BOP_COLUMNS)
    keys = ["scene_id", "im_id", "obj_id"]
    for name in keys:
        rows[name] = _numbers(path, rows, name, 1)[:, 0].astype(int).astype(str)
    position, score = _positions(path, rows, "t"), _numbers(path, rows, "score", 1)[:, 0]
    known = _read_truths(truth, set(rows["scene_id"]))
    positions = _positions(truth, known, "t")
    by_key = {k: list(v) for k, v in known.groupby(keys).indices.items()}
    images = set(zip(known["scene_id"], known["im_id"], strict=True))
    scenes = set(known["scene_id"])
    best: dict[int, int] = {}
    n_elsewhere = 0
    for i, key in enumerate(zip(*(rows[k] for k in keys), strict=True)):
        if key[0] not in scenes:
            n_elsewhere += 1
            continue
        if key[:2] not in images:
            raise UserError(
                f"{path}, row {i + 2}: scene {key[0]} has no image {key[1]} in {truth}: are "
                "estimates and truths of different images?"
            )
        if (own := by_key.get(key)) is None:
            continue
        apart = np.linalg.norm(positions[own] - position[i], axis=1)
        j = own[int(apart.argmin())]
        if apart.min() <= NEAREST_MM and (j not in best or score[i] > score[best[j]]):
            best[j] = i
    if not best:
        raise UserError(
            f"{path}: none of {len(rows)} estimates is within {NEAREST_MM:g} mm of an instance of "
            f"its object in {truth}: are both of the same images, and object to camera in mm?"
        )
    truths, own = list(best), list(best.values())
    matched = rows.iloc[own].assign(
        object_id=rows["obj_id"].iloc[own],
        R_estimate=rows["R"].iloc[own],
        R_true=known["R"].to_numpy()[truths],
        t_true_mm=known["t"].to_numpy()[truths],
    )
    n_free = len(rows) - len(own) - n_elsewhere
    said = [f"{n_free} of {len(rows)} estimates found no partner"] if n_free else []
    if n_elsewhere:
        said.append(f"{n_elsewhere} of {len(rows)} estimates are of scenes without truth")
    return matched.sort_index(), said


def _read_truths(truth: Path, scenes: set[str]) -> pd.DataFrame:
    keys = ["scene_id", "im_id", "obj_id"]
    if truth.suffix.lower() == ".csv":
        known = read_rows(truth, (*keys, "R", "t"))
        for name in keys:
            known[name] = _numbers(truth, known, name, 1)[:, 0].astype(int).astype(str)
        return known
    found = []
    for scene in sorted(scenes):
        file = truth / f"{int(scene):06d}" / "scene_gt.json"
        if not file.is_file():
            continue
        for image, entries in _read_entries(file).items():
            try:
                for entry in entries:
                    r, t = (" ".join(map(str, entry[f"cam_{k}_m2c"])) for k in "Rt")
                    found.append((scene, str(int(image)), str(int(entry["obj_id"])), r, t))
            except (KeyError, TypeError, ValueError):
                raise UserError(
                    f"{file}, image {image}: an instance lacks obj_id, cam_R_m2c or cam_t_m2c"
                ) from None
    if not found:
        raise UserError(f"{truth} has no <scene>/scene_gt.json of a scene of the estimates")
    return pd.DataFrame(found, columns=[*keys, "R", "t"])


def _read_entries(path: Path) -> dict[str, Any]:
    given = read_given_json(path, remedy := "give a JSON file of BOP")
    if not isinstance(given, dict):
        raise damaged(path, "it is not a JSON object", remedy)
    return given


def _numbers(path: Path, rows: pd.DataFrame, name: str, n: int) -> Array:
    numbers = np.empty((len(rows), n))
    for i, (row, text) in enumerate(zip(rows.index, rows[name], strict=True)):
        try:
            numbers[i] = np.array(text.split(), dtype=np.float64).reshape(n)
            if not np.isfinite(numbers[i]).all():
                raise ValueError
        except ValueError:
            raise UserError(
                f"{path}, row {row + 2}: {name} {text!r} is not {counted(n, 'finite number')}"
            ) from None
    return numbers


def _rotations(path: Path, rows: pd.DataFrame, name: str) -> Rotations:
    matrices = _numbers(path, rows, name, 9).reshape(-1, 3, 3)
    try:
        return check_rotations(name, matrices)
    except UserError:
        for row, matrix in zip(rows.index, matrices, strict=True):
            check_rotations(f"{path}, row {row + 2}: {name}", matrix)
        raise


def _positions(path: Path, rows: pd.DataFrame, name: str) -> Array:
    positions = _numbers(path, rows, name, 3)
    for row, position in zip(rows.index, positions, strict=True):
        check_position(f"{path}, row {row + 2}: {name}", position)
    return positions


def check_position(name: str, position_mm: Array) -> None:
    """Raise UserError where an object at a position (3,) in the camera cannot be seen."""
    if position_mm[2] <= 0:
        raise UserError(
            f"{name} is behind the camera (z = {position_mm[2]:g}): give the pose object to "
            "camera, not camera to object"
        )
    if (away := float(np.linalg.norm(position_mm))) < LEAST_MM:
        raise UserError(f"{name} is {away:g} mm away; give mm, not metres")


def _check_way_round(path: Path, rows: pd.DataFrame, truth: Rotations, estimate: Rotations) -> None:
    """Refuse estimates that would be right the other way round."""
    error, turned = (
        np.median(ASYMMETRIC.distance_deg(poses, truth)) for poses in (estimate, inverse(estimate))
    )
    if error > FLIP_DEG and turned < FLIP_DEG / 2:
        raise UserError(
            f"{path}, row {rows.index[0] + 2}: R_estimate or R_true is transposed, camera to "
            "object: give both object to camera, row by row"
        )


def _common_axis(errors: RotationErrors) -> str:
    """Return a hint if nearly all flips turn about one axis of the object, else ""."""
    flips = errors.is_flip
    turns = inverse(errors.estimate[flips]) @ errors.truth[flips]
    angle = errors.error_deg[flips]
    if errors.symmetry is not ASYMMETRIC or len(turns) < 5:
        return ""
    from scipy.spatial.transform import Rotation

    axes = Rotation.from_matrix(turns).as_rotvec()
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    axis = np.linalg.eigh(axes.T @ axes)[1][:, -1]
    about = np.abs(axes @ axis) > np.cos(np.radians(10))
    if about.mean() < 0.8:
        return ""
    half = int((about & (angle > 175)).sum())
    x, y, z = np.round(axis * np.sign(axis[np.abs(axis).argmax()]), 2) + 0.0
    return (
        f"{about.sum()} of {len(turns)} flips turn about the axis {x:g} {y:g} {z:g}, {half} of "
        "them by 180°: if the object looks the same then, give its symmetry in models_info"
    )
