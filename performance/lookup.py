"""One lookup table from calibration pairs: the project's against plain loops of the definition."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.evidence import gather_evidence
from nbv.core.circle.lookup import CostTable, build_lookup
from performance.figures import Figure, Target
from performance.settings import configuration
from performance.timing import median_ratio

TARGET = Target(200)
BANDWIDTH_DEG, PSEUDO_OBSERVATIONS = 8.0, 30.0

Rows = list[list[float]]


def run(quick: bool) -> list[Figure]:
    n_bins = 36 if quick else 360
    estimate_deg = calibration_estimates(20, n_bins)
    rng = np.random.default_rng(1)
    loops, own = [], []
    for _ in range(1 if quick else 5):
        sample = Sample(
            rows=rng.choice(n_bins, 2, replace=False).tolist(),
            deltas=rng.choice(n_bins, 1).tolist(),
            estimates=rng.choice(n_bins, 3, replace=False).tolist(),
        )
        start = time.perf_counter()
        table = _own(estimate_deg, n_bins)
        own.append(time.perf_counter() - start)
        loops.append(_loops(estimate_deg, n_bins, sample, table))
    detail = (
        f"{np.median(own):.2f} s against {np.median(loops):,.0f} s for {n_bins} bins and "
        f"{estimate_deg.size:,} pairs; the loops are timed on one rotation and three estimates, "
        "checked against the table, and scaled"
    )
    return [Figure("lookup table: plain loops", median_ratio(loops, own), TARGET, detail)]


@dataclass(frozen=True)
class Sample:
    """The part of the work that the loops do: rows of the density, rotations, estimates."""

    rows: Sequence[int]
    deltas: Sequence[int]
    estimates: Sequence[int]


def calibration_estimates(n_objects: int, n_views: int) -> NDArray[np.float64]:
    """Return estimates (n_objects, n_views) that are worst round 90 degrees."""
    rng = np.random.default_rng(0)
    azimuth = np.arange(n_views) * (360.0 / n_views)
    spread = 5.0 + 20.0 * np.exp(-(((azimuth - 90.0) / 40.0) ** 2))
    return (azimuth + rng.normal(0.0, spread, (n_objects, n_views))) % 360.0


def _own(estimate_deg: NDArray[np.float64], n_bins: int) -> CostTable:
    return build_lookup(
        gather_evidence(
            estimate_deg,
            configuration()["density"],
            bandwidth_deg=BANDWIDTH_DEG,
            pseudo_observations=PSEUDO_OBSERVATIONS,
            n_bins=n_bins,
        ),
        "pose_ambiguity",
    )


def _loops(
    estimate_deg: NDArray[np.float64], n_bins: int, sample: Sample, table: CostTable
) -> float:
    """Return the seconds that loops over numbers would take for the whole table."""
    estimates = estimate_deg.tolist()
    start = time.perf_counter()
    counts = _counts(estimates, n_bins)
    counted = time.perf_counter()
    smoothed = [_smoothed_row(counts, row) for row in sample.rows]
    smoothed_at = time.perf_counter()
    # The table has the other rows already; only their time is wanted.
    viewpoint: Rows = table.viewpoint_likelihood.astype(float).tolist()
    for row, values in zip(sample.rows, smoothed, strict=True):
        alpha = PSEUDO_OBSERVATIONS * 360 / n_bins
        mass = sum(values) + alpha
        expected = [(value + alpha / n_bins) / mass for value in values]
        np.testing.assert_allclose(viewpoint[row], expected, rtol=1e-4, atol=1e-7)
    total = counted - start + (smoothed_at - counted) / len(sample.rows) * n_bins
    for delta in sample.deltas:
        begun = time.perf_counter()
        poses = _pose_distributions(viewpoint, delta)
        prepared = time.perf_counter()
        ambiguities = [_entropy(_mixture(viewpoint[e], poses)) for e in sample.estimates]
        done = time.perf_counter()
        each = (done - prepared) / len(sample.estimates) * n_bins
        total += (prepared - begun + each) / len(sample.deltas) * n_bins
        np.testing.assert_allclose(
            table.cost[list(sample.estimates), delta], ambiguities, rtol=1e-3
        )
    return total


def _counts(estimates: Rows, n_bins: int) -> Rows:
    counts = [[0.0] * n_bins for _ in range(n_bins)]
    for views in estimates:
        for view, estimate in enumerate(views):
            column = round(view * n_bins / len(views)) % n_bins
            counts[math.floor(estimate * n_bins / 360 + 0.5) % n_bins][column] += 1.0
    return counts


def _smoothed_row(counts: Rows, row: int) -> list[float]:
    """Return one row of the counts smoothed along both axes, one axis after the other."""
    n_bins = len(counts)
    concentration = 1.0 / math.radians(BANDWIDTH_DEG) ** 2
    kernel = [
        math.exp(concentration * (math.cos(2 * math.pi * k / n_bins) - 1)) for k in range(n_bins)
    ]
    total = sum(kernel)
    kernel = [value / total for value in kernel]
    across = [
        sum(kernel[(row - other) % n_bins] * counts[other][column] for other in range(n_bins))
        for column in range(n_bins)
    ]
    return [
        sum(kernel[(column - other) % n_bins] * across[other] for other in range(n_bins))
        for column in range(n_bins)
    ]


def _pose_distributions(first: Rows, delta: int) -> Rows:
    """Return p(pose | viewpoint, delta), rows by viewpoint."""
    n_bins = len(first)
    poses = []
    for viewpoint in range(n_bins):
        second = first[(viewpoint + delta) % n_bins]
        row = [first[viewpoint][pose] * second[(pose + delta) % n_bins] for pose in range(n_bins)]
        total = sum(row)
        poses.append([value / total for value in row])
    return poses


def _mixture(weights: list[float], poses: Rows) -> list[float]:
    n_bins = len(weights)
    return [
        sum(weights[viewpoint] * poses[viewpoint][pose] for viewpoint in range(n_bins))
        for pose in range(n_bins)
    ]


def _entropy(distribution: list[float]) -> float:
    return -sum(p * math.log(p) for p in distribution if p > 0)
