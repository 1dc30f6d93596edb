"""The next camera pose of an object in three dimensions, from a table of an estimator's errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.choice.answers import Answer, RankedMove
from nbv.choice.next_view import as_chances
from nbv.choice.rotations import MIN_SEPARATION_DEG, as_limit_deg
from nbv.core.alike.compare import WITHIN_DEG
from nbv.core.orientations.belief import AGREE_DEG, OrientationBelief, belief, hypotheses_belief
from nbv.core.orientations.criteria import bayes_error, optimism_deg, view_angle_deg
from nbv.core.orientations.errors import OrientationErrors
from nbv.core.orientations.group import Array, Orientations, Symmetry, along_ray, inverse
from nbv.errors import UserError
from nbv.labels import counted, matrix_lines
from nbv.numbers import FARTHEST_M, as_finite, as_position
from nbv.poses import AnyPose, Pose, Source, as_given, as_pose, read_entries
from nbv.tables.camera_poses import IN_CAMERA, contradictions, not_seeing

INDEPENDENT_DEG = 60.0
"""Angle between views from which their errors are about independent (first half of T-LESS)."""

HELPFUL = 0.9
"""Share of the expected error now: promises fall by up to a tenth where flips are such that no view
helps (tools/promised_errors.py)."""

MOST_VIEWS = 4
"""Views of an object after which a walk ends, whatever the decision."""

MOST_ON_SPHERE = 10_000

BLOCK = 1000
"""Candidates that are compared at once, for memory."""

NO_SCORE = -1.0
"""BOP's score of an estimator that has none."""

NO_DEPENDENCE = (
    "calibration shows no dependence of this object's flips on the view: candidates are ranked by "
    f"travel, those {INDEPENDENT_DEG:g}° or more from every view first"
)

NO_SCORES = (
    "no scores, of the estimate or of calibration: flips are hard to tell, and a stop rests on "
    "little"
)


