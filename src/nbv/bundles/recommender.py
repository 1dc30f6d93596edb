"""From depth frames of one object to its pose and to the next view."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.angles import (
    circular_distance_deg,
    nearest_bin,
    signed_difference_deg,
    travel_deg,
    wrap_deg,
)
from nbv.bundles.beliefs import (
    distributions_of,
    elevation_share,
    fused,
    log_bayes_factor,
    spread_deg,
    turned,
)
from nbv.bundles.bundle import Bundle, BundleError, load_bundle
from nbv.bundles.familiarity import unfamiliarity
from nbv.bundles.moves import as_rotations
from nbv.bundles.networks import Network, open_network
from nbv.errors import UserError, nearest
from nbv.frames.crop import (
    Crop,
    Window,
    crop_frame,
    need_metres,
    need_plausible_nearest,
    window_of,
)
from nbv.frames.depth_files import DepthImage, to_metres
from nbv.frames.errors import FrameError
from nbv.frames.intrinsics import Intrinsics, as_intrinsics
from nbv.frames.masks import object_mask
from nbv.labels import counted
from nbv.recommendation.belief import mean_direction_deg
from nbv.recommendation.look_alikes import LookAlikes

IntrinsicsLike = Intrinsics | ArrayLike | None
"""Intrinsics, or their numbers; None where they are not known."""

REACH = 0.75
"""How far an object reaches behind its nearest point, in diagonals, where nothing masks it."""

MIN_SEPARATION_DEG = 15.0
"""From every view so far: an estimator errs alike from nearly the same place."""

N_ALTERNATIVES = 5

LEAST_BAYES_FACTOR = 0.05
"""Below it frames contradict each other. Of right ones, one in 20 at the most is below."""

N_KEPT = 6
"""Sequences of rotations whose look-alikes are kept: 20 MB each, of a bundle as large as `mug`."""


@dataclass(frozen=True)
class Move:
    """A rotation of the camera about the object, and what is expected of it.

    Attributes
    ----------
    rotation_deg : float
        From where the camera is now, counter-clockwise seen from above, in (-180, 180].
    travel_deg : float
        How far that is, in [0, 180].
    expected_error_deg : float
        Of the pose, once the view from there is added.

    Examples
    --------
    >>> import nbv
    >>> nbv.Move(rotation_deg=-90.0, travel_deg=90.0, expected_error_deg=3.0).travel_deg
    90.0
    """

    rotation_deg: float
    travel_deg: float
    expected_error_deg: float


@dataclass(frozen=True)
class Recommendation:
    """What frames say of an object's pose, and where to look next.

    Attributes
    ----------
    azimuth_deg : float
        Of the camera about the object at the last frame, in [0, 360).
    spread_deg : float
        Circular standard deviation of the belief.
    expected_error_deg : float
        Of `azimuth_deg`: what objects that looked alike erred in calibration.
    move : Move
        The best next view.
    alternatives : tuple of Move
        Other views, each the best of its neighbourhood, best first.
    belief : ndarray (B,)
        p(azimuth of the camera at the last frame); index b is 360 b / B degrees.
    error_after_deg : ndarray (B,)
        Expected error after a further view, by its rotation 360 d / B degrees from the last frame;
        inf where the camera may not go. Of allowed rotations, the nearest of these are finite.
    unfamiliarity : float
        How far the least familiar frame is from everything calibrated; above 1 farther than 95 %
        of calibration images.
    bayes_factor : float
        How many times as probable the frames are of one pose, at their rotations, as of poses that
        have nothing in common; 1 for one frame.
    warnings : tuple of str
        What may be wrong with the frames, a sentence each.
    crops : tuple of ndarray (side, side) uint8
        What the network saw of each frame.

    Examples
    --------
    >>> import nbv
    >>> frame = nbv.example_frame(azimuth_deg=250.0)
    >>> answer = nbv.Recommender.load("mug").recommend(frame.depth_m, intrinsics=frame.intrinsics)
    >>> abs(answer.azimuth_deg - 250.0) < 20, answer.move.expected_error_deg < 20
    (True, True)
    """

    azimuth_deg: float
    spread_deg: float
    expected_error_deg: float
    move: Move
    alternatives: tuple[Move, ...]
    belief: NDArray[np.float64]
    error_after_deg: NDArray[np.float64]
    unfamiliarity: float
    bayes_factor: float
    warnings: tuple[str, ...]
    crops: tuple[NDArray[np.uint8], ...]

    @property
    def is_unfamiliar(self) -> bool:
        """Whether a frame is like nothing that was calibrated."""
        return self.unfamiliarity > 1.0


def shipped_bundles() -> dict[str, Path]:
    """Return the bundles that come with the package, by name."""
    folder = resources.files("nbv.bundles") / "shipped"
    if not folder.is_dir():
        return {}
    found = {Path(str(item)).stem: Path(str(item)) for item in folder.iterdir()}
    return {name: path for name, path in sorted(found.items()) if path.suffix == ".safetensors"}


def bundle_path(name: str | Path) -> Path:
    """Return the file of a bundle: that of a shipped one by its name, or the file itself.

    Raises
    ------
    UserError
        Where there is neither.
    """
    shipped = shipped_bundles()
    if str(name) in shipped:
        return shipped[str(name)]
    if not Path(name).exists():
        known = nearest(str(name), shipped) if shipped else "no bundle comes with this nbv"
        raise BundleError("no-bundle", f"{str(name)!r}: there is no such file; {known}")
    return Path(name)


class Recommender:
    """A bundle, ready for frames.

    Parameters
    ----------
    bundle : Bundle
    backend : {"onnx", "torch"}, optional
        See `nbv.bundles.networks.open_network`.

    Examples
    --------
    >>> import nbv
    >>> recommender = nbv.Recommender.load("mug")
    >>> recommender.bundle.category
    'mug'
    """

    def __init__(self, bundle: Bundle, backend: str | None = None) -> None:
        self.bundle = bundle
        self.network: Network = open_network(bundle, backend)

    @classmethod
    def load(cls, name: str | Path, backend: str | None = None) -> Recommender:
        """Return the recommender of a bundle: the name of a shipped one, or a file.

        Raises
        ------
        UserError
            Where there is no such bundle, or it is damaged.
        """
        return cls(load_bundle(bundle_path(name)), backend)

    @cached_property
    def _look_alikes(self) -> Callable[[tuple[int, ...]], LookAlikes]:
        """Calibration turns after some rotations from the first view, in bins.

        The errors after them take longer to find than all else, so some are kept.
        """

        @lru_cache(maxsize=N_KEPT)
        def after(bins: tuple[int, ...]) -> LookAlikes:
            if not bins:
                return LookAlikes.of_views(self.bundle.distributions)
            return after(bins[:-1]).after(bins[-1])

        return after

    def crop(
        self,
        depth_m: ArrayLike,
        *,
        mask: ArrayLike | None = None,
        intrinsics: IntrinsicsLike = None,
        near_m: float | None = None,
        far_m: float | None = None,
    ) -> Crop:
        """Return what the network sees of a frame; parameters and errors as of `recommend`."""
        bundle = self.bundle
        depth, given, window = _in_window(np.asarray(depth_m), mask)
        camera = bundle.focal_px if intrinsics is None else intrinsics
        known = as_intrinsics([camera] if isinstance(camera, float) else camera)
        reach_m = REACH * bundle.diagonal_m
        need_metres(near_m, far_m, bundle.diagonal_m)
        if mask is None and far_m is None:
            need_plausible_nearest(depth, reach_m, bundle.diagonal_m, near_m)
        inside = object_mask(depth, reach_m, given, near_m, far_m)
        sizes = bundle.diagonal_m, bundle.extent_m
        return crop_frame(depth, inside, known, bundle.camera, *sizes, window)

    def distributions(self, codes: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return p(azimuth | image) (n, B) of crops (n, side, side)."""
        return distributions_of(self.network(codes), self.bundle.temperature)

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
        allowed_deg: ArrayLike | None = None,
        max_travel_deg: float = 180.0,
    ) -> Recommendation:
        """Return the pose that frames show, and the next view.

        A view from nearly the same place is no second view: what hides the pose there hides it
        again. So the next view is `MIN_SEPARATION_DEG` or more from every view so far.

        Parameters
        ----------
        depth_m : (rows, columns), or a sequence of such
            Depth in metres; NaN or 0 where nothing was measured. Whole numbers are millimetres.
        rotations_deg : sequence of float
            Where each frame was taken: degrees about the object from the first frame's place,
            counter-clockwise seen from above. The first is 0. Of one frame it may be a number.
        mask : (rows, columns), or a sequence of such, optional
            Not 0 where the object is. Without it the object is what lies nearest, or between
            `near_m` and `far_m`.
        intrinsics : Intrinsics, (fx, fy, cx, cy) or 3 × 3, optional
            Pixels; or a list of Intrinsics, one for each frame. Without it the focal length of the
            simulated sensor.
        near_m, far_m : float, optional
            Metres.
        elevation_deg : float, optional
            Of the camera above the object's base plane, where it is known.
        allowed_deg : array-like, optional
            Rotations from the last frame's place that the camera may take; all without it. An
            array of n booleans is a mask over the circle: entry k is the rotation 360 k / n.
        max_travel_deg : float

        Raises
        ------
        nbv.frames.errors.FrameError
            Where a frame cannot be used; it says why.
        UserError
            Where the arguments do not fit each other.

        Examples
        --------
        >>> import nbv
        >>> frame = nbv.example_frame()
        >>> answer = nbv.Recommender.load("mug").recommend(frame.depth_m, mask=frame.mask)
        >>> 0 <= answer.azimuth_deg < 360
        True
        """
        frames = _as_frames(depth_m)
        masks = _as_masks(mask, len(frames))
        cameras = _as_cameras(intrinsics, len(frames))
        rotations_deg = _as_rotations(rotations_deg, len(frames))
        crops = [
            self.crop(frame, mask=own, intrinsics=camera, near_m=near_m, far_m=far_m)
            for frame, own, camera in zip(frames, masks, cameras, strict=True)
        ]
        codes = np.stack([crop.codes for crop in crops])
        answer = self.recommend_crops(
            codes,
            rotations_deg,
            elevation_deg=elevation_deg,
            allowed_deg=allowed_deg,
            max_travel_deg=max_travel_deg,
        )
        doubts = (doubt for crop in crops for doubt in crop.doubts)
        return replace(answer, warnings=(*dict.fromkeys(doubts), *answer.warnings))

    def recommend_crops(
        self,
        codes: NDArray[np.uint8],
        rotations_deg: float | Sequence[float] = (0.0,),
        *,
        elevation_deg: float | None = None,
        allowed_deg: ArrayLike | None = None,
        max_travel_deg: float = 180.0,
    ) -> Recommendation:
        """Return what `recommend` does, of crops (n, side, side) uint8."""
        rotations_deg = _as_rotations(rotations_deg, len(codes))
        if elevation_deg is not None and not -90 <= elevation_deg <= 90:
            raise UserError(
                f"an elevation of {elevation_deg:g}°: it lies from -90 to 90, or give none"
            )
        logits = self.network(codes)
        distributions = distributions_of(logits, self.bundle.temperature)
        belief = fused(distributions, rotations_deg)
        n_bins = self.bundle.n_bins
        width = 360.0 / n_bins
        alike = self._look_alikes(
            tuple(round(rotation / width) % n_bins for rotation in rotations_deg[1:])
        )
        share = turn_share(self.bundle, elevation_deg)
        (now,), (after,) = alike.expected_error_deg(
            belief[None], **self.bundle.affinity, share=share
        )
        # From the frame of the first view to that of the last one.
        last = rotations_deg[-1]
        turn = round(last / width)
        error = np.roll(after, -turn)
        taken = np.asarray(rotations_deg) - last
        may = _reachable(n_bins, taken, allowed_deg, max_travel_deg)
        best, *others = _local_best(may, _between(error, may), width)
        error[~_is_near_bin(may, n_bins)] = np.inf
        unfamiliar = float(unfamiliarity(self.bundle.familiarity, codes, logits).max())
        bayes_factor = math.exp(log_bayes_factor(distributions, rotations_deg))
        return Recommendation(
            azimuth_deg=float(wrap_deg(mean_direction_deg(belief[None])[0] + last)),
            spread_deg=spread_deg(belief),
            expected_error_deg=float(now),
            move=best,
            alternatives=tuple(others),
            belief=turned(belief, -last),
            error_after_deg=error,
            unfamiliarity=unfamiliar,
            bayes_factor=bayes_factor,
            warnings=_warnings(unfamiliar, bayes_factor),
            crops=tuple(codes),
        )


