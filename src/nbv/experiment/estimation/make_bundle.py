"""Bundles made from a trained network and its outputs for held-out objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.bundles.bundle import Bundle
from nbv.bundles.calibration import paper_tables, temperature_of
from nbv.bundles.network import Network, Sweep, open_network
from nbv.bundles.ood import fit_ood
from nbv.core.circle.angles import mirrored_bins
from nbv.core.circle.logits import from_logits
from nbv.core.circle.sweeps import bin_apart
from nbv.data.camera import Camera
from nbv.data.depth_images import DepthImages
from nbv.experiment.estimation.export import onnx_model
from nbv.experiment.estimation.weights import Estimator
from nbv.frames.crop import pixel_step

DEFAULT_FOCAL_PX = 600.0
"""The focal length of a bundle whose training simulated no sensor."""

# Factors beyond the extents of calibration images, for other objects, tilt and tables.
_MARGINS = (0.6, 1.5)


def bundled_model(estimator: Estimator, mirror_plane_deg: float | None = None) -> bytes:
    """Return the ONNX model of a bundle, averaged over mirror images if there is a mirror plane."""
    if mirror_plane_deg is None:
        return onnx_model(estimator)
    return onnx_model(estimator, mirrored_bins(estimator.settings["n_classes"], mirror_plane_deg))


def bundled_network(estimator: Estimator, mirror_plane_deg: float | None = None) -> Network:
    """Return the network of `bundled_model` as a robot runs it."""
    model = bundled_model(estimator, mirror_plane_deg)
    return open_network(model, estimator.image_side, estimator.settings["n_classes"])


def sweeps_of(
    network: Network,
    images: Sequence[DepthImages],
    elevations_deg: Sequence[float],
    object_ids: Sequence[str],
    step: int = 1,
) -> tuple[list[Sweep], float, float]:
    """Return the sweeps of objects at elevations, and the objects' extent in the images.

    Objects that are not among an elevation's images have no sweep there. A sweep has every
    `step`-th view, from the first on.

    Returns
    -------
    list of Sweep
    float, float
        The 1 % and 99 % quantiles of the diagonal of an object's box in an image, pixels.
    """
    sweeps, extents = [], []
    for elevation, elevation_images in zip(elevations_deg, images, strict=True):
        seen = [name for name in object_ids if name in elevation_images.object_ids]
        for object_id, whole in zip(seen, elevation_images.of(seen), strict=True):
            codes = whole[::step]
            logits = network(codes)
            azimuth_deg = np.arange(0, len(whole), step, dtype=np.float64) * (360.0 / len(whole))
            sweeps.append(
                Sweep(object_id, f"{elevation:g}", float(elevation), azimuth_deg, logits, codes)
            )
            extents.append(_extents(codes))
    low, high = np.quantile(np.concatenate(extents), (0.01, 0.99))
    return sweeps, float(low), float(high)


def _extents(codes: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the diagonal of the object's box in each image, pixels, (n,)."""
    height, width = (_length(np.asarray((codes > 0).any(axis=axis))) for axis in (2, 1))
    return np.hypot(height, width)


def _length(visible: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the length from the first to the last true value of each row, inclusive, (n,)."""
    first, last = visible.argmax(axis=1), visible.shape[1] - visible[:, ::-1].argmax(axis=1)
    return np.where(visible.any(axis=1), last - first, 0).astype(np.float64)


def make_bundle(
    category: str,
    estimator: Estimator,
    sweeps: Sequence[Sweep],
    extent_px: tuple[float, float],
    *,
    mirror_plane_deg: float | None,
    camera: Camera,
    sensor: Mapping[str, Any],
    affinity: Mapping[str, float],
    provenance: Mapping[str, Any],
) -> Bundle:
    """Return the bundle of a category.

    Parameters
    ----------
    estimator : Estimator
        A classifier, trained on ``<object id>/<elevation>``.
    sweeps : sequence of Sweep
        Sweeps of calibration objects, which the estimator has not seen, with the logits of its
        `bundled_network` with the mirror plane.
    extent_px : (float, float)
        From `sweeps_of`.
    mirror_plane_deg : float or None
        From `nbv.bundles.network.find_mirror_plane`.
    camera : Camera
        The camera of the training images.
    sensor : mapping
        The configuration's ``sensor``.
    affinity : mapping
        The configuration's ``affinity``.
    """
    temperature = temperature_of(sweeps)
    # The estimator lists each object once for every elevation.
    n_objects = len({name.rpartition("/")[0] for name in estimator.trained_on})
    elevation_deg = np.array([sweep.elevation_deg for sweep in sweeps], dtype=np.float32)
    distributions = np.stack(
        [bin_apart(s.azimuth_deg, from_logits(s.logits, temperature)) for s in sweeps]
    )
    diagonal_m = float(sensor["diagonal_m"][category])
    length_m = pixel_step(camera) * diagonal_m
    low, high = (share * side * length_m for share, side in zip(_MARGINS, extent_px, strict=True))
    return Bundle(
        category=category,
        network=bundled_model(estimator, mirror_plane_deg),
        estimator=estimator.settings,
        camera=camera,
        diagonal_m=diagonal_m,
        extent_m=(low, high),
        focal_px=float(sensor["parameters"].get("focal_px", DEFAULT_FOCAL_PX)),
        mirror_plane_deg=mirror_plane_deg,
        temperature=temperature,
        object_ids=tuple(sweep.object_id for sweep in sweeps),
        elevation_deg=elevation_deg,
        sweep_weights=np.ones(len(sweeps), dtype=np.float32),
        distributions=distributions,
        affinity={key: affinity[key] for key in ("power", "pseudo_observations")},
        ood=fit_ood(sweeps),
        paper=paper_tables(elevation_deg, distributions),
        provenance=dict(provenance) | {"training_objects": n_objects},
    )
