"""Beliefs after first views."""

import numpy as np

from made_estimates import N_BINS, evidence_of
from nbv.core.circle.belief import every_belief, first_belief


def test_the_beliefs_of_all_estimates_are_those_of_each():
    evidence = evidence_of()
    every = every_belief(evidence)
    one = first_belief(np.arange(N_BINS) * 15.0, evidence)
    np.testing.assert_array_equal(every.probabilities, one.probabilities)
    np.testing.assert_array_equal(every.first_bin, one.first_bin)
