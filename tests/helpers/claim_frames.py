"""Errors of methods whose claims are known in advance."""

import numpy as np
import pandas as pd

from nbv.experiment.paper.claims import CATEGORIES, ELEVATIONS_DEG
from nbv.experiment.paper.statements import Claim, Term
from nbv.experiment.paper.verdicts import evaluate_claims

N_OBJECTS = 40
MUG = ("mug", 0)


def unit(means, noise=1.0, seed=0, n_objects=N_OBJECTS, n_views=36):
    """A frame in which each method's error is a mean, an object's own share and some noise."""
    rng = np.random.default_rng(seed)
    parts = []
    for method, mean in means.items():
        errors = (
            mean + rng.normal(0, noise, (n_objects, 1)) + rng.normal(0, 0.3, (n_objects, n_views))
        )
        parts.append(
            pd.DataFrame(
                {
                    "method": method,
                    "fold": np.repeat(np.arange(n_objects) % 5 + 1, n_views),
                    "object_id": np.repeat([f"{i:03d}" for i in range(n_objects)], n_views),
                    "initial_deg": np.tile(np.arange(n_views) * 10, n_objects),
                    "error_deg": np.clip(errors, 0, 180).ravel(),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def everywhere(means, **options):
    units = [(category, 0) for category in CATEGORIES]
    units += [("mug", elevation) for elevation in ELEVATIONS_DEG[1:]]
    return {key: unit(means, seed=index, **options) for index, key in enumerate(units)}


def verdict_of(statement, evaluations, seed=0):
    claim = Claim("one", "3.3", "a sentence", "a rule", statement)
    found = evaluate_claims(evaluations, np.random.default_rng(seed), 500, [claim])
    return found["verdict"].iloc[0]


def term(method, **rest):
    return Term(method, (MUG,), **rest)