@dataclass(frozen=True)
class PoseEstimate:
    """The estimate of an object's pose in one image.

    Attributes
    ----------
    rotation : ndarray (3, 3)
        Object to camera. It is made of any pose that `nbv.poses.as_given` takes, such as a 4 × 4
        matrix, which has the position too.
    position_mm : ndarray (3,) or None
        The object in the camera.
    score : float or None
        Higher is better.
    camera_pose : ndarray (4, 4) or None
        Camera to base, metres. Estimates without it are hypotheses of the same image.
    frame_id, base_frame_id : str or None
        The frames that ROS messages named, of the estimate and of the camera's pose.
    warnings : tuple of str
        What to say of the pose as it was given.

    Raises
    ------
    UserError
        If a pose is none, the camera cannot see the object there, or the score is no finite number.

    Examples
    --------
    >>> import nbv, numpy as np
    >>> nbv.PoseEstimate(np.eye(3), score=0.4).position_mm is None
    True
    >>> pose = [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0.7], [0, 0, 0, 1]]  # metres
    >>> nbv.PoseEstimate(np.array(pose)).position_mm.tolist()
    [100.0, 0.0, 700.0]
    """

    rotation: Orientations
    position_mm: Array | None = None
    score: float | None = None
    camera_pose: Pose | None = None
    frame_id: str | None = None
    base_frame_id: str | None = None
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Convert poses of every form."""
        pose, position, camera = as_given(self.rotation, "pose"), self.position_mm, None
        if self.camera_pose is not None:
            camera = as_given(self.camera_pose, "camera pose")
        for name, value in {
            "rotation": pose.rotation,
            "score": None if self.score is None else as_finite(self.score, "score", 1).item(),
            "position_mm": pose.position_mm if position is None else as_position(position, "t"),
            "camera_pose": camera and camera.camera_pose,
            "frame_id": self.frame_id or pose.frame_id,
            "base_frame_id": self.base_frame_id or (camera and camera.frame_id),
            "warnings": (*self.warnings, *pose.warnings),
        }.items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True, kw_only=True)
class CameraMove(RankedMove):
    """A candidate camera pose, with its number from 0.

    `travel_deg` is the angle to the last view, about the object, and `travel_m` the distance if it
    is known. `direction` (3,) is that from which the object is seen, in the frame of the camera
    poses. `target_camera_pose` is None where the object's position is unknown.
    """

    index: int
    travel_m: float | None
    direction: Array

    @property
    def name(self) -> str:
        """The move in a list."""
        return f"candidate {self.index}"

    @property
    def extent(self) -> str:
        """How far the move goes, and from which direction the object is seen then."""
        metres = "" if self.travel_m is None else f", {self.travel_m:.2f} m"
        x, y, z = self.direction.round(2) + 0.0
        return f"{super().extent}{metres}; seen from the direction {x:.2f} {y:.2f} {z:.2f}"


@dataclass(frozen=True, kw_only=True)
class CameraRecommendation(Answer[CameraMove]):
    """The pose (3, 3) in the last camera, its belief in the first one, and candidates.

    `holds_where` says for which share of detections calibration holds, if that is known. Targets
    and directions are `in_base`, or else in the only camera, whose pose is not known.
    `camera_frame_id` is the frame that a ROS message named for the estimate.
    `bounds_deg` are those bounds of `nbv.forecast` that are of such answers.
    """

    rotation: Orientations
    depends_on_view: bool
    pose_belief: OrientationBelief
    holds_where: str | None = None
    bounds_deg: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    in_base: bool = True
    camera_frame_id: str | None = None

    STOP_PROBABILITY = 0.97
    STOP_WITHIN_DEG = AGREE_DEG

    def probability(self, within_deg: float) -> float:
        """Return the probability that the pose errs by at most so many degrees."""
        if not 0.0 < within_deg <= 180.0:
            raise UserError(f"`within_deg`={within_deg:g}: give degrees, above 0 and at most 180")
        return self.pose_belief.probability_within(within_deg)

    @property
    def frame(self) -> str:
        """The frame of the targets."""
        return super().frame if self.in_base else "frame of the present camera"

    def pose_lines(self, seen: str) -> list[str]:
        """Return the pose of the object, which is called `seen`, in a few lines of text."""
        rows = matrix_lines(self.rotation)
        holds = [] if self.holds_where is None else [self.holds_where]
        bounds = [
            f"{name}: within {', '.join(f'{deg:.1f}° in {q}' for q, deg in of.items())} of 100, "
            "over objects and images"
            for name, of in self.bounds_deg.items()
            if of
        ]
        camera = "camera" if self.camera_frame_id is None else self.camera_frame_id
        return [f"rotation, {seen} to {camera}", *rows, self.value(self), *bounds, *holds]


def recommend_camera(
    errors: OrientationErrors,
    estimates: Sequence[PoseEstimate],
    candidates: Sequence[AnyPose] | int,
    *,
    straightened: bool,
    camera_pose: AnyPose | None,
    max_travel_deg: float,
) -> CameraRecommendation:
    """Rank camera poses by an object's errors; see `nbv.OrientationTable.recommend`."""
    scores = _checked_scores(estimates)
    is_posed = estimates[0].camera_pose is not None
    if is_posed and camera_pose is not None:
        raise UserError("the estimates have camera poses; leave `camera_pose` out")
    base = np.eye(4) if camera_pose is None else as_pose(camera_pose)
    cameras = [base if e.camera_pose is None else e.camera_pose for e in estimates]
    camera, position = cameras[-1], estimates[-1].position_mm
    # At each camera's place, one that looks straight at the object, if positions are known.
    straight = [
        np.eye(3) if e.position_mm is None or not straightened else along_ray(e.position_mm)
        for e in estimates
    ]
    straight_from_base = np.stack(
        [rotation @ pose[:3, :3].T for rotation, pose in zip(straight, cameras, strict=True)]
    )
    kept = _different(straight_from_base) if is_posed else np.arange(len(cameras))
    first, last = straight_from_base[kept[0]], straight_from_base[-1]
    seen = np.stack([s @ e.rotation for s, e in zip(straight, estimates, strict=True)])
    ratio, ratios, warnings = None, np.ones(len(seen)), [NO_SCORES]
    if scores is not None and errors.ratio is not None:
        ratio, ratios, warnings = errors.ratio, errors.ratio(scores), []
    if is_posed:
        now = belief(errors, seen[kept], straight_from_base[kept] @ first.T, ratios[kept])
        if position is not None:
            at_m = [e.position_mm / 1000 for e in estimates if e.position_mm is not None]
            rotations = np.array([estimate.rotation for estimate in estimates])
            warnings += contradictions(
                np.array(cameras), np.array(at_m), rotations, errors.symmetry
            )
    else:
        order = slice(None) if scores is None else np.argsort(-scores, kind="stable")
        now = hypotheses_belief(errors, seen[order], ratios[order])
    if n_again := len(seen) - len(kept):
        warnings.append(
            f"{n_again} of {len(seen)} views are within {MIN_SEPARATION_DEG:g}° of a later one and "
            "do not count: the same view repeats its error"
        )
    if (away_m := np.linalg.norm(camera[:3, 3])) > FARTHEST_M:
        warnings.append(
            f"the camera is {away_m:.0f} m from the origin of the base frame: are its poses in "
            "millimetres? give metres"
        )
    place = None if position is None else (camera @ np.append(position / 1000, 1.0))[:3]
    in_base = camera_pose is not None or is_posed
    if isinstance(candidates, int | np.integer):
        poses, is_known = _sphere(int(candidates), place, camera, in_base), place is not None
    else:
        given = [as_pose(pose, f"candidate {i}") for i, pose in enumerate(candidates)]
        poses = np.array(given).reshape(-1, 4, 4)
        is_known = True
        if not in_base:
            warnings.append(IN_CAMERA)
    if position is not None and place is not None and len(poses):
        from_m = np.linalg.norm(poses[:, :3, 3] - place, axis=1)
        if (far := from_m > FARTHEST_M).any():
            raise UserError(
                f"candidate {far.argmax()}: the object is {from_m[far.argmax()]:.0f} m away: give "
                "it and `camera_pose` in metres, not millimetres"
            )
        warnings += not_seeing(poses, camera, position / 1000, in_base=in_base)
    targets, is_away = _straight_targets(poses, place, straightened)
    if n_away := int(is_away.sum()):
        warnings.append(
            f"{n_away} of {counted(len(poses), 'candidate')} look away from the object, candidate "
            f"{is_away.argmax()} first, and are left out"
        )
    travel = view_angle_deg(targets @ last.T)
    apart = np.min([view_angle_deg(targets @ taken.T) for taken in straight_from_base], axis=0)
    is_near = travel <= as_limit_deg("max_travel_deg", max_travel_deg)
    free = np.flatnonzero((apart >= MIN_SEPARATION_DEG) & is_near & ~is_away)
    if not len(free):
        raise UserError(
            f"none of {counted(len(poses), 'candidate')} is {MIN_SEPARATION_DEG:g}° or more from "
            "every view so far and within `max_travel_deg`: the same view repeats its error"
        )
    ahead = targets[free] @ first.T
    blocks = np.split(ahead, range(BLOCK, len(ahead), BLOCK))
    parts = zip(*(bayes_error(now, block, WITHIN_DEG, ratio) for block in blocks), strict=True)
    cost, within = (np.concatenate(part, axis=-1) for part in parts)
    cost += optimism_deg(now, ahead, cost, ratio)
    if errors.depends_on_view:
        ranked = np.lexsort((travel[free], cost.round(9)))
    else:
        # All are equal, but errors of neighbouring views are not independent.
        near = np.where(apart[free] >= INDEPENDENT_DEG, travel[free], 1000 - apart[free])
        ranked = np.argsort(near, kind="stable")
        warnings.insert(0, NO_DEPENDENCE)
    moves = [
        CameraMove(
            index=int(free[k]),
            travel_deg=float(travel[free[k]]),
            travel_m=float(np.linalg.norm(pose[:3, 3] - camera[:3, 3])) if is_known else None,
            expected_error_deg=float(cost[k]),
            probability_within=as_chances(within[:, k]),
            target_camera_pose=pose if is_known else None,
            direction=-targets[free[k]][2],
        )
        for k, pose in ((k, poses[free[k]]) for k in ranked)
    ]
    within_now = [now.probability_within(error_deg) for error_deg in WITHIN_DEG]
    return CameraRecommendation(
        rotation=straight[-1].T @ last @ first.T @ now.pose,
        expected_error_deg=now.error_deg,
        probability_within=as_chances(within_now),
        moves=tuple(moves),
        depends_on_view=errors.depends_on_view,
        pose_belief=now,
        in_base=in_base,
        warnings=tuple(warnings),
        helps=bool(cost[ranked[0]] < HELPFUL * now.error_deg),
        no_flips=not errors.is_flip.any() and len(set(now.votes.tolist())) == 1,
    )


