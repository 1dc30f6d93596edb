"""The table of an estimator's errors in three dimensions."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from nbv.core.orientations.errors import FEWEST_GROUPS, OrientationErrors, ScoreRatio, shrinkage
from nbv.core.orientations.group import (
    ASYMMETRIC,
    Array,
    Orientations,
    Symmetry,
    spiral,
    viewing_direction,
)
from nbv.errors import UserError, by_number, nearest
from nbv.files import CALIBRATE_AGAIN, damaged, stored_table, write_arrays
from nbv.numbers import as_orientations
from nbv.poses import AnyPose
from nbv.tables.detections import Detections
from nbv.tables.next_camera import (
    MOST_VIEWS,
    CameraRecommendation,
    PoseEstimate,
    known_scores,
    nearest_twin,
    recommend_camera,
    scores_of_all,
)

FLIP_DEG = OrientationErrors.flip_deg
_NAMES = ("object_ids", "object_index", "group", "estimate", "truth", "score", "ray", "symmetries")


@dataclass(frozen=True)
class ObjectSummary:
    """The calibration pairs of one object.

    Groups are instances or scenes; a flip errs by more than `FLIP_DEG`. `directions_covered` is the
    share of the viewing directions that have pairs nearby. `depends_on_view` says whether
    calibration shows that flips do, and `holds_where` for which share of detections it holds.
    """

    object_id: str
    n_pairs: int
    n_groups: int
    n_flips: int
    mean_error_deg: float
    directions_covered: float
    depends_on_view: bool
    warnings: tuple[str, ...]
    holds_where: str | None = None


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
        The estimator's scores; unused where one is NaN, or -1, BOP's for none.
    straightened : bool
        Whether poses were rotated onto the optical axis (positions known).
    symmetries : mapping
        Entries of BOP's models_info by object; an object without one is asymmetric.
    left_out : tuple of str
        Which pairs of the file are not in the table, and why.
    detections : mapping
        What became of each object's detections, as far as the file tells.
    bounds_deg : mapping
        Bounds of the error of an answer, of `nbv.forecast`; empty if they are unknown.

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
    left_out: tuple[str, ...] = ()
    detections: Mapping[str, Detections] = field(default_factory=dict)
    bounds_deg: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

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

    def name_of(self, object_id: str | None) -> str:
        """Return the name of an object, which may be None if the table has only one.

        Raises
        ------
        UserError
            For an unknown object, or None where there are several.
        """
        known = self.object_ids
        if object_id is None and len(known) > 1:
            choices = ", ".join(sorted(known, key=by_number))
            raise UserError(
                f"the table has {len(known)} objects; give `object_id`, one of {choices}"
            )
        name = known[0] if object_id is None else str(object_id)
        if name not in known:
            raise UserError(f"object {name} is not in the table: {nearest(name, known)}")
        return name

    def errors(self, object_id: str | None = None) -> OrientationErrors:
        """Return the errors on an object; its name and errors are those of `name_of`."""
        return self._errors[self.name_of(object_id)]

    @cached_property
    def _errors(self) -> dict[str, OrientationErrors]:
        rows = {name: self.object_id == name for name in self.object_ids}
        has_groups = bool((self.group != "").all())
        errors = {
            name: OrientationErrors(
                self.estimate[k],
                self.truth[k],
                self.symmetry(name),
                group=self.group[k] if has_groups else None,
            )
            for name, k in rows.items()
        }
        flips = np.concatenate([each.is_flip for each in errors.values()])
        share, ratio = (flips.sum() + 0.5) / (len(flips) + 1), None
        if (known := scores_of_all(self.score)) is not None:
            scores = np.concatenate([known[k] for k in rows.values()])
            ratio = ScoreRatio.fit(scores, flips)
        strength = shrinkage(list(errors.values()))
        return {
            name: replace(each, share=share, pseudo_observations=strength, ratio=ratio)
            for name, each in errors.items()
        }

    def where(self, rows: NDArray[np.bool_]) -> OrientationTable:
        """Return the table of some of the pairs (n,)."""
        names = ("object_id", "group", "estimate", "truth")
        score = None if self.score is None else self.score[rows]
        parts = {name: getattr(self, name)[rows] for name in names}
        return replace(self, score=score, bounds_deg={}, **parts)

    def recommend(
        self,
        estimates: Sequence[PoseEstimate],
        candidates: Sequence[AnyPose] | int,
        *,
        object_id: str | None = None,
        camera_pose: AnyPose | None = None,
        max_travel_deg: float = 180.0,
        previous: PoseEstimate | None = None,
    ) -> CameraRecommendation:
        """Rank camera poses by the expected error of the pose that two views, or more, give.

        Parameters
        ----------
        estimates : sequence of PoseEstimate
            Estimates of views in succession if each has its camera pose, else hypotheses of one
            view.
        candidates : sequence of poses, or int
            Camera poses that can be reached, in a form of `nbv.poses.as_given`; or how many even
            ones on a sphere about the object.
        object_id : str, optional
            Needed where the table has several objects.
        camera_pose : (4, 4) or another form, optional
            Pose of the only view: optical frame in the base frame, metres. By default the base
            frame is the camera's.
        max_travel_deg : float
            Largest angle to the last view, about the object.
        previous : PoseEstimate, optional
            An earlier pose. Of the poses in which a symmetric object looks the same, the answer is
            the nearest to it. Its camera pose is needed where the last view has one; without both,
            the camera stood still.

        Returns
        -------
        CameraRecommendation

        Raises
        ------
        UserError
            Where estimates, poses and table do not fit each other, or no candidate is admissible.

        Examples
        --------
        >>> import nbv, numpy as np
        >>> poses = np.stack([np.eye(3)] * 12)
        >>> cups = np.array(["cup"] * 12)
        >>> table = nbv.OrientationTable(cups, group=cups, estimate=poses, truth=poses)
        >>> answer = table.recommend([nbv.PoseEstimate(np.eye(3))], 50)
        >>> answer.depends_on_view, answer.probability_within["30"] > 0.9
        (False, True)
        """
        name = self.name_of(object_id)
        given: Any = estimates
        if not (isinstance(given, Sequence) and all(isinstance(e, PoseEstimate) for e in given)):
            raise UserError("`estimates`: give a list of PoseEstimate")
        if isinstance(candidates, float):
            raise UserError(f"`candidates`={candidates:g}: give camera poses, or an integer")
        estimates, doubts = known_scores(estimates, scores_of_all(self.score))
        answer = recommend_camera(
            self.errors(name),
            estimates,
            candidates,
            straightened=self.straightened,
            camera_pose=camera_pose,
            max_travel_deg=max_travel_deg,
        )
        detections = self.detections.get(name, Detections())
        score = min((each.score for each in estimates if each.score is not None), default=None)
        last, pose = estimates[-1], cast(Any, camera_pose)
        last = last if pose is None else replace(last, camera_pose=pose)
        of_poses = dict.fromkeys(text for each in estimates for text in each.warnings)
        return replace(
            answer,
            rotation=nearest_twin(answer.rotation, self.symmetry(name), last.camera_pose, previous),
            holds_where=detections.holds_where(score),
            bounds_deg=self._bounds_deg(name, estimates, answer.decision.verdict),
            warnings=(*answer.warnings, *doubts, *of_poses, *detections.warnings(score)),
            frame_id=last.frame_id if last.camera_pose is None else last.base_frame_id,
            camera_frame_id=last.frame_id,
        )

    def _bounds_deg(
        self, name: str, estimates: Sequence[PoseEstimate], verdict: str | None
    ) -> dict[str, Mapping[str, float]]:
        """Return the bounds that hold for an answer: one that came about as in a forecast."""
        n, first = len(estimates), estimates[0]
        is_scored = first.score is not None or self.errors(name).ratio is None
        if not is_scored or (n > 1 and first.camera_pose is None):
            return {}
        is_last = n == MOST_VIEWS or verdict != "one more view"
        holds = {"one view": n == 1, "stopped": n <= MOST_VIEWS and is_last}
        return {which: self.bounds_deg[which] for which in self.bounds_deg if holds[which]}

    def about(self) -> list[ObjectSummary]:
        """Return a summary of each object."""
        return [self._about(name) for name in self.object_ids]

    def _about(self, name: str) -> ObjectSummary:
        from nbv.tables.flips import describe_large_errors  # which imports scipy

        errors = self.errors(name)
        directions = viewing_direction(spiral(500))
        cosine = errors.symmetry.direction_cosine(directions, viewing_direction(errors.truth))
        weight = np.exp(errors.concentration * (cosine - 1)).sum(axis=1)
        warnings = []
        if (covered := float((weight > 1).mean())) < 0.5:
            warnings.append(f"{1 - covered:.0%} of the directions are seen by no pair nearby")
        if errors.group is None:
            warnings.append(
                "pairs have no scene_id and instance: each counts as if it were of another "
                "instance, and neighbouring images make calibration too sure"
            )
        elif len(set(zip(self.object_id, self.group, strict=True))) < FEWEST_GROUPS:
            warnings.append(
                f"pairs are of fewer than {FEWEST_GROUPS} instances or scenes in all: how much "
                "flips depend on the view is assumed, not measured"
            )
        if not errors.is_flip.any():
            warnings.append(f"no estimate errs by more than {FLIP_DEG:g}°: one view is enough")
        elif hint := describe_large_errors(errors):
            warnings.append(hint)
        return ObjectSummary(
            object_id=name,
            n_pairs=len(errors.estimate),
            n_groups=len(set(self.group[self.object_id == name]) - {""}),
            n_flips=int(errors.is_flip.sum()),
            mean_error_deg=float(errors.error_deg.mean()),
            directions_covered=covered,
            depends_on_view=errors.depends_on_view,
            warnings=tuple(warnings),
            holds_where=self.detections.get(name, Detections()).holds_where(),
        )

    def save(self, path: str | Path) -> None:
        """Write the pairs as ``.npz``."""
        names, index = self.object_ids, {name: i for i, name in enumerate(self.object_ids)}
        known = {n: self.symmetries[n] for n in names if n in self.symmetries}
        others = {n: asdict(self.detections[n]) for n in names if n in self.detections}
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
        added = {"detections": others, "bounds": self.bounds_deg}
        texts = {name: np.array(json.dumps(each, sort_keys=True)) for name, each in added.items()}
        write_arrays(path, dict(zip(_NAMES, values, strict=True)) | texts)

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
                as_orientations(a, f"{path}: {name}")
                for name, a in (("estimate", estimate), ("truth", truth))
            )
            symmetries = json.loads(str(texts))
            if not isinstance(symmetries, dict):
                raise damaged(path, "its symmetries are no entries by object", CALIBRATE_AGAIN)
            others = json.loads(str(stored.get("detections", "{}")))
            table = cls(
                names.astype(str)[index],
                group,
                estimate,
                truth,
                score,
                bool(straightened),
                symmetries,
                detections={name: Detections(**entry) for name, entry in others.items()},
                bounds_deg=dict(json.loads(str(stored.get("bounds", "{}")))),
            )
            for name in table.object_ids:
                table.symmetry(name)
        return table
