"""Is a crop like anything that was calibrated? By what is seen, and by how sure the network is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from nbv.data.depth_codes import ZERO_CODE
from nbv.robot.sweeps import Turn

FAMILIAR_SHARE = 0.95
"""Of calibration crops: those that are familiar."""

N_COMPONENTS = 40
MOST_REFERENCES = 1500
NEIGHBOUR = 3
CELLS = 16
"""A crop is averaged over CELLS × CELLS squares; over its pixels where it has fewer."""


@dataclass(frozen=True)
class Familiarity:
    """What calibration crops are like.

    Attributes
    ----------
    mean : ndarray (F,) float32
        Of the features of calibration crops; see `crop_features`.
    basis : ndarray (F, q) float32
        Their principal components.
    references : ndarray (m, q) float32
        Calibration crops by these components.
    scales : ndarray (2, 2) float32
        Mean and standard deviation of the distance to the references, and of the energy.
    threshold : float
        The sum of both, each by its mean and standard deviation, that `FAMILIAR_SHARE` of
        calibration crops keep.
    """

    mean: NDArray[np.float32]
    basis: NDArray[np.float32]
    references: NDArray[np.float32]
    scales: NDArray[np.float32]
    threshold: float

    @cached_property
    def squares(self) -> NDArray[np.float32]:
        """The squared lengths of the references, (m,)."""
        return _squares(self.references)


def crop_features(codes: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return what is seen in each square of crops (n, side, side): its share, its depth, (n, F)."""
    n, side = codes.shape[:2]
    across = min(CELLS, side)
    step = side // across
    in_cell = _cells(side, across)
    images = np.empty((n, 2, side, side), dtype=np.float32)
    images[:, 0], images[:, 1] = codes > 0, codes
    features: NDArray[np.float32] = np.matmul(np.matmul(in_cell.T, images), in_cell)
    seen, depth = features[:, 0], features[:, 1]
    depth -= np.float32(ZERO_CODE) * seen
    depth /= np.maximum(seen, 1)
    seen *= np.float32(ZERO_CODE / step**2)
    return features.reshape(n, -1)


@cache
def _cells(side: int, across: int) -> NDArray[np.float32]:
    """Return a matrix of 0 and 1, products with which are sums over squares.

    They are exact for the whole numbers of crops.
    """
    is_in_cell = np.arange(side)[:, None] // (side // across) == np.arange(across)
    return np.asarray(is_in_cell, dtype=np.float32)


def fit_familiarity(turns: Sequence[Turn]) -> Familiarity:
    """Return what the crops of calibration turns are like.

    Distances are to crops of other objects, where there are two objects or more.

    Parameters
    ----------
    turns : sequence of Turn
    """
    every = max(1, sum(len(turn.codes) for turn in turns) // (3 * MOST_REFERENCES))
    features = np.concatenate([crop_features(turn.codes[::every]) for turn in turns])
    energies = energy(np.concatenate([turn.logits[::every] for turn in turns]))
    names = np.concatenate([[turn.object_id] * len(turn.codes[::every]) for turn in turns])
    mean = features.mean(axis=0)
    _, _, components = np.linalg.svd(features - mean, full_matrices=False)
    # As they are kept in a bundle.
    basis = components[:N_COMPONENTS].T.astype(np.float16).astype(np.float32)
    places = (features - mean) @ basis
    kept = np.arange(0, len(places), max(1, -(-len(places) // MOST_REFERENCES)))
    references = places[kept].astype(np.float16).astype(np.float32)
    apart = squared_distances(places, references, _squares(references))
    if len(set(names)) > 1:
        apart[names[:, None] == names[kept]] = np.inf
    distances = _to_neighbour(apart)
    scales = np.array([[x.mean(), x.std()] for x in (distances, energies)], dtype=np.float32)
    scales[:, 1] = np.maximum(scales[:, 1], 1e-6)
    sums = _in_scales(distances, energies, scales)
    threshold = max(float(np.quantile(sums, FAMILIAR_SHARE)), 1e-6)
    return Familiarity(mean, basis, references, scales, threshold)


def unfamiliarity(
    known: Familiarity, codes: NDArray[np.uint8], logits: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Return how far crops (n, side, side) with their logits (n, B) are from the calibration, (n,).

    0 or more; above 1 farther than `FAMILIAR_SHARE` of calibration crops. The energy is the
    negative log of the sum of exponentials of the logits (Liu et al., 2020); the distance is that
    to the third nearest reference (Sun et al., 2022).
    """
    places = np.matmul(crop_features(codes) - known.mean, known.basis)
    distances = _to_neighbour(squared_distances(places, known.references, known.squares))
    sums = _in_scales(distances, energy(logits), known.scales)
    return np.maximum(sums, 0.0) / known.threshold


def energy(logits: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the negative log of the sum of exponentials of logits (n, B), (n,)."""
    most = logits.max(axis=1, keepdims=True).astype(np.float64)
    return np.asarray(-(most[:, 0] + np.log(np.exp(logits - most).sum(axis=1))))


def squared_distances(
    places: NDArray[np.float32], references: NDArray[np.float32], squares: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the squared distance of each place (n, q) to each reference (m, q), (n, m).

    ``squares`` are the squared lengths of the references, (m,).
    """
    lengths = _squares(places)[:, None] + squares
    return np.asarray(np.maximum(lengths - 2 * places @ references.T, 0.0), dtype=np.float32)


def _squares(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray((rows**2).sum(axis=1))


def _to_neighbour(apart: NDArray[np.float32]) -> NDArray[np.float64]:
    number = min(NEIGHBOUR, apart.shape[1]) - 1
    return np.sqrt(np.partition(apart, number, axis=1)[:, number].astype(np.float64))


def _in_scales(
    distances: NDArray[np.float64], energies: NDArray[np.float64], scales: NDArray[np.float32]
) -> NDArray[np.float64]:
    (near, spread), (low, width) = scales.tolist()
    return np.asarray((distances - near) / spread + (energies - low) / width)
