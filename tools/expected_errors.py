"""Print what bundles expect and what is real: expected_errors.py BUNDLES > expected_errors.csv.

Each calibration object is left out in turn, and its views are the object at hand: one view, two
after the recommended rotation, and three. See docs/bundles.md, how the next view is chosen.
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
"""Bins between the first views of a turn."""

NOT_THERE = 1e-12
"""Share of the object that is left out: a share is above 0."""

KEPT = 160
"""Rotations whose errors are kept; there are 120 of `mug`, 4 MB each."""


def of_turn(
    bundle: Bundle, calibrated: AfterRotations, turn: int, *, is_given: bool
) -> Iterator[dict[str, float]]:
    """Yield expected and real errors from each first view of a turn, its object left out."""
    rows = bundle.distributions[turn].astype(np.float64)
    width = 360.0 / bundle.n_bins
    is_other = np.array(bundle.object_ids) != bundle.object_ids[turn]
    elevation_deg = float(bundle.elevation_deg[turn]) if is_given else None
    share = bundle.weights_at(elevation_deg) * is_other + NOT_THERE
    for first in range(turn % EVERY, bundle.n_bins, EVERY):

        def seen(rotations: list[float], first: int = first) -> tuple[NDArray[np.float64], float]:
            places = [(first + round(turn / width)) % bundle.n_bins for turn in rotations]
            views = rows[places]
            found = mean_direction_deg(product_of_views(views, rotations)[None])[0]
            return views, float(circular_distance_deg(found, first * width))

        views, one = seen([0.0])
        answer = next_view(views, [0.0], calibrated, bundle.affinity, share)
        second = answer.moves[0].rotation_deg
        views, two = seen([0.0, second])
        # What the least of the errors would be without what is added to it.
        after = calibrated(()).expected(rows[first], **bundle.affinity, share=share).after_deg
        rotation_deg = np.arange(bundle.n_bins) * width
        least = after[circular_distance_deg(rotation_deg, 0.0) >= MIN_SEPARATION_DEG].min()
        row = {"one_view": one, "one_view_expected": answer.expected_error_deg}
        row |= {"two_views": two, "two_views_expected": answer.moves[0].expected_error_deg}
        row |= {"two_views_least": float(least)}
        then = next_view(views, [0.0, second], calibrated, bundle.affinity, share)
        third = second + then.moves[0].rotation_deg
        row |= {"two_views_expected_then": then.expected_error_deg}
        turns = [0.0, second, third]
        views, three = seen(turns)
        row |= {"three_views": three}
        row |= {"three_views_expected": then.moves[0].expected_error_deg}
        last = next_view(views, turns, calibrated, bundle.affinity, share)
        row |= {"three_views_expected_then": last.expected_error_deg}
        yield row


def main() -> None:
    """Print a table of all bundles, elevations given or not, objects and elevations."""
    tables = []
    for training, name in enumerate(sys.argv[1:]):
        bundle = Recommender.load(name).bundle
        calibrated = after_rotations(bundle.distributions, bundle.object_ids, KEPT)
        for turn, object_id in enumerate(bundle.object_ids):
            for is_given in (False, True):
                rows = pd.DataFrame(of_turn(bundle, calibrated, turn, is_given=is_given))
                mean = rows.mean().to_frame().T
                mean.insert(0, "elevation", "given" if is_given else "not given")
                mean.insert(1, "training", training)
                mean.insert(2, "object_id", object_id)
                mean.insert(3, "elevation_deg", int(bundle.elevation_deg[turn]))
                tables.append(mean)
    found = pd.concat(tables).sort_values(["elevation", "training", "object_id", "elevation_deg"])
    found.to_csv(sys.stdout, index=False, float_format="%.3f")


if __name__ == "__main__":
    main()
