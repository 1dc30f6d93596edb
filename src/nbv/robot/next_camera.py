"""The next camera pose of an object in three dimensions, from a table of an estimator's errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nbv.core.look_alikes import WITHIN_DEG
from nbv.core.rotation_belief import belief, hypotheses_belief
from nbv.core.rotation_criteria import (
    NextViews,
    bayes_error,
    chances_within,
    ranking,
    view_angle_deg,
)
from nbv.core.rotations import Array, Orientations, along_ray, check_orientations
from nbv.errors import UserError
from nbv.files import read_given_json, read_numbers
from nbv.labels import counted
from nbv.numbers import Pose, as_pose
from nbv.robot.answers import Answer, RankedMove
from nbv.robot.bop import check_position
from nbv.robot.next_view import as_chances
from nbv.robot.rotation_pairs import OrientationTable
from nbv.robot.rotations import MIN_SEPARATION_DEG, as_travel

FARTHEST_M = 50.0
"""No arm looks at an object from farther: such camera poses are in millimetres."""

NO_DEPENDENCE = (
    "calibration shows no dependence of this object's flips on the view; the ranking may be no "
    "better than random"
)

NO_SCORES = "scores are not used: calibration pairs had none"


@dataclass(frozen=True)
class PoseEstimate:
    """The estimate of an object's pose in one image.

    Attributes
    ----------
    rotation : ndarray (3, 3)
        Object to camera.
    position_mm : ndarray (3,) or None
        The object in the camera.
    score : float or None
    camera_pose : ndarray (4, 4) or None
        Camera to base. Estimates without it are hypotheses of the same image.

    Examples
    --------
    >>> import nbv, numpy as np
    >>> nbv.PoseEstimate(np.eye(3), score=0.4).position_mm is None
    True
    """

    rotation: Orientations
    position_mm: Array | None = None
    score: float | None = None
    camera_pose: Pose | None = None


@dataclass(frozen=True, kw_only=True)
class CameraMove(RankedMove):
    """A candidate camera pose.

    Attributes
    ----------
    index : int
        The candidate's number, from 0.
    travel_deg : float
        Angle to the last view, about the object.
    travel_m : float or None
        Distance to the last view.
    expected_error_deg : float
        Expected error of the pose after a view there.
    probability_within : dict of str to float
        Probability that the error after this view is below 5, 15 and 30 degrees.
    target_camera_pose : ndarray (4, 4) or None
        None where the object's position is unknown.
    direction : ndarray (3,)
        Direction from which the object is seen, in the frame of the camera poses.
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
        x, y, z = self.direction
        return f"{super().extent}{metres}; seen from the direction {x:.2f} {y:.2f} {z:.2f}"


@dataclass(frozen=True, kw_only=True)
class CameraRecommendation(Answer[CameraMove]):
    """The pose (3, 3) in the last camera, its error, and candidates, best first."""

    rotation: Orientations
    depends_on_view: bool

    def pose_lines(self, seen: str) -> list[str]:
        """Return the pose of the object, which is called `seen`, in a few lines of text."""
        rows = ("  " + " ".join(f"{value:8.5f}" for value in row) for row in self.rotation)
        return [f"rotation, {seen} to camera", *rows, self.value(self)]