def nearest_twin(
    rotation: Orientations,
    symmetry: Symmetry,
    camera_pose: Pose | None,
    previous: PoseEstimate | None,
) -> Orientations:
    """Return the pose (3, 3) nearest to an earlier one, of those that look the same."""
    if previous is None:
        return rotation
    if (camera_pose is None) != (previous.camera_pose is None):
        raise UserError(
            "`previous` and the last estimate: give the camera poses of both, or of neither if the "
            "camera stood still"
        )
    target = previous.rotation
    if camera_pose is not None and previous.camera_pose is not None:
        target = camera_pose[:3, :3].T @ previous.camera_pose[:3, :3] @ target
    return np.asarray(symmetry.nearest(rotation[None], target[None])[0])


def _checked_scores(estimates: Sequence[PoseEstimate]) -> Array | None:
    """Return the scores (n,) of estimates, if they have any; refuse estimates that differ."""
    if not estimates:
        raise UserError("no estimate; give one")
    for what, name in (
        ("a score", "score"),
        ("a position", "position_mm"),
        ("a camera pose", "camera_pose"),
    ):
        if len({getattr(estimate, name) is None for estimate in estimates}) > 1:
            raise UserError(f"some estimates have {what} and others none; give all, or none")
    scores = [estimate.score for estimate in estimates if estimate.score is not None]
    return np.array(scores) if scores else None


