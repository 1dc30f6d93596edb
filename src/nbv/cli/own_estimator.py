"""Commands for the estimates and distributions of an estimator of the user's own."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from nbv.cli.answers import (
    offset_of_pairs,
    recommendation_as_json,
    say,
    say_json,
    say_offset,
    say_recommendation,
    say_target,
    say_warnings,
    target_poses,
    with_targets,
)
from nbv.cli.arguments import SHIPPED, allowed_rotations
from nbv.errors import UserError, nearest
from nbv.labels import counted

if TYPE_CHECKING:
    from nbv.cli.answers import Place


def calibrate_table(source: Path, output: Path, criterion: str, *, as_json: bool) -> None:
    """Make the tables of calibration pairs; see ``nbv calibrate``."""
    import numpy as np

    from nbv.core.criteria import CRITERIA
    from nbv.core.distributions import mean_direction_deg
    from nbv.core.lookup import save_lookup
    from nbv.core.selection import chosen_lookup
    from nbv.robot.calibration import DENSITY
    from nbv.robot.distribution_table import DistributionTable
    from nbv.robot.pair_distributions import read_pair_distributions
    from nbv.robot.pairs import read_pair_rows, read_pairs
    from nbv.robot.recordings import is_manifest

    if criterion not in CRITERIA:
        raise UserError(f"--criterion={criterion}: {nearest(criterion, CRITERIA)}")
    try:
        estimates = read_pairs(source).estimate_deg
    except UserError as error:
        if not is_manifest(source):
            raise
        raise UserError(
            f"{source} is a manifest of frames, which need --bundle, for instance --bundle "
            f"{SHIPPED}, and an --output that ends in .safetensors"
        ) from error
    turns = read_pair_distributions(source)
    given = DistributionTable.of_pairs(turns) if turns else None
    lookup = chosen_lookup(estimates, criterion, DENSITY)
    save_lookup(output, lookup, given.arrays() if given else None)
    pairs = read_pair_rows(source)
    offset = offset_of_pairs(pairs["azimuth_deg"].to_numpy(), pairs["estimate_deg"].to_numpy())
    number = counted(len(estimates), "object")
    about = {"file": str(output), "criterion": criterion, "n_objects": len(estimates)} | offset
    if given is None:
        if as_json:
            say_json(about)
            return
        say_offset(str(source), number, offset)
        say(f"{output}: {criterion} from {number}")
        return
    azimuths, rows = (np.concatenate(parts) for parts in zip(*turns.values(), strict=True))
    of_means = offset_of_pairs(azimuths, mean_direction_deg(rows))
    of_means["warning"] = of_means["warning"] or given.warning or None
    if as_json:
        about["distributions"] = {"temperature": given.temperature} | of_means
        say_json(about)
        return
    say_offset(str(source), number, offset)
    say(f"{output}: {criterion} from {number}")
    classes = f"{rows.shape[1]} classes, temperature {given.temperature:.2f}"
    say_offset("distributions", classes, of_means)


def recommend_by_table(
    estimate: float | None,
    table: Path | None,
    allowed: list[float] | Path | None,
    max_travel: float,
    place: Place | None,
    *,
    as_json: bool,
) -> None:
    """Say the next views that a lookup table has for an estimate; see ``nbv recommend``."""
    if table is None or estimate is None:
        raise UserError("--estimate and --table belong together; or --distribution and --table")
    if not math.isfinite(estimate):
        raise UserError(f"--estimate={estimate:g}: give an azimuth in degrees")
    from nbv.core.criteria import cost_unit
    from nbv.core.lookup import load_lookup
    from nbv.files import calibrated_file
    from nbv.robot.moves import check_axis
    from nbv.robot.rotations import ranked_rotations

    path = calibrated_file(table)
    try:
        lookup = load_lookup(path)
    except UserError as error:
        raise UserError(
            f"--table={table}: no lookup table; give the .npz file that nbv calibrate wrote"
        ) from error
    warnings = () if place is None else check_axis(*place)
    unit = cost_unit(lookup.criterion, {"spread": lookup.spread})
    found = [
        {"rotation_deg": rotation, "travel_deg": abs(rotation), "cost": cost}
        for rotation, cost in ranked_rotations(
            lookup, estimate, allowed_rotations(allowed), max_travel
        )
    ]
    targets = target_poses((move["rotation_deg"] for move in found), place)
    moves = with_targets(found, targets)
    if as_json:
        about = {"criterion": lookup.criterion, "cost_unit": unit, "warnings": list(warnings)}
        say_json({"estimate_deg": estimate} | moves[0] | about | {"alternatives": moves[1:]})
        return
    unit = "" if unit == "1" else f" {unit}"
    best, *others = moves
    say(
        f"turn the camera by {best['rotation_deg']:+g}°, travel {best['travel_deg']:g}° "
        f"({lookup.criterion} {best['cost']:.3f}{unit})"
    )
    if others:
        told = (f"{move['rotation_deg']:+g}° ({move['cost']:.3f})" for move in others)
        say(f"or {', '.join(told)}")
    say_warnings(warnings)
    say_target(targets)


def recommend_by_distributions(
    distribution: Path,
    table: Path | None,
    rotations: list[float] | None,
    allowed: list[float] | Path | None,
    max_travel: float,
    place: Place | None,
    *,
    as_json: bool,
) -> None:
    """Say the pose and the next view that distributions show; see ``nbv recommend``."""
    from nbv.files import calibrated_file
    from nbv.robot.distribution_table import DistributionTable
    from nbv.robot.moves import check_axis
    from nbv.robot.pair_distributions import read_distributions

    if table is None:
        raise UserError("--distribution and --table belong together")
    path = calibrated_file(table)
    try:
        known = DistributionTable.load(path)
    except UserError as error:
        raise UserError(
            f"--table={table}: no table of distributions; give the .npz file that nbv calibrate "
            "made of pairs with columns p0, p1, …"
        ) from error
    answer = known.recommend(
        read_distributions(distribution),
        rotations if rotations is not None else [0.0],
        allowed_deg=allowed_rotations(allowed),
        max_travel_deg=max_travel,
    )
    if place is not None:
        answer = replace(answer, warnings=(*answer.warnings, *check_axis(*place)))
    targets = target_poses((move.rotation_deg for move in answer.moves), place)
    if as_json:
        say_json(recommendation_as_json(answer, None, targets))
        return
    say_recommendation(answer, "object", targets)
