"""Calibrate a bundle on held-out sweeps: temperature, distributions, tables and OOD threshold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.bundles.bundle import Bundle, PaperTables
from nbv.bundles.network import Sweep
from nbv.bundles.ood import IN_DISTRIBUTION_SHARE, ood_score
from nbv.core.circle.angles import wrap_deg
from nbv.core.circle.distributions import mean_direction_deg
from nbv.core.circle.logits import LEAST_PROBABILITY, fit_temperature, from_logits
from nbv.core.circle.offset import constant_offset_deg, frame_warning
from nbv.core.circle.selection import DENSITY, chosen_lookup
from nbv.core.circle.sweeps import bin_apart, full_sweep
from nbv.errors import UserError

ENOUGH_VIEWS = 24
"""Views of a sweep that suffice to fit one temperature, because neighbouring views are alike."""

PRIOR_SWEEPS = 30.0
"""Number of a camera's sweeps that count as much as all sweeps that a bundle was made with.

One sweep then counts as about twelve of the 352 of `mug`: docs/own-category.md.
"""

PAPER = "pose_ambiguity"


def temperature_of(sweeps: Sequence[Sweep]) -> float:
    """Return the temperature under which the true azimuths of all views are likeliest."""
    logits = np.concatenate([sweep.logits for sweep in sweeps]).astype(np.float64)
    azimuth_deg = np.concatenate([sweep.azimuth_deg for sweep in sweeps])
    return fit_temperature(logits, azimuth_deg)


def paper_tables(
    elevation_deg: NDArray[np.floating],
    distributions: NDArray[np.floating],
    density: Mapping[str, Any] = DENSITY,
) -> PaperTables:
    """Return the paper's lookup tables, one for each elevation rounded to a degree.

    The sweeps (S,) are at `elevation_deg`; the estimates are the mean directions of `distributions`
    (S, B, B), p(azimuth | image) of views a bin apart. `density` is that of
    `nbv.core.circle.selection.choose_densities`.
    """
    rounded = np.rint(elevation_deg)
    levels = np.unique(rounded)
    rotations = [_paper_rotations(distributions[rounded == level], density) for level in levels]
    return PaperTables(levels.astype(np.float32), np.stack(rotations))


def _paper_rotations(
    distributions: NDArray[np.floating], density: Mapping[str, Any]
) -> NDArray[np.int16]:
    """Return the rotations (360,) of the paper's lookup table for sweeps (S, B, B)."""
    n_bins = distributions.shape[-1]
    azimuth_deg = np.arange(n_bins) * (360.0 / n_bins)
    estimates = [full_sweep(azimuth_deg, mean_direction_deg(sweep)) for sweep in distributions]
    table = chosen_lookup(np.stack(estimates), PAPER, density)
    return table.recommended_delta_deg.astype(np.int16)


def without_offset(sweep: Sweep, temperature: float) -> Sweep:
    """Return a sweep whose azimuths are shifted by the constant offset of its estimates.

    An offset that all estimates share may be the zero of the turntable, and no further view
    corrects it. Where estimates do not follow azimuths (`frame_warning`), the sweep is returned
    unchanged.
    """
    estimate_deg = mean_direction_deg(from_logits(sweep.logits, temperature))
    if frame_warning(sweep.azimuth_deg, estimate_deg):
        return sweep
    offset_deg = constant_offset_deg(estimate_deg - sweep.azimuth_deg)
    return replace(sweep, azimuth_deg=wrap_deg(sweep.azimuth_deg + offset_deg))


def _binned(sweep: Sweep, temperature: float) -> NDArray[np.float32]:
    try:
        return bin_apart(sweep.azimuth_deg, from_logits(sweep.logits, temperature))
    except UserError as error:
        raise error.about(f"object {sweep.object_id!r}, sequence {sweep.sequence!r}") from error


