"""Every choice of the next view with every fusion."""

import itertools

import numpy as np
import pytest
from studies.confirmation import factorial_beliefs
from studies.factorial import (
    LIKELIEST,
    POLICIES,
    PRODUCT_CHOICES,
    SINGLE,
    evaluate_factorial,
    evaluate_more_views,
)
from studies.kept_estimates import held_out
from tests.studies.test_extensions import N_CLASSES, hidden_handle, mean_directions

from made_estimates import FEW_DENSITIES
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.evidence import COARSE_BINS
from nbv.core.circle.fusion import ESTIMATE_FUSIONS
from nbv.core.circle.policies import needs_lookup

SETTINGS = FEW_DENSITIES | {
    "affinity": {"power": 16, "pseudo_observations": 90},
    "travel_cost": 0.0,
    "max_travel_deg": 180.0,
}
MORE_VIEWS = {"n_views": 3, "start_every_deg": 60, "min_separation_deg": 15}


def rng_of(name):
    return np.random.default_rng(len(name))


@pytest.fixture(scope="module")
def sides():
    return [held_out(mean_directions(p), p) for p in (hidden_handle(5, 1), hidden_handle(3, 0))]


@pytest.fixture(scope="module")
def made(sides):
    return evaluate_factorial(*sides, SETTINGS, rng_of)


def more_views(sides, made):
    rng = rng_of("more_views")
    return evaluate_more_views(*sides, made.posterior_density, SETTINGS, MORE_VIEWS, rng)


def test_every_choice_meets_every_fusion(made):
    expected = set(itertools.product(POLICIES, ESTIMATE_FUSIONS))
    expected |= {(choice, "product") for choice in PRODUCT_CHOICES} | {SINGLE, LIKELIEST}
    assert set(made.frames) == expected
    assert {len(frame) for frame in made.frames.values()} == {3 * N_CLASSES}
    for frame in made.frames.values():
        assert set(frame["object_id"]) == {"0-0", "0-1", "0-2"}


def test_a_choice_that_asks_no_table_takes_the_same_views_under_each_fusion(made):
    for choice in ("random", "opposite"):
        views = [made.frames[choice, fusion]["delta_deg"] for fusion in ESTIMATE_FUSIONS]
        np.testing.assert_array_equal(*views)
    assert (made.frames["fixed", "average"].groupby("object_id")["delta_deg"].nunique() == 1).all()


def test_tables_have_coarse_bins_and_the_error_is_that_of_the_fused_pose(made):
    for choice in set(POLICIES) - {"random", "opposite"}:
        delta = made.frames[choice, "posterior"]["delta_deg"]
        assert (delta % (360 // COARSE_BINS) == 0).all()
    for frame in made.frames.values():
        away = circular_distance_deg(frame["pose_estimate_deg"], frame["initial_deg"])
        np.testing.assert_allclose(frame["error_deg"], away)


def test_what_sees_the_hidden_handle_beats_a_random_view(made):
    error = {pair: frame["error_deg"].mean() for pair, frame in made.frames.items()}
    for fusion in ESTIMATE_FUSIONS:
        assert error["expected_error", fusion] < error["random", fusion] < error[SINGLE]
    assert error["information_gain", "product"] < error["random", "product"]
    assert error["expected_error", "posterior"] <= error["fixed", "posterior"] + 0.5


def test_each_choice_has_a_density_of_its_own_where_the_fusion_has_none(made):
    densities = made.densities.set_index(["choice", "fusion"])
    tables = {choice for choice, policy in POLICIES.items() if needs_lookup(policy)}
    expected = {(choice, "average") for choice in tables} | {LIKELIEST}
    expected |= {("random", "posterior"), ("expected_error", "posterior")}
    assert set(densities.index) == expected
    assert set(densities["bandwidth_deg"]) <= {6, 12}
    assert densities.loc[LIKELIEST, "pseudo_observations"] == 0
    assert densities.loc[("random", "posterior"), "pseudo_observations"] == 10
    # Five objects from every degree: five pairs a row.
    assert densities.loc[("random", "posterior"), "pairs_percent"] == pytest.approx(100 * 5 / 15)
    assert densities.loc[LIKELIEST, "pairs_percent"] == 100


def test_all_methods_start_from_the_same_views(made):
    starts = {pair: tuple(frame["initial_deg"]) for pair, frame in made.frames.items()}
    assert len(set(starts.values())) == 1
    assert len(set(starts[SINGLE])) == N_CLASSES


def test_without_distributions_nothing_is_multiplied():
    sides = [held_out(mean_directions(hidden_handle(n, n))) for n in (4, 2)]
    made = evaluate_factorial(*sides, SETTINGS, rng_of)
    assert "product" not in {fusion for _, fusion in made.frames}
    assert not more_views(sides, made)["method"].str.endswith("_product").any()


def test_beliefs_are_of_one_view_once_and_of_more_by_choice(sides, made):
    more = more_views(sides, made)
    keys = ["choice", "fusion", "n_views", "object_id"]
    found = factorial_beliefs(more).set_index(keys).sort_index()
    assert found.index.is_unique
    one_view = found.xs(1, level="n_views")
    assert set(one_view.index.get_level_values("choice")) == {"none"}
    assert set(one_view.index.get_level_values("fusion")) == {"posterior", "product"}
    rows = more.set_index(["method", "n_views", "object_id"]).sort_index()
    for n_views in (2, 3):
        mine = found.loc[("evenly_spaced", "product", n_views)]
        same = rows.loc[("evenly_spaced_product", n_views), mine.columns]
        np.testing.assert_array_equal(mine, same)
