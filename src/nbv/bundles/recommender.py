"""Pose and next view from depth frames of one object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.bundles.bundle import ELEVATION_BANDWIDTH_DEG, Bundle
from nbv.bundles.network import Network, open_network
from nbv.bundles.ood import energy, ood_score
from nbv.choice.moves import elevation_from_gravity, roll_warnings
from nbv.choice.next_view import (
    AfterRotations,
    Recommendation,
    after_rotations,
    as_rotation_list,
    next_view,
)
from nbv.core.circle.logits import from_logits
from nbv.errors import BundleError, UserError, check_number, nearest
from nbv.files import as_path
from nbv.frames.crop import (
    Crop,
    check_depth_limits,
    check_plausible_nearest,
    crop_frame,
    unit_doubts,
)
from nbv.frames.depth_files import to_metres
from nbv.frames.intrinsics import Intrinsics, as_intrinsics
from nbv.frames.masks import object_mask
from nbv.labels import counted

IntrinsicsLike = Intrinsics | ArrayLike | None
"""Intrinsics, or their numbers; None if they are unknown."""

REACH = 0.75
"""Depth of an object behind its nearest point without a mask, diagonals."""


def shipped_bundles() -> dict[str, Path]:
    """Return the bundles that come with the package, by name."""
    folder = resources.files("nbv.bundles") / "shipped"
    if not folder.is_dir():
        return {}
    paths = sorted(Path(str(item)) for item in folder.iterdir())
    return {path.stem: path for path in paths if path.suffix == ".safetensors"}


def bundle_path(name: str | Path) -> Path:
    """Return the path of a shipped bundle of this name, or of a file.

    Raise BundleError ``no-bundle`` where there is neither.
    """
    shipped = shipped_bundles()
    if str(name) in shipped:
        return shipped[str(name)]
    if not as_path(name).exists():
        known = nearest(str(name), shipped) if shipped else "this nbv ships no bundle"
        own = "give the file of another bundle, or make one (docs/own-category.md)"
        raise BundleError("no-bundle", f"{str(name)!r} does not exist; {known}; or {own}")
    return Path(name)


class Recommender:
    """Estimates poses and recommends next views with a bundle.

    Parameters
    ----------
    bundle : Bundle

    Examples
    --------
    >>> import nbv
    >>> recommender = nbv.Recommender.load("mug")
    >>> frame = nbv.example_frame()
    >>> answer = recommender.recommend(frame.depth_m, intrinsics=frame.intrinsics)
    >>> 0 <= answer.azimuth_deg < 360, answer.move.travel_deg >= 15
    (True, True)
    >>> crop = recommender.crop(frame.depth_m, intrinsics=frame.intrinsics)
    >>> recommender.recommend_crops(crop.codes[None]).move == answer.move
    True
    >>> recommender.distributions(crop.codes[None]).shape
    (1, 120)
    """

    def __init__(self, bundle: Bundle) -> None:
        if not isinstance(bundle, Bundle):
            raise UserError(
                f"{bundle!r} is not a Bundle; give its name or file to Recommender.load"
            )
        self.bundle = bundle
        self.network: Network = open_network(
            bundle.network, bundle.camera.image_side, bundle.n_bins
        )

    @classmethod
    def load(cls, name: str | Path) -> Recommender:
        """Load a bundle by the name of a shipped one, or from a file.

        Raises
        ------
        BundleError
            Where the bundle does not exist, or is damaged.
        """
        return cls(Bundle.load(bundle_path(name)))

    @cached_property
    def _calibrated(self) -> AfterRotations:
        return after_rotations(self.bundle.distributions, self.bundle.object_ids)

    def crop(
        self,
        depth_m: ArrayLike,
        *,
        mask: ArrayLike | None = None,
        intrinsics: IntrinsicsLike = None,
        near_m: float | None = None,
        far_m: float | None = None,
    ) -> Crop:
        """Return the network's input for one frame.

        Same parameters and errors as `recommend`.
        """
        bundle = self.bundle
        depth = to_metres(np.asanyarray(depth_m))
        camera = bundle.focal_px if intrinsics is None else intrinsics
        known = as_intrinsics([camera] if isinstance(camera, float) else camera)
        reach_m = REACH * bundle.diagonal_m
        check_depth_limits(near_m, far_m, bundle.diagonal_m)
        if mask is None and far_m is None:
            check_plausible_nearest(depth, reach_m, bundle.diagonal_m, near_m)
        about = known, bundle.camera, bundle.diagonal_m, bundle.extent_m

        def crop_at(factor: float) -> Crop:
            inside = object_mask(depth, reach_m / factor, mask, near_m, far_m)
            scaled = depth if factor == 1 else depth * np.float32(factor)
            return crop_frame(scaled, inside, *about, is_given=mask is not None)

        found = crop_at(1.0)
        doubts = unit_doubts(found, crop_at, bundle.diagonal_m, bundle.extent_m)
        return replace(found, doubts=(*found.doubts, *doubts))

    def distributions(self, codes: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return p(azimuth | image) (n, B) of crops (n, side, side)."""
        return from_logits(self.network(codes), self.bundle.temperature)

    def lying_warnings(
        self, codes: NDArray[np.uint8], logits: NDArray[np.floating[Any]]
    ) -> tuple[str, ...]:
        """Return a sentence if crops (n, side, side) with logits (n, B) look rotated.

        Of 230 drawn and real mugs it finds half of those that lie on a side and six of ten that
        are upside down, and at most 3 % of upright ones.
        """
        mean, deviation = self.bundle.ood.scales[1]
        upright = energy(logits).mean()
        # Most upright frames end here, because a frame takes little longer than its network.
        if upright <= mean:
            return ()
        rotated = np.concatenate([np.rot90(codes, quarters, axes=(1, 2)) for quarters in (1, 2, 3)])
        left, half, right = energy(self.network(rotated)).reshape(3, -1).mean(axis=1)
        side = min(left, right)
        if upright - min(side, half) <= deviation:
            return ()
        # Turned by 90°, what is upside down looks more usual too.
        is_upside_down = half < (side + upright) / 2
        what, angle_deg = ("be upside down", 180) if is_upside_down else ("lie on its side", 90)
        return (
            f"the object seems to {what} in the image: rotate the frame by {angle_deg}°, with its "
            "intrinsics, so that up is up in the image",
        )

    def recommend(
        self,
        depth_m: ArrayLike | Sequence[ArrayLike],
        *,
        rotations_deg: float | Sequence[float] = (0.0,),
        mask: ArrayLike | Sequence[ArrayLike] | None = None,
        intrinsics: IntrinsicsLike | Sequence[Intrinsics | None] = None,
        near_m: float | None = None,
        far_m: float | None = None,
        elevation_deg: float | None = None,
        gravity: ArrayLike | None = None,
        allowed_deg: ArrayLike | None = None,
        max_travel_deg: float = 180.0,
        followed: bool = True,
        names: Sequence[str] | None = None,
    ) -> Recommendation:
        """Return the estimated pose and the next view.

        Views closer than 15° add no information, because the same parts are hidden. So the next
        view is at least 15° from every view so far.

        Parameters
        ----------
        depth_m : (rows, columns), or a sequence of such
            Depth in metres, NaN or 0 where nothing was measured; integer depth in millimetres.
        rotations_deg : sequence of float
            Rotation of each frame around the object from the first one, degrees, counter-clockwise
            seen from above. The first is 0. For one frame it may be a number.
        mask : (rows, columns), or a sequence of such, optional
            Not 0 at the object's pixels. Without it the object is the nearest surface, or the one
            between `near_m` and `far_m`.
        intrinsics : Intrinsics, (fx, fy, cx, cy) or 3 × 3, optional
            Pixels; or a list of Intrinsics, one for each frame. Without it the focal length of the
            simulated sensor is assumed.
        near_m, far_m : float, optional
            Depth limits of the object, metres.
        elevation_deg : float, optional
            Elevation of the camera above the object's base plane, if known.
        gravity : (3,), optional
            Instead of `elevation_deg`: the direction down in the optical frame of the last frame's
            camera, of any length. It gives the elevation, and a warning if the camera is rolled.
            An accelerometer reports the opposite direction.
        allowed_deg : array-like, optional
            Admissible rotations from the last frame; all without it. An array of n booleans is a
            mask over the circle: entry k selects the rotation 360 k / n.
        max_travel_deg : float
        followed : bool
            Whether a recommendation chose the last of several frames. Its expected error is made
            of the calibration errors that chose it, and so it is too low; True adds the
            difference. Give False for rotations fixed beforehand, as with a turntable or several
            cameras. It has no effect on one frame.
        names : sequence of str, optional
            Names of the frames in messages, such as their files; numbers without it.

        Raises
        ------
        FrameError
            Where a frame cannot be used; its name is the reason.
        UserError
            Where the arguments do not fit each other, or gravity points up in the image.
        """
        if gravity is not None and elevation_deg is not None:
            raise UserError(
                "`gravity` and `elevation_deg`: give one of them, gravity determines the elevation"
            )
        rolled: tuple[str, ...] = ()
        if gravity is not None:
            elevation_deg, rolled = elevation_from_gravity(gravity), roll_warnings(gravity)
        frames = _as_frames(depth_m)
        masks = _as_masks(mask, len(frames))
        cameras = _as_cameras(intrinsics, len(frames))
        rotations_deg = as_rotation_list(rotations_deg, len(frames))
        labels = _as_names(names, len(frames))
        # Here, because the limits hold for all frames: the message should not name one.
        check_depth_limits(near_m, far_m, self.bundle.diagonal_m)
        crops: list[Crop] = []
        for frame, pixels, camera, name in zip(frames, masks, cameras, labels, strict=True):
            try:
                crop = self.crop(frame, mask=pixels, intrinsics=camera, near_m=near_m, far_m=far_m)
            except UserError as error:
                if name is None:
                    raise
                raise error.about(name) from error
            crops.append(crop)
        answer = self.recommend_crops(
            np.array([crop.codes for crop in crops]),
            rotations_deg,
            elevation_deg=elevation_deg,
            allowed_deg=allowed_deg,
            max_travel_deg=max_travel_deg,
            followed=followed,
        )
        doubts = dict.fromkeys(doubt for crop in crops for doubt in crop.doubts)
        return replace(
            answer,
            warnings=(*doubts, *rolled, *answer.warnings),
            object_position_m=crops[-1].centre_m,
        )

    def recommend_crops(
        self,
        codes: NDArray[np.uint8],
        rotations_deg: float | Sequence[float] = (0.0,),
        *,
        elevation_deg: float | None = None,
        allowed_deg: ArrayLike | None = None,
        max_travel_deg: float = 180.0,
        followed: bool = True,
    ) -> Recommendation:
        """Return the estimated pose and the next view from crops (n, side, side) uint8.

        Same parameters and errors as `recommend`.
        """
        codes = np.asarray(codes)
        if codes.ndim != 3 or codes.dtype != np.uint8:
            raise UserError(
                f"`codes`: {codes.dtype} of shape {codes.shape}; give (n, side, side) uint8, such "
                "as those of Recommender.crop"
            )
        rotations_deg = as_rotation_list(rotations_deg, len(codes))
        if elevation_deg is not None:
            check_number("`elevation_deg`", elevation_deg)
        if elevation_deg is not None and not -90 <= elevation_deg <= 90:
            raise UserError(
                f"`elevation_deg`={elevation_deg:g}: give -90 to 90 degrees, or leave it out"
            )
        logits = self.network(codes)
        score = float(ood_score(self.bundle.ood, codes, logits).max())
        unusual = (
            f"frame looks out of distribution (score {score:.1f}, threshold 1): check mask, units "
            "and category"
        )
        answer = next_view(
            from_logits(logits, self.bundle.temperature),
            rotations_deg,
            self._calibrated,
            self.bundle.affinity,
            self.bundle.weights_at(elevation_deg),
            allowed_deg=allowed_deg,
            max_travel_deg=max_travel_deg,
            followed=followed,
        )
        return replace(
            answer,
            ood_score=score,
            warnings=(
                *(unusual,) * (score > 1.0),
                *self.lying_warnings(codes, logits),
                *_elevation_warnings(self.bundle, elevation_deg),
                *answer.warnings,
            ),
            crops=tuple(codes),
        )