def recommend_camera(
    pairs: OrientationTable,
    views: Sequence[PoseEstimate],
    candidates: Sequence[Pose] | int,
    *,
    object_id: str | None = None,
    camera_pose: ArrayLike | None = None,
    max_travel_deg: float = 180.0,
) -> CameraRecommendation:
    """Rank camera poses by the expected error of the pose that two views, or more, give.

    Parameters
    ----------
    pairs : OrientationTable
    views : sequence of PoseEstimate
        Views in succession if each has its camera pose, else hypotheses of one view.
    candidates : sequence of (4, 4), or int
        Camera poses that can be reached; or how many even ones on a sphere about the object.
    object_id : str, optional
        Needed where the table has several objects.
    camera_pose : (4, 4), optional
        Of the only view: optical frame in the base frame, metres. By default the base frame is
        the camera's.

    Raises
    ------
    UserError
        Where views, poses and table do not fit each other, or no candidate can be reached.

    Examples
    --------
    >>> import nbv, numpy as np
    >>> poses = np.stack([np.eye(3)] * 12)
    >>> cups = np.array(["cup"] * 12)
    >>> pairs = nbv.OrientationTable(cups, group=cups, estimate=poses, truth=poses)
    >>> answer = nbv.recommend_camera(pairs, [nbv.PoseEstimate(np.eye(3))], 50)
    >>> answer.depends_on_view, answer.probability_within["30"] > 0.9
    (False, True)
    """
    errors = pairs.errors(object_id)
    name = pairs.object_ids[0] if object_id is None else object_id
    if not views:
        raise UserError("no estimate; give one")
    scores = [view.score for view in views if view.score is not None]
    if scores and len(scores) < len(views):
        raise UserError("some estimates have a score and others none; give all, or none")
    if len({view.position_mm is None for view in views}) > 1:
        raise UserError("some estimates have a position and others none; give all, or none")
    n_posed = sum(view.camera_pose is not None for view in views)
    if n_posed not in (0, len(views)):
        raise UserError("some estimates have a camera pose and others none; give all, or none")
    if n_posed and camera_pose is not None:
        raise UserError("the estimates have camera poses; leave `camera_pose` out")
    start = np.eye(4) if camera_pose is None else as_pose(camera_pose)
    poses = [start if view.camera_pose is None else view.camera_pose for view in views]
    rays = [_ray(pairs, view.position_mm) for view in views]
    cameras = np.stack(
        [ray @ pose[:3, :3].T for ray, pose in zip(rays, poses, strict=True)]
    )  # base to a camera that looks straight at the object
    seen = np.stack([ray @ view.rotation for ray, view in zip(rays, views, strict=True)])
    if n_posed:
        now = belief(errors, seen, cameras @ cameras[0].T, scores or None)
    else:
        order = np.argsort([-score for score in scores], kind="stable") if scores else slice(None)
        now = hypotheses_belief(errors, seen[order], np.array(scores)[order] if scores else None)
    last = views[-1].position_mm
    place = None if last is None else (poses[-1] @ np.append(last / 1000, 1.0))[:3]
    if isinstance(candidates, int):
        targets = _sphere(candidates, place, poses[-1], camera_pose is None and not n_posed)
        known = place is not None
    else:
        targets, known = (
            [as_pose(pose, f"candidate {i}") for i, pose in enumerate(candidates)],
            True,
        )
    turned = np.stack([_camera_at(pose, place, pairs, i) for i, pose in enumerate(targets)])
    travel = view_angle_deg(turned @ cameras[-1].T)
    apart = np.min([view_angle_deg(turned @ camera.T) for camera in cameras], axis=0)
    free = np.flatnonzero((apart >= MIN_SEPARATION_DEG) & (travel <= as_travel(max_travel_deg)))
    if not len(free):
        raise UserError(
            f"none of {counted(len(targets), 'candidate')} is {MIN_SEPARATION_DEG:g}° or more from "
            "every view so far and within `max_travel_deg`: the same view repeats its error"
        )
    ahead = NextViews(now, turned[free] @ cameras[0].T)
    small = float(errors.error_deg[~errors.is_flip].mean()) if not errors.is_flip.all() else 0.0
    cost, within = bayes_error(ahead) + small, chances_within(ahead, WITHIN_DEG)
    ranked = [
        CameraMove(
            index=int(i),
            travel_deg=float(travel[i]),
            travel_m=float(np.linalg.norm(targets[i][:3, 3] - poses[-1][:3, 3])) if known else None,
            expected_error_deg=float(cost[k]),
            probability_within=as_chances(within[:, k]),
            target_camera_pose=targets[i] if known else None,
            direction=-turned[i][2],
        )
        for k, i in ((k, free[k]) for k in ranking(cost, travel[free]))
    ]
    distance = errors.symmetry.distance_deg(now.support, now.pose)
    unused = bool(scores) and errors.ratio is None
    depends = pairs.depends_on_view(name)
    within_now = [now.probability_within(error_deg) for error_deg in WITHIN_DEG]
    return CameraRecommendation(
        rotation=rays[-1].T @ cameras[-1] @ cameras[0].T @ now.pose,
        expected_error_deg=float(now.probability @ distance) + small,
        probability_within=as_chances(within_now),
        moves=tuple(ranked),
        depends_on_view=depends,
        warnings=(*(() if depends else (NO_DEPENDENCE,)), *([NO_SCORES] if unused else [])),
    )