def turn_share(bundle: Bundle, elevation_deg: float | None) -> NDArray[np.float64]:
    """Return how much each calibration turn (S,) counts for frames of an elevation, or of any."""
    known = float("nan") if elevation_deg is None else elevation_deg
    return bundle.turn_weight * elevation_share(bundle.elevation_deg, known)


def _warnings(unfamiliar: float, bayes_factor: float) -> tuple[str, ...]:
    found = []
    if unfamiliar > 1.0:
        found.append(
            f"a frame is like nothing that was calibrated ({unfamiliar:.1f} times the limit): "
            "check mask, units and category"
        )
    if bayes_factor < LEAST_BAYES_FACTOR:
        found.append(
            f"the frames contradict each other (Bayes factor {bayes_factor:.1g}): check the "
            "rotations and their sign (counter-clockwise seen from above), and that all frames "
            "are of one object"
        )
    return tuple(found)


def _in_window(
    depth_m: NDArray[Any], mask: ArrayLike | None
) -> tuple[DepthImage, ArrayLike | None, Window | None]:
    """Return depth in metres and the mask, in a window around it: most of a frame is not looked at.

    Without a mask that fits, or without depth in it, they are the whole frame's.
    """
    given = None if mask is None else np.asarray(mask)
    if given is not None and given.shape == depth_m.shape and depth_m.ndim == 2:
        is_given = given if given.dtype == np.bool_ else given != 0
        if is_given.any():
            window, place = window_of(is_given)
            part = to_metres(depth_m[place])
            if part.any():
                return part, is_given[place], window
    return to_metres(depth_m), given, None


