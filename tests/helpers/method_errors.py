"""Objects' errors of several methods, made for the purpose."""

import numpy as np
import pandas as pd
from studies.leaderboard import blocks_of
from studies.object_errors import OBJECT_COLUMNS

from made_estimates import EXTENSIONS


def without(mapping, *names):
    return {name: value for name, value in mapping.items() if name not in names}


METHODS = {
    "single": {"policy": "none"},
    "opposite": {"policy": "opposite"},
    "proposed": {"policy": "pose_ambiguity"},
    "fixed_average": {"policy": "fixed", "fusion": "average"},
} | without(EXTENSIONS, "random_posterior", "error_average")
SHIFTS = {
    "single": 8.0,
    "opposite": 4.0,
    "proposed": 3.0,
    "opposite_posterior": 3.5,
    "fixed_average": 2.5,
    "gain_posterior": 1.0,
    "selected": 0.0,
    "opposite_selected": 3.4,
    "oracle_posterior": -5.0,
}
CATEGORIES = ("mug", "car", "chair")


def object_rows(shifts=SHIFTS, categories=CATEGORIES, noise=0.1, n_objects=30):
    """Each method's errors, on average 10 degrees and its shift."""
    rng = np.random.default_rng(0)
    rows = [
        (
            *(category, 0, 1 + k % 5, method, f"{k:02d}", 360),
            *(10 + shift + rng.normal(0, noise), 90.0, 1.0, 90.0),
        )
        for category in categories
        for method, shift in shifts.items()
        for k in range(n_objects)
    ]
    return pd.DataFrame(rows, columns=["category", "elevation_deg", "fold", *OBJECT_COLUMNS])


def blocks(shifts=SHIFTS, **rest):
    return blocks_of({"run": object_rows(shifts, **rest)})


def texts(table):
    """The texts of a table's rows by the first."""
    return {row[0].text: [cell.text for cell in row[1:]] for row in table.rows}
