"""One method on 9,000 test images: the project's arrays against a loop over images."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from nbv.core.angles import circular_distance_deg
from nbv.core.estimates import Estimates
from nbv.core.evidence import gather_evidence
from nbv.core.fusion import average
from nbv.core.lookup import CostTable, build_lookup
from nbv.experiment.results import COLUMNS, evaluate_method
from performance.figures import Figure, Target
from performance.lookup import calibration_estimates
from performance.settings import configuration
from performance.timing import take_turns

TARGET = Target(100)


def run(quick: bool) -> list[Figure]:
    n_objects = 2 if quick else 25
    test = Estimates(
        tuple(f"object{i:02d}" for i in range(n_objects)),
        np.round(calibration_estimates(n_objects, 360), 4),
    )
    table = build_lookup(
        gather_evidence(
            calibration_estimates(20, 360),
            configuration()["density"],
            bandwidth_deg=8.0,
            pseudo_observations=30.0,
        ),
        "pose_ambiguity",
    )
    method = {"policy": "pose_ambiguity", "fusion": "average"}
    works: list[Callable[[], pd.DataFrame]] = [
        lambda: loop_over_images(test, table),
        lambda: evaluate_method(method, test, lookup=table),
    ]
    looped, own = (work() for work in works)
    # A last decimal may be rounded the other way.
    pd.testing.assert_frame_equal(looped, own, check_dtype=False, rtol=0, atol=2e-4)
    times = take_turns(works, 2 if quick else 9)
    return [
        Figure(
            "evaluation of a method: loop over images",
            times.ratio(0, 1),
            TARGET,
            f"{1e3 * times.typical(1):.2f} ms against {1e3 * times.typical(0):,.0f} ms for "
            f"{test.estimate_deg.size:,} images",
        ),
    ]


def loop_over_images(test: Estimates, table: CostTable) -> pd.DataFrame:
    """Return what `evaluate_method` does, its functions called for one image at a time."""
    rows = []
    for name, estimates in zip(test.object_ids, test.estimate_deg, strict=True):
        for initial, estimate in enumerate(estimates):
            delta = int(table.least_cost(estimate))
            second = estimates[(initial + delta) % 360]
            pose = round(float(average(estimate, second, delta)), 4) % 360.0
            error = float(circular_distance_deg(pose, initial))
            rows.append((name, initial, estimate, delta, second, pose, error))
    return pd.DataFrame(rows, columns=list(COLUMNS))