def _elevation_warnings(bundle: Bundle, elevation_deg: float | None) -> tuple[str, ...]:
    if elevation_deg is None:
        return ()
    known = bundle.elevation_deg[np.isfinite(bundle.elevation_deg)]
    if not len(known):
        return ()
    least, most = float(known.min()), float(known.max())
    if least - ELEVATION_BANDWIDTH_DEG <= elevation_deg <= most + ELEVATION_BANDWIDTH_DEG:
        return ()
    return (
        f"the elevation {elevation_deg:g}° is outside the calibrated range of {least:g} to "
        f"{most:g}°: expected errors may be too low",
    )


def _as_frames(depth_m: ArrayLike | Sequence[ArrayLike]) -> list[NDArray[np.generic]]:
    if isinstance(depth_m, np.ndarray) and depth_m.ndim == 2:
        return [depth_m]
    if isinstance(depth_m, list | tuple) and depth_m and isinstance(depth_m[0], np.ndarray):
        return [np.asanyarray(frame) for frame in depth_m]
    _reject_text("depth", depth_m, "give an array, such as that of nbv.read_depth")
    try:
        values = np.asanyarray(depth_m)
    except ValueError as error:
        raise UserError("frames of different sizes: give a list of numpy arrays") from error
    return _split(values)


def _split(values: NDArray[Any]) -> list[NDArray[Any]]:
    """Return the images of a stack (n, rows, columns), or one image with up to 4 channels."""
    return list(values) if values.ndim > 2 and values.shape[-1] > 4 else [values]


