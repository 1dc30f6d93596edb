"""Commands for the estimates and distributions of an estimator of the user's own."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from nbv.cli.answers import (
    recommendation_as_json,
    say,
    say_json,
    say_offset,
    say_recommendation,
    say_target,
    say_warnings,
    table_answer_as_json,
    target_poses,
)
from nbv.cli.arguments import allowed_rotations
from nbv.errors import UserError, nearest
from nbv.labels import counted

if TYPE_CHECKING:
    from nbv.cli.answers import Place


def calibrate_table(source: Path, output: Path, criterion: str, *, as_json: bool) -> None:
    """Make the tables of calibration pairs; see ``nbv calibrate``."""
    import numpy as np

    from nbv.core.criteria import CRITERIA
    from nbv.core.distributions import mean_direction_deg
    from nbv.core.offset import FOR_PAIRS, Offset
    from nbv.core.selection import DENSITY, chosen_lookup
    from nbv.robot.distribution_table import DistributionTable
    from nbv.robot.pairs import PairTable

    if criterion not in CRITERIA:
        raise UserError(f"--criterion={criterion}: {nearest(criterion, CRITERIA)}")
    pairs = PairTable.load(source)
    estimates, turns = pairs.estimates.estimate_deg, pairs.distributions
    given = DistributionTable.from_pairs(turns) if turns else None
    lookup = chosen_lookup(estimates, criterion, DENSITY)
    if given is None:
        lookup.save(output)
    else:
        given.save(output, lookup)
    number = counted(len(estimates), "object")
    about = {"file": str(output), "criterion": criterion, "n_objects": len(estimates)}
    about |= asdict(pairs.offset)
    if not as_json:
        say_offset(str(source), number, pairs.offset)
        say(f"{output}: {criterion} from {number}")
    if given is not None:
        azimuth_deg, rows = (np.concatenate(parts) for parts in zip(*turns.values(), strict=True))
        offset = Offset.of(azimuth_deg, mean_direction_deg(rows), FOR_PAIRS)
        offset = replace(offset, warning=offset.warning or given.warning or None)
        about["distributions"] = {"temperature": given.temperature} | asdict(offset)
        if not as_json:
            classes = f"{given.n_classes} classes, temperature {given.temperature:.2f}"
            say_offset("distributions", classes, offset)
    if as_json:
        say_json(about)


def recommend_by_table(
    estimate: float | None,
    table: Path | None,
    allowed: list[float] | Path | None,
    max_travel: float,
    place: Place | None,
    *,
    as_json: bool,
) -> None:
    """Print the next views that a lookup table has for an estimate; see ``nbv recommend``."""
    if table is None or estimate is None:
        raise UserError("--estimate and --table belong together; or --distribution and --table")
    if not math.isfinite(estimate):
        raise UserError(f"--estimate={estimate:g}: give an azimuth in degrees")
    from nbv.core.criteria import cost_unit
    from nbv.core.lookup import LookupTable
    from nbv.files import calibrated_file
    from nbv.robot.moves import check_axis
    from nbv.robot.rotations import ranked_rotations

    path = calibrated_file(table)
    try:
        lookup = LookupTable.load(path)
    except UserError as error:
        raise UserError(
            f"--table={table}: no lookup table; give the .npz file that nbv calibrate wrote"
        ) from error
    warnings = () if place is None else check_axis(*place)
    unit = cost_unit(lookup.criterion, {"spread": lookup.spread})
    ranked = ranked_rotations(lookup, estimate, allowed_rotations(allowed), max_travel)
    targets = target_poses((rotation for rotation, _ in ranked), place)
    if as_json:
        say_json(table_answer_as_json(estimate, lookup.criterion, unit, ranked, warnings, targets))
        return
    unit = "" if unit == "1" else f" {unit}"
    (best, cost), *others = ranked
    say(
        f"turn the camera by {best:+g}°, travel {abs(best):g}° "
        f"({lookup.criterion} {cost:.3f}{unit})"
    )
    if others:
        told = (f"{rotation:+g}° ({cost:.3f})" for rotation, cost in others)
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
    followed: bool,
    as_json: bool,
) -> None:
    """Print the pose and the next view that distributions show; see ``nbv recommend``."""
    from nbv.files import calibrated_file
    from nbv.robot.distribution_table import DistributionTable
    from nbv.robot.moves import check_axis
    from nbv.robot.pairs import read_distributions

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
        followed=followed,
    )
    rolled = () if place is None else check_axis(*place)
    warnings = (*answer.warnings, *rolled)
    targets = target_poses((move.rotation_deg for move in answer.moves), place)
    if as_json:
        say_json(recommendation_as_json(answer, warnings, targets))
        return
    say_recommendation(answer, "object", warnings, targets)
