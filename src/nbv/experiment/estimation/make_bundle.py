"""Bundles made from a trained network, as an ONNX model, and its outputs for held-out objects."""

from __future__ import annotations

import copy
import io
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn.utils import parametrize

from nbv.core.angles import mirrored_bins
from nbv.core.logits import from_logits
from nbv.data.camera import Camera
from nbv.data.depth_images import DepthImages
from nbv.experiment.estimation.weights import Estimator
from nbv.robot.bundle import Bundle
from nbv.robot.calibration import paper_tables, temperature_of
from nbv.robot.crop import pixel_step
from nbv.robot.network import Network, Sweep, open_network
from nbv.robot.ood import fit_ood
from nbv.robot.pairs import bin_apart

DEFAULT_FOCAL_PX = 600.0
"""The focal length of a bundle whose training simulated no sensor."""

# Factors beyond the extents of calibration images, for other objects, tilt and tables.
_MARGINS = (0.6, 1.5)


def bundled_model(estimator: Estimator, mirror_plane_deg: float | None = None) -> bytes:
    """Return the ONNX model of a bundle, averaged over mirror images if there is a mirror plane.

    Parameters
    ----------
    estimator : Estimator
    mirror_plane_deg : float, optional
        From `nbv.robot.network.find_mirror_plane`.
    """
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
    """Return the sweeps of objects at every elevation, and the objects' extent in the images.

    A sweep has every `step`-th view, from the first on.

    Returns
    -------
    list of Sweep
    float, float
        The 1 % and 99 % quantiles of the diagonal of an object's box in an image, pixels.
    """
    sweeps, extents = [], []
    for elevation, elevation_images in zip(elevations_deg, images, strict=True):
        for object_id, whole in zip(object_ids, elevation_images.of(object_ids), strict=True):
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
    category : str
    estimator : Estimator
        A classifier, trained on ``<object id>/<elevation>``.
    sweeps : sequence of Sweep
        Of calibration objects, which the estimator has not seen, by its `bundled_network`
        with the mirror plane.
    extent_px : (float, float)
        From `sweeps_of`.
    mirror_plane_deg : float or None
        From `nbv.robot.network.find_mirror_plane`.
    camera : Camera
        The camera of the training images.
    sensor : mapping
        The configuration's ``sensor``.
    affinity : mapping
        The configuration's ``affinity``.
    provenance : mapping
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


OPSET = 17


def onnx_model(estimator: Estimator, mirrored_classes: NDArray[np.intp] | None = None) -> bytes:
    """Return a classifier as an ONNX model; the same weights give the same bytes in any folder.

    Its input is ``codes`` (n, 1, side, side) float32: crops as depth codes, 0 to 255. Its outputs
    are ``logits`` (n, B) and ``hidden`` (n, H), the hidden layer for the crops as they are.
    Kernels and matrices are rounded to half precision, which halves the model's size; the model
    computes in single precision.

    Parameters
    ----------
    estimator : Estimator
        A classifier with B classes.
    mirrored_classes : ndarray (B,), optional
        The class that each class has in a mirror image. The logits are then the mean of those for
        a crop and for its mirror image; otherwise those for the crop.
    """
    network = cast(nn.Sequential, copy.deepcopy(estimator.network).cpu())
    for layer in list(network.modules()):
        if isinstance(layer, nn.Conv2d | nn.Linear):
            half = layer.weight.detach().half().contiguous()
            layer.weight = nn.Parameter(half, requires_grad=False)
            parametrize.register_parametrization(layer, "weight", _AsSingle(), unsafe=True)
    side, written = estimator.image_side, io.BytesIO()
    with warnings.catch_warnings():
        # The exporter that replaces this one writes the folder's path into the model.
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.onnx.export(
            _OnCodes(network, side, mirrored_classes).eval(),
            (torch.zeros(2, 1, side, side),),
            written,  # type: ignore[arg-type]  # torch's annotations lack it
            input_names=["codes"],
            output_names=["logits", "hidden"],
            dynamic_axes={name: {0: "n"} for name in ("codes", "logits", "hidden")},
            opset_version=OPSET,
            # It would write the weights in single precision.
            do_constant_folding=False,
            dynamo=False,
        )
    return written.getvalue()


class _AsSingle(nn.Module):
    def forward(self, weight: torch.Tensor) -> torch.Tensor:
        return weight.float()


class _OnCodes(nn.Module):
    """A network of `build_network` with the input and the outputs of `onnx_model`."""

    def __init__(
        self, network: nn.Sequential, image_side: int, mirrored_classes: NDArray[np.intp] | None
    ) -> None:
        super().__init__()
        self.to_hidden, self.to_logits = network[:-1], network[-1]
        self.side = image_side
        self.mirrored = None if mirrored_classes is None else torch.from_numpy(mirrored_classes)

    def forward(self, codes: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        if self.mirrored is not None:
            both = torch.stack([codes, codes.flip(-1)], dim=1)
            codes = both.reshape(-1, 1, self.side, self.side)
        # As `nbv.experiment.estimation.hardware.to_input` does.
        hidden = self.to_hidden(codes / 128)
        logits = self.to_logits(hidden)
        if self.mirrored is None:
            return logits, hidden
        own, other = logits.reshape(-1, 2, self.to_logits.out_features).unbind(1)
        mean = (own + other.index_select(1, self.mirrored)) / 2
        return mean, hidden.reshape(-1, 2, self.to_logits.in_features)[:, 0]