def _as_masks(mask: ArrayLike | Sequence[ArrayLike] | None, n: int) -> Sequence[ArrayLike | None]:
    if mask is None:
        return [None] * n
    _reject_text("mask", mask, "give an array of pixels")
    masks: list[Any]
    if isinstance(mask, list | tuple) and not (mask and np.ndim(mask[0]) == 1):
        masks = list(mask)
    else:
        masks = _split(np.asanyarray(mask))
    _check_one_each(masks, n, "mask")
    return masks


def _check_one_each(values: Sequence[Any], n: int, noun: str) -> None:
    if len(values) != n:
        raise UserError(
            f"{counted(n, 'frame')} and {counted(len(values), noun)}: give one for each frame"
        )


def _reject_text(name: str, value: Any, what_to_do: str) -> None:
    """Raise UserError for a file name, alone or in a list, in place of an array."""
    for item in value if isinstance(value, list | tuple) else [value]:
        if isinstance(item, str | bytes | Path):
            raise UserError(f"{name}: {str(item)!r} is text; {what_to_do}")


def _as_names(names: Sequence[str] | None, n: int) -> Sequence[str | None]:
    """Return the name of each of n frames; None for a single frame without a name."""
    if names is None:
        return [None] if n == 1 else [f"frame {i} of {n}" for i in range(1, n + 1)]
    _check_one_each(names, n, "name")
    return names


def _as_cameras(
    intrinsics: IntrinsicsLike | Sequence[Intrinsics | None], n: int
) -> Sequence[IntrinsicsLike]:
    each = list(intrinsics) if isinstance(intrinsics, list | tuple) else []
    if not each or not all(item is None or isinstance(item, Intrinsics) for item in each):
        shared: Any = intrinsics
        return [shared] * n
    _check_one_each(each, n, "camera")
    return each
