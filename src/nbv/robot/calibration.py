"""What held-out turns teach about a network: temperature, distributions, what is familiar."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.angles import wrap_deg
from nbv.core.distributions import mean_direction_deg
from nbv.core.logits import LEAST_PROBABILITY, fit_temperature, from_logits
from nbv.core.offset import constant_offset_deg, frame_warning
from nbv.core.selection import chosen_lookup
from nbv.errors import UserError
from nbv.robot.bundle import Bundle, PaperTables
from nbv.robot.ood import FAMILIAR_SHARE, unfamiliarity
from nbv.robot.pairs import bin_apart, full_turn
from nbv.robot.sweeps import Turn

ENOUGH_VIEWS = 24
"""Of a turn, to fit one number by: neighbouring views say the same."""

LEAST_LIMIT = 0.5
"""Of unfamiliarity, where a camera's own frames are all very familiar."""

PRIOR_TURNS = 30.0
"""So many turns of a camera count as much as all turns that a bundle was made with.

One turn then counts as about four of the 125 of `mug`: docs/turntable.md.
"""

PAPER = "pose_ambiguity"

DENSITY: Mapping[str, Any] = {
    "pose_likelihood": "given_estimate",
    "spread": "entropy",
    "bandwidths_deg": [4, 6, 8, 12, 16],
    "pseudo_observations": [3, 10, 30, 100],
    "n_parts": 5,
    "travel_cost": 0.0,
    "max_travel_deg": 180.0,
}
"""What `config/` sets for the paper's method."""


def temperature_of(turns: Sequence[Turn]) -> float:
    """Return the temperature under which the true azimuths of all views are likeliest."""
    logits = np.concatenate([turn.logits for turn in turns]).astype(np.float64)
    azimuth_deg = np.concatenate([turn.azimuth_deg for turn in turns])
    return fit_temperature(logits, azimuth_deg)


def paper_tables(
    elevation_deg: NDArray[np.floating],
    distributions: NDArray[np.floating],
    density: Mapping[str, Any] = DENSITY,
) -> PaperTables:
    """Return the paper's lookup tables of turns, one for each elevation to the nearest degree.

    Parameters
    ----------
    elevation_deg : ndarray (S,)
        Of each turn.
    distributions : ndarray (S, B, B)
        p(azimuth | image) of views a bin apart. Their mean directions are the estimates.
    density : mapping
        See `nbv.core.selection.choose_densities`.
    """
    of_turn = np.rint(elevation_deg)
    levels = np.unique(of_turn)
    rotations = [_paper_rotations(distributions[of_turn == level], density) for level in levels]
    return PaperTables(levels.astype(np.float32), np.stack(rotations))


def _paper_rotations(
    distributions: NDArray[np.floating], density: Mapping[str, Any]
) -> NDArray[np.int16]:
    """Return what the paper's lookup table of some turns (S, B, B) recommends, (360,)."""
    n_bins = distributions.shape[-1]
    azimuth_deg = np.arange(n_bins) * (360.0 / n_bins)
    estimates = [full_turn(azimuth_deg, mean_direction_deg(turn)) for turn in distributions]
    table = chosen_lookup(np.stack(estimates), PAPER, density)
    return table.recommended_delta_deg.astype(np.int16)


def without_offset(turn: Turn, temperature: float) -> Turn:
    """Return a turn whose azimuths count from the zero of its estimates at a temperature.

    What all estimates have in common may be the zero of the turntable, and no view mends it. Where
    estimates do not follow azimuths (`frame_warning`), the turn stays as it is.
    """
    estimate_deg = mean_direction_deg(from_logits(turn.logits, temperature))
    if frame_warning(turn.azimuth_deg, estimate_deg):
        return turn
    offset_deg = constant_offset_deg(estimate_deg - turn.azimuth_deg)
    return replace(turn, azimuth_deg=wrap_deg(turn.azimuth_deg + offset_deg))


def _bins_of(turn: Turn, temperature: float) -> NDArray[np.float32]:
    try:
        return bin_apart(turn.azimuth_deg, from_logits(turn.logits, temperature))
    except UserError as error:
        raise error.about(f"object {turn.object_id!r}, sequence {turn.sequence!r}") from error


