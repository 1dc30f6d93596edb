"""Every next view after any number of views."""

import numpy as np
from studies.simulation import random_next, recommended_next

from made_estimates import evidence_of, objects
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.belief import Belief


def test_recommended_views_keep_their_distance():
    fine, coarse = (evidence_of(objects(6, 0).estimate_deg, n_bins=n) for n in (360, 120))
    next_view = recommended_next("information_gain", coarse, 15)
    belief = Belief(fine.viewpoint[::20], fine)
    taken = np.zeros((len(belief.probabilities), 1), dtype=np.int64)
    rng = np.random.default_rng(0)
    for _ in range(4):
        delta = next_view(belief, taken, rng)
        assert circular_distance_deg(taken, delta[:, None]).min() >= 15
        taken = np.column_stack([taken, delta])


def test_random_views_never_repeat():
    rng, evidence = np.random.default_rng(0), evidence_of()
    taken = np.tile(np.arange(359), (50, 1))
    belief = Belief(np.zeros((50, 360), dtype=np.float32), evidence)
    assert (random_next(belief, taken, rng) == 359).all()
