"""The table of an estimator's errors in three dimensions."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.rotation_errors import OrientationErrors, ScoreRatio
from nbv.core.rotations import (
    ASYMMETRIC,
    Array,
    Orientations,
    Symmetry,
    check_orientations,
    inverse,
    spiral,
    viewing_direction,
)
from nbv.errors import UserError, nearest
from nbv.files import CALIBRATE_AGAIN, damaged, stored_table, write_arrays

FLIP_DEG = OrientationErrors.flip_deg
_NAMES = ("object_ids", "object_index", "group", "estimate", "truth", "score", "ray", "symmetries")


@dataclass(frozen=True)
class OrientationTable:
    """Pairs of an estimate and the truth of the same image, and the objects' symmetries.

    Attributes
    ----------
    object_id, group : ndarray (n,) str
        A group is an instance or a scene; "" is unknown.
    estimate, truth : ndarray (n, 3, 3)
        Poses, object to camera.
    score : ndarray (n,), optional
        The estimator's scores; unused where one is NaN.
    straightened : bool
        Whether poses were rotated onto the optical axis (positions known).
    symmetries : mapping
        Entries of BOP's models_info by object; an object without one is asymmetric.

    Examples
    --------
    >>> import nbv, numpy as np
    >>> poses = np.stack([np.eye(3)] * 12)
    >>> cups = np.array(["cup"] * 12)
    >>> nbv.OrientationTable(cups, group=cups, estimate=poses, truth=poses).object_ids
    ['cup']
    """

    object_id: NDArray[np.str_]
    group: NDArray[np.str_]
    estimate: Orientations
    truth: Orientations
    score: Array | None = None
    straightened: bool = False
    symmetries: Mapping[str, Any] = field(default_factory=dict)

    @property
    def object_ids(self) -> list[str]:
        """The objects, in the order of the file."""
        return list(dict.fromkeys(map(str, self.object_id)))

    def symmetry(self, name: str) -> Symmetry:
        """Return an object's symmetry; without an entry it is asymmetric."""
        if name not in self.symmetries:
            return ASYMMETRIC
        try:
            return Symmetry.from_bop(self.symmetries[name])
        except UserError as error:
            raise error.about(f"object {name} of models_info") from error
        except (AttributeError, TypeError, ValueError):
            raise UserError(
                f"object {name} of models_info is not an entry of BOP: give symmetries_discrete "
                "and symmetries_continuous"
            ) from None

    def errors(self, name: str | None = None) -> OrientationErrors:
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
        if self.score is not None and np.isfinite(self.score).all():
            flips = [self._plain(other).is_flip for other in known]
            scores = [self.score[self.object_id == other] for other in known]
            ratio = ScoreRatio.fit(np.concatenate(scores), np.concatenate(flips))
        is_named = self.object_id == name
        return OrientationErrors(
            self.estimate[is_named], self.truth[is_named], self.symmetry(name), ratio=ratio
        )

    def _plain(self, name: str) -> OrientationErrors:
        is_named = self.object_id == name
        return OrientationErrors(self.estimate[is_named], self.truth[is_named], self.symmetry(name))

    def depends_on_view(self, name: str) -> bool:
        """Return whether calibration shows that an object's flips depend on the view."""
        errors, groups = self._plain(name), self.group[self.object_id == name]
        is_known = bool((groups != "").all() and errors.is_flip.any())
        return is_known and errors.depends_on_view(groups)

    def about(self) -> list[dict[str, Any]]:
        """Return what is known of each object, and what is thin or suspicious."""
        return [self._about(name) for name in self.object_ids]

    def _about(self, name: str) -> dict[str, Any]:
        errors, is_named = self._plain(name), self.object_id == name
        n, flips = int(is_named.sum()), errors.is_flip
        seen = viewing_direction(spiral(500))
        cosine = errors.symmetry.direction_cosine(seen, viewing_direction(errors.truth))
        weight = np.exp(errors.concentration * (cosine - 1)).sum(axis=1)
        said = []
        if (known := float((weight > 1).mean())) < 0.5:
            said.append(f"{1 - known:.0%} of the directions are seen by no pair nearby")
        if (n_groups := len(set(self.group[is_named]) - {""})) < 2:
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
        known = {n: self.symmetries[n] for n in names if n in self.symmetries}
        values = (
            np.array(names),
            np.array([index[str(name)] for name in self.object_id]),
            self.group,
            self.estimate,
            self.truth,
            np.full(len(self.estimate), np.nan) if self.score is None else self.score,
            np.array(self.straightened),
            np.array(json.dumps(known, sort_keys=True)),
        )
        write_arrays(path, dict(zip(_NAMES, values, strict=True)))

    @classmethod
    def load(cls, path: str | Path) -> OrientationTable:
        """Read a file of `save`.

        Raises
        ------
        UserError
            If the file cannot be read, or holds what `save` does not write.
        """
        with stored_table(path, _NAMES, "orientations") as stored:
            names, index, group, estimate, truth, score, straightened, texts = (
                stored[n] for n in _NAMES
            )
            n = len(index)
            shapes = [a.shape for a in (index, group, score, estimate, truth)]
            if not n or shapes != [(n,)] * 3 + [(n, 3, 3)] * 2:
                raise damaged(path, "its arrays have different lengths", CALIBRATE_AGAIN)
            if [a.dtype.kind for a in (names, index, group, score)] != ["U", "i", "U", "f"]:
                raise damaged(path, "an array has another type", CALIBRATE_AGAIN)
            if index.min() < 0 or sorted(set(index.tolist())) != list(range(len(names))):
                raise damaged(path, "its objects do not fit its pairs", CALIBRATE_AGAIN)
            estimate, truth = (
                check_orientations(f"{path}: {name}", a)
                for name, a in (("estimate", estimate), ("truth", truth))
            )
            symmetries = json.loads(str(texts))
            if not isinstance(symmetries, dict):
                raise damaged(path, "its symmetries are no entries by object", CALIBRATE_AGAIN)
            table = cls(
                names.astype(str)[index],
                group,
                estimate,
                truth,
                score,
                bool(straightened),
                symmetries,
            )
            for name in table.object_ids:
                table.symmetry(name)
        return table


def _common_axis(errors: OrientationErrors) -> str:
    """Return a hint if nearly all flips are about one axis of the object, else ""."""
    flips = errors.is_flip
    rotations = inverse(errors.estimate[flips]) @ errors.truth[flips]
    angle = errors.error_deg[flips]
    if errors.symmetry is not ASYMMETRIC or len(rotations) < 5:
        return ""
    from scipy.spatial.transform import Rotation

    axes = Rotation.from_matrix(rotations).as_rotvec()
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    axis = np.linalg.eigh(axes.T @ axes)[1][:, -1]
    about = np.abs(axes @ axis) > np.cos(np.radians(10))
    if about.mean() < 0.8:
        return ""
    half = int((about & (angle > 175)).sum())
    x, y, z = np.round(axis * np.sign(axis[np.abs(axis).argmax()]), 2) + 0.0
    return (
        f"{about.sum()} of {len(rotations)} flips are about the axis {x:g} {y:g} {z:g}, {half} of "
        "them by 180°: if the object looks the same then, give its symmetry in models_info"
    )