def scores_of_all(scores: Array | None) -> Array | None:
    """Return the scores (n,) of calibration pairs if every pair has one; BOP's for none is none."""
    if scores is None or not np.isfinite(scores).all():
        return None
    is_none = scores == NO_SCORE
    return None if is_none.any() and (scores[~is_none] >= 0).all() else scores


def known_scores(
    estimates: Sequence[PoseEstimate], calibrated: Array | None
) -> tuple[Sequence[PoseEstimate], list[str]]:
    """Return estimates without scores that mean none, and a warning of another scale.

    `calibrated` (n,) are the scores of calibration, if it has any.
    """
    if calibrated is None or calibrated.min() >= 0:
        estimates = [replace(e, score=None) if e.score == NO_SCORE else e for e in estimates]
    if calibrated is None:
        return estimates, []
    low, high = calibrated.min(), calibrated.max()
    margin, is_share = (high - low) / 2, 0 <= low <= high <= 1
    scores = np.array([e.score for e in estimates if e.score is not None])
    is_other = np.where((scores >= 0) & (scores <= 1), low > 1, is_share)
    odd = scores[(scores < low - margin) | (scores > high + margin) | is_other]
    return estimates, [
        f"the score {score:g} is far from those of calibration, {low:g} to {high:g}: is it of "
        "another scale, such as a logit, or the estimate worse than those?"
        for score in odd[:1]
    ]


def _different(straight_from_base: Orientations) -> NDArray[np.intp]:
    """Return which views are `MIN_SEPARATION_DEG` or more from every later one that is kept."""
    kept: list[int] = []
    for i in reversed(range(len(straight_from_base))):
        moves = straight_from_base[kept] @ straight_from_base[i].T
        if (view_angle_deg(moves) >= MIN_SEPARATION_DEG).all():
            kept.insert(0, i)
    return np.array(kept)


def _straight_targets(
    poses: Array, place: Array | None, straightened: bool
) -> tuple[Orientations, NDArray[np.bool_]]:
    """Return base to candidates (n, 3, 3), straight at the object, and which of them look away.

    `place` (3,) is the object's position.
    """
    from_base = inverse(poses[:, :3, :3])
    if place is None:
        return from_base, np.zeros(len(poses), dtype=bool)
    position = (from_base @ (place - poses[:, :3, 3])[:, :, None])[..., 0]
    behind = position[:, 2] <= 0
    position[behind] = [0, 0, 1]
    return along_ray(position) @ from_base if straightened else from_base, behind


def _sphere(n: int, place: Array | None, pose: Pose, in_base: bool) -> Array:
    """Return even camera poses (n, 4, 4) that look at the object from its distance, level."""
    if not 1 <= n <= MOST_ON_SPHERE:
        raise UserError(f"`sphere`={n}: give 1 to {MOST_ON_SPHERE}")
    up = np.array([0.0, 0.0, 1.0]) if in_base else -pose[:3, 1]
    distance = 1.0 if place is None else float(np.linalg.norm(place - pose[:3, 3]))
    centre = pose[:3, 3] + distance * pose[:3, 2] if place is None else place
    z = 1 - (2 * np.arange(n) + 1) / n
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(n)
    across = np.sqrt(1 - z**2)
    outwards = np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
    right = np.cross(up, outwards)
    above = np.linalg.norm(right, axis=1) < 1e-6
    right[above] = np.cross([1.0, 0.0, 0.0], outwards[above])
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    targets = np.tile(np.eye(4), (n, 1, 1))
    targets[:, :3, :3] = np.stack([right, np.cross(-outwards, right), -outwards], axis=2)
    targets[:, :3, 3] = centre + distance * outwards
    return targets


def as_view(given: Any, name: str, quaternion: str | None = None) -> PoseEstimate:
    """Return a view from a pose of any form, or a mapping with a score and a camera_pose too.

    A UserError names what is wrong.
    """
    others = given if isinstance(given, Mapping) else {}
    # The class makes arrays of them.
    read: dict[str, Any] = {"rotation": as_given(given, name, quaternion)}
    if (score := others.get("score")) is not None:
        read["score"] = as_finite(score, f"{name}: score", 1).item()
    if (camera := others.get("camera_pose")) is not None:
        read["camera_pose"] = as_given(camera, f"{name}: camera_pose", quaternion)
    return PoseEstimate(**read)


def read_views(source: Source, quaternion: str | None = None) -> list[PoseEstimate]:
    """Read estimates, the poses of `nbv.poses.read_entries`; errors as in `as_view`."""
    return [as_view(given, name, quaternion) for name, given in read_entries(source, "estimate")]