def _as_rotations(rotations_deg: float | Sequence[float], n: int) -> list[float]:
    try:
        given = np.atleast_1d(np.asarray(rotations_deg, dtype=np.float64))
    except (TypeError, ValueError):
        raise FrameError("rotations", f"{rotations_deg!r} are no numbers of degrees") from None
    rotations = [float(rotation) for rotation in given.ravel()]
    if given.shape != (n,):
        raise FrameError(
            "rotations",
            f"{counted(n, 'frame')} and {counted(len(rotations), 'rotation')}; give one for each "
            "frame, from the first frame's place: 0, …",
        )
    if not all(math.isfinite(rotation) for rotation in rotations):
        raise FrameError("rotations", "one is no finite number of degrees")
    if rotations[0] != 0:
        raise FrameError("rotations", f"the first is {rotations[0]:g}; all count from it: 0")
    return rotations


def _as_frames(depth_m: ArrayLike | Sequence[ArrayLike]) -> list[NDArray[np.generic]]:
    if isinstance(depth_m, np.ndarray) and depth_m.ndim == 2:
        return [depth_m]
    if isinstance(depth_m, list | tuple) and depth_m and isinstance(depth_m[0], np.ndarray):
        return [np.asarray(frame) for frame in depth_m]
    values = np.asarray(depth_m)
    return list(values) if values.ndim == 3 and values.shape[2] > 4 else [values]


