"""Compare expected with real errors of bundles: expected_errors.py BUNDLES > expected_errors.csv.

Each calibration object is left out once and serves as the test object: with one view, with two
after the recommended rotation, and with three. See docs/bundles.md, how the next view is chosen.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.angles import circular_distance_deg
from nbv.core.distributions import mean_direction_deg, product_of_views
from nbv.robot.bundle import Bundle
from nbv.robot.next_view import AfterRotations, after_rotations, next_view
from nbv.robot.recommender import Recommender
from nbv.robot.rotations import MIN_SEPARATION_DEG

EVERY = 5
"""Bins between the first views of a sweep."""

LEFT_OUT = 1e-12
"""Weight of the object that is left out, because a weight has to be above 0."""

N_CACHED = 160
"""Number of rotations whose errors are cached; `mug` has 120, 4 MB each."""


def sweep_errors(
    bundle: Bundle, calibrated: AfterRotations, sweep: int, *, is_given: bool
) -> Iterator[dict[str, float]]:
    """Yield expected and real errors from each first view of a sweep, without its object."""
    rows = bundle.distributions[sweep].astype(np.float64)
    width = 360.0 / bundle.n_bins
    is_other = np.array(bundle.object_ids) != bundle.object_ids[sweep]
    elevation_deg = float(bundle.elevation_deg[sweep]) if is_given else None
    weights = bundle.weights_at(elevation_deg) * is_other + LEFT_OUT
    for first in range(sweep % EVERY, bundle.n_bins, EVERY):

        def take(rotations: list[float], first: int = first) -> tuple[NDArray[np.float64], float]:
            bins = [(first + round(rotation / width)) % bundle.n_bins for rotation in rotations]
            views = rows[bins]
            pose = mean_direction_deg(product_of_views(views, rotations)[None])[0]
            return views, float(circular_distance_deg(pose, first * width))

        views, one = take([0.0])
        answer = next_view(views, [0.0], calibrated, bundle.affinity, weights)
        second = answer.moves[0].rotation_deg
        views, two = take([0.0, second])
        # The least expected error without the optimism that is added to it.
        after = calibrated(()).expected(rows[first], **bundle.affinity, share=weights).after_deg
        rotation_deg = np.arange(bundle.n_bins) * width
        least = after[circular_distance_deg(rotation_deg, 0.0) >= MIN_SEPARATION_DEG].min()
        row = {"one_view": one, "one_view_expected": answer.expected_error_deg}
        row |= {"two_views": two, "two_views_expected": answer.moves[0].expected_error_deg}
        row |= {"two_views_least": float(least)}
        then = next_view(views, [0.0, second], calibrated, bundle.affinity, weights)
        third = second + then.moves[0].rotation_deg
        row |= {"two_views_expected_then": then.expected_error_deg}
        rotations = [0.0, second, third]
        views, three = take(rotations)
        row |= {"three_views": three}
        row |= {"three_views_expected": then.moves[0].expected_error_deg}
        last = next_view(views, rotations, calibrated, bundle.affinity, weights)
        row |= {"three_views_expected_then": last.expected_error_deg}
        yield row


def main() -> None:
    """Print a table by bundle, object and elevation, with the elevation given or not."""
    tables = []
    for training, name in enumerate(sys.argv[1:]):
        bundle = Recommender.load(name).bundle
        calibrated = after_rotations(bundle.distributions, bundle.object_ids, N_CACHED)
        for sweep, object_id in enumerate(bundle.object_ids):
            for is_given in (False, True):
                rows = pd.DataFrame(sweep_errors(bundle, calibrated, sweep, is_given=is_given))
                mean = rows.mean().to_frame().T
                mean.insert(0, "elevation", "given" if is_given else "not given")
                mean.insert(1, "training", training)
                mean.insert(2, "object_id", object_id)
                mean.insert(3, "elevation_deg", int(bundle.elevation_deg[sweep]))
                tables.append(mean)
    table = pd.concat(tables).sort_values(["elevation", "training", "object_id", "elevation_deg"])
    table.to_csv(sys.stdout, index=False, float_format="%.3f")


if __name__ == "__main__":
    main()
