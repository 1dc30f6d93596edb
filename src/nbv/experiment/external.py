"""Estimates of another program for the objects of a fold."""

from __future__ import annotations

import numpy as np
import pandas as pd

from nbv.core.circle.estimates import Estimates, Posteriors, posteriors_of
from nbv.core.circle.logits import fit_temperature
from nbv.core.circle.sweeps import evenly_apart
from nbv.experiment.estimates import FoldEstimates
from nbv.experiment.splits import check_objects, objects_with_role
from nbv.tables.pairs import Sweeps


def take_fold(
    estimates: Estimates, sweeps: Sweeps, splits: pd.DataFrame, fold: int
) -> FoldEstimates:
    """Return the estimates of another program for a fold's calibration and test objects.

    Raise UserError where the objects differ from those in the splits, or the azimuths do not allow
    evenly spaced views (`nbv.core.circle.sweeps.evenly_apart`).

    The estimates are of all objects, and so are the distributions, which are empty if the program
    gives none. Calibration objects choose one temperature.
    """
    check_objects(splits, estimates.object_ids)
    names = {role: objects_with_role(splits, fold, role) for role in ("calibration", "test")}
    temperature = 1.0
    if sweeps:
        azimuths, given = zip(*(sweeps[name] for name in names["calibration"]), strict=True)
        temperature = fit_temperature(np.log(np.concatenate(given)), np.concatenate(azimuths))
    taken: dict[str, tuple[Estimates, Posteriors | None]] = {}
    for role, object_ids in names.items():
        estimate_deg = estimates.estimate_deg[
            [estimates.object_ids.index(name) for name in object_ids]
        ]
        posteriors = None
        if sweeps:
            n_views = estimate_deg.shape[1]
            whole = []
            for name in object_ids:
                azimuth_deg, rows = sweeps[name]
                # The temperature was fitted to the distributions before they are rotated.
                scaled = posteriors_of((name,), np.log(rows)[None], temperature).distributions[0]
                whole.append(evenly_apart(azimuth_deg, scaled, n_views))
            posteriors = Posteriors(tuple(object_ids), np.log(np.stack(whole)), temperature)
        taken[role] = Estimates(tuple(object_ids), estimate_deg), posteriors
    return taken
