"""Every next view after any number of views."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from studies.simulation import (
    evenly_spaced_travel_deg,
    random_next,
    recommended_next,
    shortest_walk_deg,
)

from nbv.core.angles import circular_distance_deg, travel_deg
from nbv.core.belief import Belief
from nbv.core.criteria import CRITERIA
from tests.core.made import evidence_of, objects


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


@pytest.mark.parametrize("n_views", [2, 3, 4, 5, 8])
@pytest.mark.parametrize("apart_deg", [0.0, 15.0, 45.0])
def test_no_costs_lead_farther_than_even_spacing(monkeypatch, n_views, apart_deg):
    rng, coarse = np.random.default_rng(0), evidence_of(objects(2, 0).estimate_deg, n_bins=120)
    monkeypatch.setitem(CRITERIA, "any", lambda belief, *_: rng.random(belief.probabilities.shape))
    next_view = recommended_next("any", coarse, apart_deg, n_views)
    belief = Belief(np.tile(coarse.viewpoint, (9, 1)), coarse)
    taken = np.zeros((len(belief.probabilities), 1), dtype=np.int64)
    for _ in range(n_views - 1):
        taken = np.column_stack([taken, next_view(belief, taken, rng)])
    travel = travel_deg(np.diff(taken, axis=1)).sum(axis=1)
    assert travel.max() <= evenly_spaced_travel_deg(n_views) + 1e-6
    for one, other in itertools.combinations(taken.T, 2):
        assert circular_distance_deg(one, other).min() >= apart_deg


@given(
    st.lists(st.integers(0, 23), min_size=1, max_size=4),
    st.integers(0, 3),
    st.sampled_from([0.0, 15.0, 40.0]),
)
def test_walks_are_as_short_as_views_one_way_round_can_be(taken, n_more, apart_deg):
    n_bins, bin_deg = 24, 15.0
    found = shortest_walk_deg(np.array([taken]) * 15, n_bins, n_more, apart_deg)[0]
    place_deg = np.arange(n_bins) * bin_deg
    apart = circular_distance_deg(place_deg[:, None], place_deg) >= apart_deg
    # Every set of further places, as steps from the start.
    steps = np.array(list(itertools.combinations(range(1, n_bins), n_more)), dtype=int)
    length_deg = steps.max(axis=1, initial=0) * bin_deg
    for start in range(n_bins):
        best = np.inf
        for way in (1, -1):
            new = (start + way * steps) % n_bins
            may = apart[new[:, :, None], taken].all(axis=(1, 2)) & apart[start, new].all(axis=1)
            for one, other in itertools.combinations(new.T, 2):
                may &= apart[one, other]
            best = min(best, length_deg[may].min(initial=np.inf))
        assert found[start] == best


def test_random_views_never_repeat():
    rng, evidence = np.random.default_rng(0), evidence_of()
    taken = np.tile(np.arange(359), (50, 1))
    belief = Belief(np.zeros((50, 360), dtype=np.float32), evidence)
    assert (random_next(belief, taken, rng) == 359).all()