def _temperature_with_own(
    bundle: Bundle, turns: Sequence[Turn], turn_weight: NDArray[np.floating]
) -> float:
    """Return the likeliest temperature of n turns and of a bundle's own S.

    Each counts as given (n + S,), however many views it has.
    """
    views = slice(None, None, max(1, bundle.n_bins // ENOUGH_VIEWS))
    # At the bundle's temperature; the logits but for a constant of each view.
    own = bundle.temperature * np.log(np.maximum(bundle.distributions[:, views], LEAST_PROBABILITY))
    bins_deg = (np.arange(bundle.n_bins) * (360.0 / bundle.n_bins))[views]
    logits = [*(turn.logits for turn in turns), *own]
    azimuth_deg = [*(turn.azimuth_deg for turn in turns), *(bins_deg for _ in own)]
    weight = [
        np.full(len(angles), count / len(angles))
        for angles, count in zip(azimuth_deg, turn_weight.tolist(), strict=True)
    ]
    return fit_temperature(
        np.concatenate(logits).astype(np.float64),
        np.concatenate(azimuth_deg),
        np.concatenate(weight),
    )


def recalibrated(
    bundle: Bundle, turns: Sequence[Turn], origin: str, density: Mapping[str, Any] = DENSITY
) -> Bundle:
    """Return a bundle with the same network, calibrated by other turns, such as those of a camera.

    Each turn counts `without_offset`.

    The familiar range and, where it is known, the focal length of frames without intrinsics are
    those of the turns. The bundle's own calibration turns stay, and count together as much as
    `PRIOR_TURNS` of the others, for the temperature too: a turn or two say too little alone. They
    keep their weight, 1 each, and with it their weight next to the pseudo-observations. So two
    calibrations one after the other weigh turns as one with all. A turn of
    unknown elevation counts for all. The paper's table of an elevation is made again where one of
    the turns is nearest to it, of those and the bundle's, each of which counts once.

    Parameters
    ----------
    bundle : Bundle
    turns : sequence of Turn
    origin : str
        Where the turns come from, for the provenance.
    density : mapping
        See `paper_tables`.
    """
    n_made_with = bundle.provenance.get("turns_made_with", len(bundle.object_ids))
    turns = [without_offset(turn, bundle.temperature) for turn in turns]
    of_each = np.full(len(turns), n_made_with / PRIOR_TURNS, dtype=np.float32)
    turn_weight = np.concatenate([of_each, bundle.turn_weight])
    temperature = _temperature_with_own(bundle, turns, turn_weight)
    rows = np.stack([_bins_of(turn, temperature) for turn in turns])
    prior = bundle.distributions ** np.float32(bundle.temperature / temperature)
    prior /= prior.sum(axis=-1, keepdims=True)
    of_turns = np.array([turn.elevation_deg for turn in turns], dtype=np.float32)
    elevation_deg = np.concatenate([of_turns, bundle.elevation_deg])
    distributions = np.concatenate([rows, prior])
    of_table = np.array([bundle.paper.table_of(elevation) for elevation in elevation_deg])
    rotations = bundle.paper.rotation_deg.copy()
    for table in np.unique(of_table[: len(turns)]):
        rotations[table] = _paper_rotations(distributions[of_table == table], density)
    known = bundle.familiarity
    scores = [unfamiliarity(known, turn.codes, turn.logits) for turn in turns]
    focal_px = [turn.focal_px for turn in turns if np.isfinite(turn.focal_px)]
    limit = max(float(np.quantile(np.concatenate(scores), FAMILIAR_SHARE)), LEAST_LIMIT)
    return replace(
        bundle,
        focal_px=float(np.median(focal_px)) if focal_px else bundle.focal_px,
        temperature=temperature,
        object_ids=(*(turn.object_id for turn in turns), *bundle.object_ids),
        elevation_deg=elevation_deg,
        turn_weight=turn_weight,
        distributions=distributions,
        familiarity=replace(known, threshold=limit * known.threshold),
        paper=replace(bundle.paper, rotation_deg=rotations),
        provenance=dict(bundle.provenance)
        | {"calibrated_by": origin, "turns_made_with": n_made_with},
    )