def _as_masks(mask: ArrayLike | Sequence[ArrayLike] | None, n: int) -> Sequence[ArrayLike | None]:
    if mask is None:
        return [None] * n
    is_one = isinstance(mask, np.ndarray) and (mask.ndim == 2 or mask.shape[2:] <= (4,))
    masks: list[ArrayLike] = [np.asarray(mask)] if is_one else list(mask)  # type: ignore[arg-type]
    if len(masks) != n:
        raise UserError(
            f"{counted(n, 'frame')} and {counted(len(masks), 'mask')}: give one for each frame"
        )
    return masks


def _as_cameras(
    intrinsics: IntrinsicsLike | Sequence[Intrinsics | None], n: int
) -> Sequence[IntrinsicsLike]:
    each = list(intrinsics) if isinstance(intrinsics, list | tuple) else []
    if not each or not all(one is None or isinstance(one, Intrinsics) for one in each):
        of_all: Any = intrinsics
        return [of_all] * n
    if len(each) != n:
        raise UserError(
            f"{counted(n, 'frame')} and {counted(len(each), 'camera')}: give intrinsics for all, "
            "or for each frame"
        )
    return each


def _reachable(
    n_bins: int, taken: NDArray[np.float64], allowed_deg: ArrayLike | None, max_travel_deg: float
) -> NDArray[np.float64]:
    """Return the rotations (m,) that the camera may take, in (-180, 180], by size in [0, 360).

    They are all bins, or those of `allowed_deg`, less what travels too far or is too near to a view
    that was `taken`.
    """
    if allowed_deg is None:
        rotation_deg = np.arange(n_bins) * (360.0 / n_bins)
    else:
        given = as_rotations(allowed_deg)
        rotation_deg = given[np.unique(wrap_deg(given), return_index=True)[1]]
    # A rotation that is in the range already keeps its bits.
    is_within = (rotation_deg > -180.0) & (rotation_deg <= 180.0)
    rotation_deg = np.where(is_within, rotation_deg, -signed_difference_deg(0.0, rotation_deg))
    apart = circular_distance_deg(rotation_deg[:, None], taken).min(axis=1)
    is_free = (apart >= MIN_SEPARATION_DEG) & (travel_deg(rotation_deg) <= max_travel_deg)
    may: NDArray[np.float64] = rotation_deg[is_free]
    if not may.size:
        raise UserError(
            "no rotation is allowed: widen --allowed or --max-travel; a view is "
            f"{MIN_SEPARATION_DEG:g}° or more from every view so far"
        )
    return may


