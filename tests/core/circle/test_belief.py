"""Beliefs over any number of views, against Bayes' rule written out."""

import numpy as np

from made_estimates import N_BINS, direction_by_loops, evidence_of, product_by_loops
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.belief import Belief, coarser, every_belief, first_belief, updated
from nbv.core.circle.distributions import mean_direction_deg


def test_beliefs_follow_bayes_rule_view_by_view():
    evidence = evidence_of()
    V, L = evidence.conditionals.viewpoint, evidence.conditionals.estimate
    views = [(90, 100.0), (240, 300.0), (15, 61.0)]
    belief = first_belief(np.array([40.0]), evidence)
    rows = [V[int(40.0 / 15 + 0.5)]]
    for delta, seen in views:
        belief = updated(belief, np.array([seen]), np.array([delta]), evidence)
        rows.append(L[:, int(seen / 15 + 0.5) % N_BINS])
    expected = product_by_loops(rows, [0, *(delta // 15 for delta, _ in views)])
    np.testing.assert_allclose(belief.probabilities[0], expected / expected.sum(), rtol=1e-4)
    assert belief.n_views == 4
    direction = direction_by_loops(expected)
    assert circular_distance_deg(mean_direction_deg(belief.probabilities)[0], direction) < 0.01


def test_the_order_of_views_does_not_matter():
    evidence, rng = evidence_of(), np.random.default_rng(0)
    seen, delta = rng.uniform(0, 360, 4), rng.integers(0, N_BINS, 4) * 15
    ends = []
    for order in ([0, 1, 2, 3], [3, 1, 0, 2]):
        belief = first_belief(np.array([10.0]), evidence)
        for k in order:
            belief = updated(belief, seen[k : k + 1], delta[k : k + 1], evidence)
        ends.append(belief.probabilities)
    np.testing.assert_allclose(*ends, rtol=1e-4)


def test_coarser_beliefs_keep_their_mass_and_direction_and_their_estimates():
    evidence = evidence_of(n_bins=8)
    fine = np.zeros((3, N_BINS), dtype=np.float32)
    fine[0, 23] = fine[1, 1] = fine[2, 12] = 1
    belief = coarser(Belief(fine, evidence_of(), np.array([23, 1, 11]), 2), evidence)
    assert belief.probabilities[[0, 1, 2], [0, 0, 4]].tolist() == [1, 1, 1]
    assert belief.probabilities.sum() == 3
    assert belief.first_bin.tolist() == [0, 0, 4]
    assert belief.evidence is evidence
    assert belief.n_views == 2


def test_the_beliefs_of_all_estimates_are_those_of_each():
    evidence = evidence_of()
    every = every_belief(evidence)
    one = first_belief(np.arange(N_BINS) * 15.0, evidence)
    np.testing.assert_array_equal(every.probabilities, one.probabilities)
    np.testing.assert_array_equal(every.first_bin, one.first_bin)
