"""Out-of-distribution (OOD) score: distance to calibration crops, and the network's energy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from nbv.bundles.network import Sweep
from nbv.data.depth_codes import ZERO_CODE

IN_DISTRIBUTION_SHARE = 0.95
"""Share of calibration crops with a score of at most 1."""

N_COMPONENTS = 40
MOST_REFERENCES = 1500
NEIGHBOUR = 3
CELLS = 16
"""A crop is averaged over CELLS × CELLS cells, or over its pixels if it has fewer."""


@dataclass(frozen=True)
class OodModel:
    """Reference crops and the scales of the score.

    Attributes
    ----------
    mean : ndarray (F,) float32
        Mean of the features of calibration crops; see `crop_features`.
    basis : ndarray (F, q) float32
        Their principal components.
    references : ndarray (m, q) float32
        Calibration crops in this basis.
    scales : ndarray (2, 2) float32
        Mean and standard deviation of the distance to the references, then of the energy.
    threshold : float
        The sum of the standardised distance and energy that `IN_DISTRIBUTION_SHARE` of
        calibration crops do not exceed.
    """

    mean: NDArray[np.float32]
    basis: NDArray[np.float32]
    references: NDArray[np.float32]
    scales: NDArray[np.float32]
    threshold: float

    @cached_property
    def squares(self) -> NDArray[np.float32]:
        """Squared lengths of the references, (m,)."""
        return _squares(self.references)


def crop_features(codes: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return features (n, F) of crops (n, side, side): each cell's visible share and mean depth."""
    n, side = codes.shape[:2]
    n_cells = min(CELLS, side)
    step = side // n_cells
    in_cell = _cells(side, n_cells)
    images = np.empty((n, 2, side, side), dtype=np.float32)
    images[:, 0], images[:, 1] = codes > 0, codes
    features: NDArray[np.float32] = np.matmul(np.matmul(in_cell.T, images), in_cell)
    visible, depth = features[:, 0], features[:, 1]
    depth -= np.float32(ZERO_CODE) * visible
    depth /= np.maximum(visible, 1)
    visible *= np.float32(ZERO_CODE / step**2)
    return features.reshape(n, -1)


def _cells(side: int, n_cells: int) -> NDArray[np.float32]:
    """Return a matrix (side, n_cells) of 0 and 1 that sums pixels over cells when multiplied.

    The sums are exact for the integers of crops.
    """
    is_in_cell = np.arange(side)[:, None] // (side // n_cells) == np.arange(n_cells)
    return np.asarray(is_in_cell, dtype=np.float32)


def fit_ood(sweeps: Sequence[Sweep]) -> OodModel:
    """Fit the score to calibration sweeps.

    With two objects or more, distances are to crops of other objects.
    """
    every = max(1, sum(len(sweep.codes) for sweep in sweeps) // (3 * MOST_REFERENCES))
    features = np.concatenate([crop_features(sweep.codes[::every]) for sweep in sweeps])
    energies = energy(np.concatenate([sweep.logits[::every] for sweep in sweeps]))
    names = np.concatenate([[sweep.object_id] * len(sweep.codes[::every]) for sweep in sweeps])
    mean = features.mean(axis=0)
    _, _, components = np.linalg.svd(features - mean, full_matrices=False)
    # Rounded as in a bundle's file.
    basis = components[:N_COMPONENTS].T.astype(np.float16).astype(np.float32)
    points = (features - mean) @ basis
    kept = np.arange(0, len(points), max(1, -(-len(points) // MOST_REFERENCES)))
    references = points[kept].astype(np.float16).astype(np.float32)
    squared = squared_distances(points, references, _squares(references))
    if len(set(names)) > 1:
        squared[names[:, None] == names[kept]] = np.inf
    distances = _neighbour_distance(squared)
    scales = np.array([[x.mean(), x.std()] for x in (distances, energies)], dtype=np.float32)
    scales[:, 1] = np.maximum(scales[:, 1], 1e-6)
    sums = _standardised_sum(distances, energies, scales)
    threshold = max(float(np.quantile(sums, IN_DISTRIBUTION_SHARE)), 1e-6)
    return OodModel(mean, basis, references, scales, threshold)


def ood_score(
    model: OodModel, codes: NDArray[np.uint8], logits: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Return the out-of-distribution score (n,) of crops (n, side, side) with logits (n, B).

    The score is 0 or more; `IN_DISTRIBUTION_SHARE` of calibration crops have at most 1. It adds
    the energy, which is the negative log of the sum of exponentials of the logits (Liu et al.,
    2020), and the distance to the third nearest reference (Sun et al., 2022).
    """
    points = np.matmul(crop_features(codes) - model.mean, model.basis)
    distances = _neighbour_distance(squared_distances(points, model.references, model.squares))
    sums = _standardised_sum(distances, energy(logits), model.scales)
    return np.maximum(sums, 0.0) / model.threshold


def energy(logits: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the negative log of the sum of exponentials of logits (n, B), (n,)."""
    most = logits.max(axis=1, keepdims=True).astype(np.float64)
    return np.asarray(-(most[:, 0] + np.log(np.exp(logits - most).sum(axis=1))))


def squared_distances(
    points: NDArray[np.float32], references: NDArray[np.float32], squares: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the squared distances (n, m) between points (n, q) and references (m, q).

    `squares` (m,) are the squared lengths of the references.
    """
    lengths = _squares(points)[:, None] + squares
    return np.asarray(np.maximum(lengths - 2 * points @ references.T, 0.0), dtype=np.float32)


def _squares(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray((rows**2).sum(axis=1))


def _neighbour_distance(squared: NDArray[np.float32]) -> NDArray[np.float64]:
    number = min(NEIGHBOUR, squared.shape[1]) - 1
    return np.sqrt(np.partition(squared, number, axis=1)[:, number].astype(np.float64))


def _standardised_sum(
    distances: NDArray[np.float64], energies: NDArray[np.float64], scales: NDArray[np.float32]
) -> NDArray[np.float64]:
    (mean_distance, distance_std), (mean_energy, energy_std) = scales.tolist()
    return np.asarray(
        (distances - mean_distance) / distance_std + (energies - mean_energy) / energy_std
    )
