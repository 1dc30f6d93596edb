"""Any number of views: the next one, and beliefs against Bayes' rule written out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from studies.simulation import (
    coarser,
    random_next,
    recommended_next,
    region_coverage,
    updated,
)

from made_estimates import (
    N_BINS,
    direction_by_loops,
    evidence_of,
    objects,
    product_by_loops,
)
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.belief import Belief, first_belief
from nbv.core.circle.distributions import mean_direction_deg


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


PROBABILITIES = st.lists(st.integers(0, 6), min_size=1, max_size=9).filter(any)


@given(PROBABILITIES, st.floats(0.01, 0.99))
def test_regions_hold_just_their_share_of_truths_drawn_from_the_distribution(counts, level):
    """An identity, ties and zeros included; and the region is the smallest that does."""
    drawn = np.array(counts) / sum(counts)
    bins = np.arange(len(drawn))
    inside = region_coverage(np.tile(drawn, (len(drawn), 1)), bins, level)
    assert drawn @ inside == pytest.approx(level)
    assert (inside[drawn == 0] == 0).all()
    left, size = level, 0.0
    for p in sorted(drawn[drawn > 0], reverse=True):
        size += min(left / p, 1.0)
        left = max(left - p, 0.0)
    assert inside.sum() == pytest.approx(size)
