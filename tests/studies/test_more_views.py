from __future__ import annotations

import numpy as np
import pytest
from studies.extensions import choices_frame, stored_evidence
from studies.more_views import more_views_rows

from nbv.core.angles import circular_distance_deg
from nbv.core.estimates import Posteriors
from nbv.core.evidence import evidence_of_distributions
from nbv.core.logits import log_likelihood
from nbv.core.selection import select_methods
from tests.core.made import EXTENSIONS, FEW_DENSITIES, objects

SETTINGS = {"n_views": 4, "start_every_deg": 60, "min_separation_deg": 15}
WITH_THE_PAPERS = EXTENSIONS | {
    "ambiguity_posterior": {"policy": "pose_ambiguity", "fusion": "posterior"},
    "error_posterior": {"policy": "expected_error", "fusion": "posterior"},
}


@pytest.fixture(scope="module")
def rows():
    calibration = objects(6, 0)
    choices = choices_frame(select_methods(calibration, WITH_THE_PAPERS, FEW_DENSITIES))
    evidences = stored_evidence(calibration, choices, FEW_DENSITIES)
    return more_views_rows(objects(3, 2), evidences, SETTINGS, np.random.default_rng(0))


def test_every_view_is_where_it_says_and_counts_its_travel(rows):
    means = rows.groupby(["method", "n_views"])[["error_deg", "travel_deg"]].mean()
    assert means.loc[("bisecting", 4), "travel_deg"] == 180 + 90 + 180
    assert means.loc[("evenly_spaced", 4), "travel_deg"] == 270
    assert means.loc[("evenly_spaced", 3), "travel_deg"] == 240
    assert (means.xs(1, level="n_views")["travel_deg"] == 0).all()
    for method in ("random", "bisecting", "information_gain", "bayes_error"):
        assert means.loc[(method, 4), "error_deg"] < means.loc[(method, 1), "error_deg"]


def test_two_errors_have_two_names_and_the_pose_ambiguity_is_of_two_views_alone(rows):
    """The kernel regression of real errors knows nothing of more views than two."""
    assert set(rows["method"]) == {
        "random",
        "bisecting",
        "evenly_spaced",
        "information_gain",
        "bayes_error",
    }


N_CLASSES = 36
AFFINITY = {"affinity": {"power": 8, "pseudo_observations": 90, "caution": 2.0}}


def half_turned(n_objects, seed):
    """Distributions with two peaks half a turn apart, but for a quarter that knows the truth."""
    rng = np.random.default_rng(seed)
    truth, centres = np.arange(360.0), np.arange(N_CLASSES) * 360 / N_CLASSES
    answer = truth + rng.normal(0, 4, (n_objects, 360))
    peak = np.exp(20 * (np.cos(np.radians(centres - answer[..., None])) - 1))
    other = np.roll(peak, N_CLASSES // 2, axis=-1)
    blind = (circular_distance_deg(truth, 90) > 45)[:, None]
    p = np.where(blind, peak + rng.uniform(0.5, 2, (n_objects, 360, 1)) * other, peak) + 1e-6
    return Posteriors(
        tuple(f"{seed}-{k}" for k in range(n_objects)),
        np.log(p / p.sum(axis=-1, keepdims=True)),
        1.0,
    )


@pytest.fixture(scope="module")
def products():
    calibration, test = half_turned(8, 0), half_turned(4, 2)
    choices = choices_frame(select_methods(objects(6, 0), EXTENSIONS, FEW_DENSITIES))
    evidences = stored_evidence(objects(6, 0), choices, FEW_DENSITIES)
    evidence = evidence_of_distributions(calibration.distributions, AFFINITY)
    estimates = objects(4, 2)
    rng = np.random.default_rng(0)
    return more_views_rows(estimates, evidences, SETTINGS, rng, test, evidence)


def test_one_view_knows_the_pose_as_well_as_its_distribution(products):
    test = half_turned(4, 2)
    starts = np.arange(0, 360, SETTINGS["start_every_deg"])
    logs = log_likelihood(np.log(test.distributions[:, starts]), starts[None, :])
    rows = products[(products["method"] == "random_product") & (products["n_views"] == 1)]
    np.testing.assert_allclose(rows["log_likelihood"], logs.mean(axis=1), atol=1e-4)
    for level in (50, 90):
        assert rows[f"inside_{level}_percent"].between(0, 100).all()


def test_with_distributions_every_number_of_views_has_a_spacing(products):
    means = products.groupby(["method", "n_views"])[["error_deg", "travel_deg"]].mean()
    for n_views in (2, 3, 4):
        chosen = means.loc[("expected_error_product", n_views)]
        even = means.loc[("evenly_spaced_product", n_views)]
        assert chosen["travel_deg"] <= even["travel_deg"]
        assert chosen["error_deg"] <= even["error_deg"] + 1.0
    two = means.xs(2, level="n_views")["error_deg"]
    assert two["expected_error_product"] < 0.5 * two["random_product"]