def _joint_temperature(
    bundle: Bundle, sweeps: Sequence[Sweep], sweep_weights: NDArray[np.floating]
) -> float:
    """Return the likeliest temperature of n sweeps together with the bundle's own S.

    `sweep_weights` (n + S,) are the weights of whole sweeps, whatever their number of views.
    """
    views = slice(None, None, max(1, bundle.n_bins // ENOUGH_VIEWS))
    # Logits at the bundle's temperature, up to a constant for each view.
    prior = bundle.temperature * np.log(
        np.maximum(bundle.distributions[:, views], LEAST_PROBABILITY)
    )
    bins_deg = (np.arange(bundle.n_bins) * (360.0 / bundle.n_bins))[views]
    logits = [*(sweep.logits for sweep in sweeps), *prior]
    azimuth_deg = [*(sweep.azimuth_deg for sweep in sweeps), *(bins_deg for _ in prior)]
    view_weights = [
        np.full(len(angles), weight / len(angles))
        for angles, weight in zip(azimuth_deg, sweep_weights.tolist(), strict=True)
    ]
    return fit_temperature(
        np.concatenate(logits).astype(np.float64),
        np.concatenate(azimuth_deg),
        np.concatenate(view_weights),
    )


def recalibrated(
    bundle: Bundle, sweeps: Sequence[Sweep], origin: str, density: Mapping[str, Any] = DENSITY
) -> Bundle:
    """Return a bundle with the same network, calibrated on further sweeps, such as a camera's.

    Sweeps are used `without_offset`. The focal length of frames without intrinsics is theirs where
    it is known. The OOD threshold rises to theirs, but never falls: a few objects differ less from
    each other than from those of the category that a robot meets next. A sweep of unknown elevation
    counts for all elevations. `origin` is the source of the sweeps, for the provenance.

    One sweep or two are too few alone. So the bundle's own calibration sweeps stay, for the
    temperature too, and count together as much as `PRIOR_SWEEPS` of the new ones. Each of them
    keeps its weight of 1, also next to the pseudo-observations. Two calibrations in succession
    therefore weigh sweeps like one calibration with all of them.

    The paper's table of an elevation is made again if it is the nearest one of a new sweep. It is
    made of all sweeps nearest to it, new ones and the bundle's, each with weight 1.
    """
    n_made_with = bundle.provenance.get("turns_made_with", len(bundle.object_ids))
    sweeps = [without_offset(sweep, bundle.temperature) for sweep in sweeps]
    new_weights = np.full(len(sweeps), n_made_with / PRIOR_SWEEPS, dtype=np.float32)
    sweep_weights = np.concatenate([new_weights, bundle.sweep_weights])
    temperature = _joint_temperature(bundle, sweeps, sweep_weights)
    rows = np.stack([_binned(sweep, temperature) for sweep in sweeps])
    prior = bundle.distributions ** np.float32(bundle.temperature / temperature)
    prior /= prior.sum(axis=-1, keepdims=True)
    new_elevation_deg = np.array([sweep.elevation_deg for sweep in sweeps], dtype=np.float32)
    elevation_deg = np.concatenate([new_elevation_deg, bundle.elevation_deg])
    distributions = np.concatenate([rows, prior])
    tables = np.array([bundle.paper.table_index(elevation) for elevation in elevation_deg])
    rotations = bundle.paper.rotation_deg.copy()
    for table in np.unique(tables[: len(sweeps)]):
        rotations[table] = _paper_rotations(distributions[tables == table], density)
    scores = [ood_score(bundle.ood, sweep.codes, sweep.logits) for sweep in sweeps]
    focal_px = [sweep.focal_px for sweep in sweeps if np.isfinite(sweep.focal_px)]
    limit = max(float(np.quantile(np.concatenate(scores), IN_DISTRIBUTION_SHARE)), 1.0)
    return replace(
        bundle,
        focal_px=float(np.median(focal_px)) if focal_px else bundle.focal_px,
        temperature=temperature,
        object_ids=(*(sweep.object_id for sweep in sweeps), *bundle.object_ids),
        elevation_deg=elevation_deg,
        sweep_weights=sweep_weights,
        distributions=distributions,
        ood=replace(bundle.ood, threshold=limit * bundle.ood.threshold),
        paper=replace(bundle.paper, rotation_deg=rotations),
        provenance=dict(bundle.provenance)
        | {"calibrated_by": origin, "turns_made_with": n_made_with},
    )