def _ray(pairs: OrientationTable, position: Array | None) -> Orientations:
    if position is None:
        return np.eye(3)
    return along_ray(position) if pairs.straightened else np.eye(3)


def _camera_at(pose: Pose, place: Array | None, pairs: OrientationTable, i: int) -> Orientations:
    """Return base to camera (3, 3), turned straight at the object if its place is known."""
    turned = pose[:3, :3].T
    if place is None:
        return turned
    position = turned @ (place - pose[:3, 3])
    if position[2] <= 0:
        raise UserError(
            f"candidate {i}: the object is behind this camera: give poses of the optical frame "
            "(z forward) in the base frame, camera to base, in metres"
        )
    if (away := float(np.linalg.norm(position))) > FARTHEST_M:
        raise UserError(
            f"candidate {i}: the object is {away:.0f} m away: give camera poses in metres, not "
            "millimetres"
        )
    return _ray(pairs, position) @ turned


def _sphere(n: int, place: Array | None, pose: Pose, in_camera: bool) -> list[Pose]:
    """Return even camera poses that look at the object from its distance, level."""
    if n < 1:
        raise UserError(f"`sphere`={n}: give 1 or more")
    up = -pose[:3, 1] if in_camera else np.array([0.0, 0.0, 1.0])
    distance = 1.0 if place is None else float(np.linalg.norm(place - pose[:3, 3]))
    centre = pose[:3, 3] + distance * pose[:3, 2] if place is None else place
    z = 1 - (2 * np.arange(n) + 1) / n
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(n)
    across = np.sqrt(1 - z**2)
    outwards = np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
    poses = []
    for direction in outwards:
        right = np.cross(up, direction)
        if np.linalg.norm(right) < 1e-6:
            right = np.cross([1.0, 0.0, 0.0], direction)
        right /= np.linalg.norm(right)
        target = np.eye(4)
        target[:3, :3] = np.stack([right, np.cross(-direction, right), -direction], axis=1)
        target[:3, 3] = centre + distance * direction
        poses.append(target)
    return poses


def as_view(given: Any, name: str) -> PoseEstimate:
    """Return a view from R (9 numbers), or a mapping of R, t (mm), score and camera_pose.

    Raises
    ------
    UserError
        Names what is wrong.
    """
    entry = given if isinstance(given, dict) else {"R": given}
    if "R" not in entry or (odd := set(entry) - {"R", "t", "score", "camera_pose"}):
        what = "has no R" if "R" not in entry else f"has {min(odd)!r}"
        raise UserError(f"{name} {what}; give R, t (mm), score, camera_pose")
    rotation = _array(entry["R"], f"{name}: R", 9).reshape(3, 3)
    view = PoseEstimate(check_orientations(f"{name}: R", rotation))
    if (t := entry.get("t")) is not None:
        position = _array(t, f"{name}: t", 3)
        check_position(f"{name}: t", position)
        view = replace(view, position_mm=position)
    if (score := entry.get("score")) is not None:
        view = replace(view, score=float(_array(score, f"{name}: score", 1)[0]))
    if (pose := entry.get("camera_pose")) is not None:
        view = replace(view, camera_pose=as_pose(pose, f"{name}: camera_pose"))
    return view


def _array(values: Any, name: str, n: int) -> Array:
    try:
        numbers = np.asarray(values, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if len(numbers) != n or not np.isfinite(numbers).all():
        raise UserError(f"{name} is not {counted(n, 'finite number')}")
    return numbers


def read_views(path: str | Path) -> list[PoseEstimate]:
    """Read estimates: JSON as of `as_view`, one or a list, or ``.npy`` of (..., 3, 3)."""
    path = Path(path)
    if path.suffix.lower() != ".json":
        array = read_numbers(path)
        if array.dtype.kind not in "iuf" or array.size % 9 or not array.size:
            raise UserError(f"{path}: shape {array.shape} instead of (..., 3, 3)")
        given: Any = list(array.reshape(-1, 9))
    else:
        given = read_given_json(path, "give JSON, or an .npy array")
        is_one = isinstance(given, dict) or np.size(given) == 9
        given = [given] if is_one else given
    if not isinstance(given, list):
        raise UserError(f"{path} is not an estimate or a list of them")
    return [as_view(entry, f"{path}, estimate {i}") for i, entry in enumerate(given)]
