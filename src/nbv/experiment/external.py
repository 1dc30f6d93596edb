"""Estimates of a fold's objects that another program made.

Apart from `held_out`, which trainings depend on: an edit of what reads pairs trains nothing again.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from nbv.core.estimates import Estimates, Posteriors, posteriors_of
from nbv.core.logits import fit_temperature
from nbv.experiment.held_out import FoldEstimates
from nbv.experiment.splits import need_objects, objects_with_role
from nbv.robot.pairs import Sweeps, evenly_apart


def take_fold(found: Estimates, turns: Sweeps, splits: pd.DataFrame, fold: int) -> FoldEstimates:
    """Return what another program found of a fold's calibration and test objects.

    Parameters
    ----------
    found : Estimates
        Of all objects.
    turns : Sweeps
        What distributions it gave, of the same objects; empty where it gave none. Calibration
        objects choose one temperature.
    splits : DataFrame
        From `nbv.experiment.splits.read_splits`.
    fold : int

    Raises
    ------
    UserError
        As of `nbv.experiment.splits.need_objects` and
        `nbv.robot.pairs.evenly_apart`.
    """
    need_objects(splits, found.object_ids)
    names = {role: objects_with_role(splits, fold, role) for role in ("calibration", "test")}
    temperature = 1.0
    if turns:
        azimuths, given = zip(*(turns[name] for name in names["calibration"]), strict=True)
        temperature = fit_temperature(np.log(np.concatenate(given)), np.concatenate(azimuths))
    taken: FoldEstimates = {}
    for role, object_ids in names.items():
        estimate_deg = found.estimate_deg[[found.object_ids.index(name) for name in object_ids]]
        posteriors = None
        if turns:
            n_views = estimate_deg.shape[1]
            whole = []
            for name in object_ids:
                azimuth_deg, rows = turns[name]
                # The temperature first: it was fitted to distributions as given, not turned ones.
                own = posteriors_of((name,), np.log(rows)[None], temperature).distributions[0]
                whole.append(evenly_apart(azimuth_deg, own, n_views))
            posteriors = Posteriors(tuple(object_ids), np.log(np.stack(whole)), temperature)
        taken[role] = Estimates(tuple(object_ids), estimate_deg), posteriors
    return taken
