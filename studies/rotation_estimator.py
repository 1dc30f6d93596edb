"""An estimator of orientations: a classifier on a grid of poses.

It is trained and tested on depth images of objects in random orientations, the camera's roll
included. Log-likelihoods are of densities over the volume pi² of SO(3), as those of
Implicit-PDF (Murphy et al., 2021) are; the uniform density has -2.29.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from torch import nn

from nbv.core.circle.logits import likeliest_temperature, log_softmax, softmax
from nbv.core.orientations.group import VOLUME, Orientations, chordal_mean, spiral
from nbv.core.seeds import rng_for
from nbv.data.camera import Camera, viewpoint_frames
from nbv.data.depth_codes import encode_depth
from nbv.data.depth_images import Codes
from nbv.data.meshes import Surface
from nbv.data.render import Renderer
from nbv.experiment.estimation.hardware import Hardware
from nbv.experiment.estimation.networks import strided_network
from nbv.experiment.estimation.training import fit_network
from nbv.experiment.estimation.weights import Estimator

Array = NDArray[np.float64]

CONCENTRATION: Final = 50.0
"""Training targets are exp(concentration (cos(angle) - 1)) about the true pose: 8 degrees wide."""

NEAR_DEG: Final = 30.0
"""Poses nearer to the likeliest pose are averaged; the grid's are 15 degrees apart."""


def orientations_of(object_id: str, category: str, n: int, seed: int) -> Orientations:
    """Return the random orientations (n, 3, 3) in which an object is shown."""
    rng = rng_for(seed, "rotations", category, object_id)
    return np.asarray(Rotation.random(n, rng=rng).as_matrix())


def poses_of(orientations: Orientations, n_views: int) -> Orientations:
    """Return the poses (n, n_views, 3, 3), object to camera, that `oriented_views` shows."""
    right, up, forward = viewpoint_frames(0.0, _azimuths_deg(n_views))
    return np.asarray(np.stack([right, -up, forward], axis=1) @ orientations[:, None])


def oriented_views(
    mesh: Surface, orientations: Orientations, n_views: int, camera: Camera, renderer: Renderer
) -> Codes:
    """Return the depth codes (n * n_views, side, side) of an object in n orientations.

    The views of each orientation are evenly spaced on a level circle, so that one prepared mesh
    serves many images. Seen from the object, circle and roll are random where orientations are.
    """
    azimuths_deg, vertices = _azimuths_deg(n_views), np.asarray(mesh.vertices)
    depths = (
        renderer.render(vertices @ orientation.T, mesh.faces, 0.0, azimuths_deg, camera)
        for orientation in orientations
    )
    return np.concatenate([encode_depth(depth, camera) for depth in depths])


def _azimuths_deg(n_views: int) -> Array:
    return np.linspace(0.0, 360.0, n_views, endpoint=False)


def mirrored(poses: Orientations, plane_deg: float) -> Orientations:
    """Return the poses (..., 3, 3) that the mirror images of an object show.

    The object is its own mirror image in the vertical plane through the azimuth `plane_deg`.
    """
    angle = np.radians(plane_deg)
    normal = np.array([-np.sin(angle), np.cos(angle), 0.0])
    other_side = np.eye(3) - 2 * np.outer(normal, normal)
    return np.asarray(np.diag([-1.0, 1.0, 1.0]) @ poses @ other_side)


def train_orientations(
    codes: Codes,
    poses: Orientations,
    settings: Mapping[str, Any],
    hardware: Hardware,
    seed: int,
    plane_deg: float | None = None,
) -> Estimator:
    """Train a classifier on images (n, side, side) and their poses (n, 3, 3).

    Parameters
    ----------
    settings : mapping
        As in `nbv.experiment.estimation.training.train_network`; ``n_classes`` is the number of
        poses in the grid.
    plane_deg : float, optional
        With it, half of each batch are mirror images; see `mirrored`.
    """
    grid = _flat(spiral(settings["n_classes"])).to(hardware.device)

    def loss_of(outputs: torch.Tensor, pose: torch.Tensor) -> torch.Tensor:
        # The product of two matrices' entries sums to 1 + 2 cos(angle).
        target = torch.softmax(CONCENTRATION / 2 * (pose @ grid.T), dim=1)
        return nn.functional.cross_entropy(outputs, target)

    torch.manual_seed(seed)
    network = strided_network(settings, codes.shape[-1], settings["n_classes"])
    network.to(hardware.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    of_mirrored = None if plane_deg is None else _flat(mirrored(poses, plane_deg)).numpy()
    targets = _flat(poses).numpy()
    fit_network(network, codes, targets, loss_of, settings, hardware, seed, of_mirrored)
    return Estimator(network, settings, codes.shape[-1], ())


def _flat(poses: Orientations) -> torch.Tensor:
    return torch.from_numpy(poses.reshape(-1, 9).astype(np.float32))


@dataclass(frozen=True)
class Predictions:
    """Estimates of n images.

    Attributes
    ----------
    estimate : ndarray (n, 3, 3)
        The mean of the poses within `NEAR_DEG` of the likeliest.
    score : ndarray (n,)
        The probability of these poses.
    log_likelihood : ndarray (n,)
        Log density at the true pose.
    """

    estimate: Orientations
    score: Array
    log_likelihood: Array


def log_likelihood(logits: Array, truth: Orientations, temperature: float = 1.0) -> Array:
    """Return the log densities (n,) of logits (n, k) at true poses (n, 3, 3), per pi² of volume."""
    n, k = logits.shape
    cell = (truth.reshape(n, 9) @ spiral(k).reshape(k, 9).T).argmax(axis=1)
    of_cell = log_softmax(logits / temperature)[np.arange(n), cell]
    return np.asarray(of_cell + np.log(k / VOLUME))


def fit_orientation_temperature(logits: Array, truth: Orientations) -> float:
    """Fit the temperature of logits (n, k) to true poses (n, 3, 3) by maximum likelihood."""
    return likeliest_temperature(lambda t: float(log_likelihood(logits, truth, t).mean()))


def predictions(logits: Array, truth: Orientations, temperature: float) -> Predictions:
    """Return the predictions of logits (n, k) for images of true poses (n, 3, 3)."""
    k = logits.shape[1]
    grid = spiral(k)
    cosine = (np.tensordot(grid, grid, ((1, 2), (1, 2))) - 1) / 2
    p = softmax(logits / temperature)
    likeliest = (p @ np.exp(CONCENTRATION * (cosine - 1))).argmax(axis=1)
    p *= cosine[likeliest] > np.cos(np.radians(NEAR_DEG))
    at_truth = log_likelihood(logits, truth, temperature)
    return Predictions(chordal_mean(grid, p), p.sum(axis=1), at_truth)
