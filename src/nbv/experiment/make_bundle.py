"""A bundle from a trained network and held-out turns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.logits import from_logits
from nbv.data.camera import Camera
from nbv.data.depth_images import DepthImages
from nbv.experiment.estimation.export import onnx_model
from nbv.experiment.estimation.weights import Estimator
from nbv.robot.bundle import Bundle
from nbv.robot.calibration import paper_tables, temperature_of
from nbv.robot.crop import pixel_step
from nbv.robot.network import Network, Sweep, mirrored_classes, open_network
from nbv.robot.ood import fit_ood
from nbv.robot.pairs import bin_apart

DEFAULT_FOCAL_PX = 600.0
"""Of a bundle whose training simulated no sensor."""

# Beyond the extents of calibration images: other objects, tilt and tables.
_MARGINS = (0.6, 1.5)


def bundled_model(estimator: Estimator, mirror_plane_deg: float | None = None) -> bytes:
    """Return a classifier as a bundle holds it: averaged over mirror images if there is a plane.

    Parameters
    ----------
    estimator : Estimator
    mirror_plane_deg : float, optional
        From `nbv.robot.network.find_mirror_plane`.
    """
    if mirror_plane_deg is None:
        return onnx_model(estimator)
    return onnx_model(
        estimator, mirrored_classes(estimator.settings["n_classes"], mirror_plane_deg)
    )


def bundled_network(estimator: Estimator, mirror_plane_deg: float | None = None) -> Network:
    """Return the network of `bundled_model`, as a robot will run it."""
    model = bundled_model(estimator, mirror_plane_deg)
    return open_network(model, estimator.image_side, estimator.settings["n_classes"])


def turns_of(
    network: Network,
    images: Sequence[DepthImages],
    elevations_deg: Sequence[float],
    object_ids: Sequence[str],
    step: int = 1,
) -> tuple[list[Sweep], float, float]:
    """Return the turns of some objects at every elevation, and the extent of what they show.

    Of each turn, every `step`-th view from the first on; the network sees no others.

    Returns
    -------
    list of Sweep
    float, float
        The least and the largest diagonal of an object's box in an image, pixels, of 98 % of
        these images.
    """
    turns, extents = [], []
    for elevation, of_elevation in zip(elevations_deg, images, strict=True):
        for object_id, whole in zip(object_ids, of_elevation.of(object_ids), strict=True):
            codes = whole[::step]
            logits = network(codes)
            azimuth_deg = np.arange(0, len(whole), step, dtype=np.float64) * (360.0 / len(whole))
            turns.append(
                Sweep(object_id, f"{elevation:g}", float(elevation), azimuth_deg, logits, codes)
            )
            extents.append(_extents(codes))
    low, high = np.quantile(np.concatenate(extents), (0.01, 0.99))
    return turns, float(low), float(high)


def _extents(codes: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the diagonal of the box around what each image shows, pixels, (n,)."""
    height, width = (_length(np.asarray((codes > 0).any(axis=axis))) for axis in (2, 1))
    return np.hypot(height, width)


def _length(seen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return from the first to the last true value of each row, both included, (n,)."""
    first, last = seen.argmax(axis=1), seen.shape[1] - seen[:, ::-1].argmax(axis=1)
    return np.where(seen.any(axis=1), last - first, 0).astype(np.float64)


def make_bundle(
    category: str,
    estimator: Estimator,
    turns: Sequence[Sweep],
    extent_px: tuple[float, float],
    *,
    mirror_plane_deg: float | None,
    camera: Camera,
    sensor: Mapping[str, Any],
    affinity: Mapping[str, float],
    provenance: Mapping[str, Any],
) -> Bundle:
    """Return a bundle.

    Parameters
    ----------
    category : str
    estimator : Estimator
        A classifier, trained on ``<object id>/<elevation>``.
    turns : sequence of Sweep
        Of calibration objects, which the estimator has not seen, by its `bundled_network` with
        the plane.
    extent_px : (float, float)
        From `turns_of`.
    mirror_plane_deg : float or None
        From `nbv.robot.network.find_mirror_plane`.
    camera : Camera
        That of the training.
    sensor : mapping
        The configuration's ``sensor``.
    affinity : mapping
        The configuration's ``affinity``.
    provenance : mapping
    """
    temperature = temperature_of(turns)
    # An object counts once; the estimator has it once for each elevation.
    n_objects = len({name.rpartition("/")[0] for name in estimator.trained_on})
    elevation_deg = np.array([turn.elevation_deg for turn in turns], dtype=np.float32)
    distributions = np.stack(
        [bin_apart(t.azimuth_deg, from_logits(t.logits, temperature)) for t in turns]
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
        object_ids=tuple(turn.object_id for turn in turns),
        elevation_deg=elevation_deg,
        sweep_weights=np.ones(len(turns), dtype=np.float32),
        distributions=distributions,
        affinity={key: affinity[key] for key in ("power", "pseudo_observations")},
        ood=fit_ood(turns),
        paper=paper_tables(elevation_deg, distributions),
        provenance=dict(provenance) | {"training_objects": n_objects},
    )