def _between(error: NDArray[np.float64], rotation_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the errors (m,) at rotations, of those of the bins (B,); linear between bins."""
    bins = np.arange(len(error)) * (360.0 / len(error))
    return np.asarray(np.interp(rotation_deg, bins, error, period=360.0))


def _is_near_bin(rotation_deg: NDArray[np.float64], n_bins: int) -> NDArray[np.bool_]:
    """Return whether each bin is the nearest one of a rotation, (B,)."""
    near = np.zeros(n_bins, dtype=bool)
    near[nearest_bin(rotation_deg, n_bins)] = True
    return near


def _local_best(
    rotation_deg: NDArray[np.float64], error: NDArray[np.float64], width: float
) -> list[Move]:
    """Return the moves that are better than their neighbours within a bin's width, best first.

    Rotations are sorted by their place in [0, 360).
    """
    is_near = circular_distance_deg(np.roll(rotation_deg, -1), rotation_deg) <= width + 1e-9
    is_better = np.roll(error, -1) < error
    is_worse = np.roll(error, -1) > error
    beaten = (is_near & is_better) | np.roll(is_near & is_worse, 1)
    places = np.flatnonzero(~beaten)
    travel = np.abs(rotation_deg)
    order = places[np.lexsort((wrap_deg(rotation_deg[places]), travel[places], error[places]))]
    found: list[Move] = []
    for rotation, expected in zip(rotation_deg[order].tolist(), error[order].tolist(), strict=True):
        apart = (abs(rotation - one.rotation_deg) for one in found)
        if all(min(angle, 360.0 - angle) >= MIN_SEPARATION_DEG for angle in apart):
            found.append(Move(rotation, abs(rotation), expected))
        if len(found) > N_ALTERNATIVES:
            break
    return found
