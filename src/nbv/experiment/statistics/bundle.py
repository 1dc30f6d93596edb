"""What a run says of the bundles that it made: their errors on test objects, and their use."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from nbv.bundles.evaluation import OPPOSITE, RANDOM, RECOMMENDED, SINGLE
from nbv.experiment.statistics.metrics import percentile_interval, resample_objects
from nbv.labels import counted, interval_text

_ROWS = {
    "one view": (SINGLE, 1),
    "two, random": (RANDOM, 2),
    "two, opposite": (OPPOSITE, 2),
    "two, recommended": (RECOMMENDED, 2),
}
_N_RESAMPLES = 2000


def bundle_lines(bundle: Path) -> list[str]:
    """Return the mean test errors of a bundle as lines of text, with its path and a command.

    Parameters
    ----------
    bundle : Path
        The bundle; the errors are beside it, in a CSV file of `nbv.bundles.evaluation.evaluate`.
        An object's error is the mean over its sweeps. Intervals (95 %) are percentiles over
        resamples of objects.
    """
    errors = pd.read_csv(bundle.with_suffix(".csv"), dtype={"object_id": str})
    rows = errors.groupby(["choice", "n_views", "object_id"])["mae_deg"].mean()
    n_objects = errors["object_id"].nunique()
    drawn = resample_objects(n_objects, np.random.default_rng(0), _N_RESAMPLES) / n_objects
    lines = [f"bundle: {bundle}", f"mean error of {counted(n_objects, 'test object')}, degrees:"]
    for label, row in _ROWS.items():
        values = rows[row].to_numpy()
        interval = percentile_interval(drawn @ values)
        lines.append(f"    {label:16}  {interval_text(values.mean(), *interval, decimals=1)}")
    return [*lines, f"use it: nbv recommend FRAME --bundle {bundle}"]
