"""Which density, and which method, calibration objects favour."""

import numpy as np
import pytest
from studies.extensions import choices_frame, stored_evidence
from studies.selection import select_methods, surely_better

from made_estimates import EXTENSIONS, FEW_DENSITIES, objects
from nbv.core.circle.estimates import Posteriors
from nbv.core.circle.selection import DensityParams


@pytest.fixture(scope="module")
def selected():
    return select_methods(objects(6, 0), EXTENSIONS, FEW_DENSITIES)


def test_the_pair_selected_is_the_first_that_is_not_surely_worse_than_the_best(selected):
    names = ["opposite_posterior", "gain_posterior", "error_average"]
    choices = {name: selected[name].density for name in names}
    best = min(choices.values(), key=lambda choice: choice.error_deg)
    first = next(name for name in names if not surely_better(best, choices[name]))
    assert first != "opposite_posterior"
    winner = selected["selected"]
    assert (winner.policy, winner.fusion) == (selected[first].policy, selected[first].fusion)
    assert winner.density == choices[first]
    assert selected["opposite_selected"].policy == "opposite"
    assert selected["opposite_selected"].fusion == winner.fusion


def choice(*object_error_deg):
    mean = float(np.mean(object_error_deg))
    return DensityParams(4, 3, {(4, 3): mean}, object_error_deg)


@pytest.mark.parametrize(
    ("one", "other", "sure"),
    [
        ((1.0, 2.0, 3.0), (2.0, 3.1, 4.0), True),
        ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), False),
        ((1.0,), (9.0,), False),
        ((1.0, 2.0), (2.0, 6.0), False),  # -2.5 on average, but from two objects: t = 1.67 < 1.84
    ],
)
def test_surely_better_needs_more_than_one_standard_error(one, other, sure):
    assert surely_better(choice(*one), choice(*other)) == sure


def test_where_no_method_is_surely_better_the_papers_opposite_is_taken():
    """One calibration object says nothing about others; Opposite is no extension, yet first."""
    found = select_methods(objects(1, 0), EXTENSIONS, FEW_DENSITIES)
    assert (found["selected"].policy, found["selected"].fusion) == ("opposite", "average")
    assert set(found) == set(EXTENSIONS)


def test_stored_choices_give_the_same_evidence(selected):
    evidences = stored_evidence(objects(6, 0), choices_frame(selected), FEW_DENSITIES)
    again = evidences["information_gain"](360)
    np.testing.assert_array_equal(again.viewpoint, selected["gain_posterior"].evidence.viewpoint)
    assert evidences["information_gain"](360) is again


def test_the_bayes_error_takes_the_density_of_the_expected_error():
    posterior = {"error_posterior": {"policy": "expected_error", "fusion": "posterior"}}
    chosen = choices_frame(select_methods(objects(4, 0), posterior, FEW_DENSITIES))
    evidences = stored_evidence(objects(4, 0), chosen, FEW_DENSITIES)
    assert evidences["bayes_error"](120) is evidences["expected_error"](120)


def test_a_method_of_distributions_has_no_density_and_is_never_selected():
    rng, calibration = np.random.default_rng(0), objects(3, 0)
    p = rng.dirichlet(np.ones(36), (3, 360))
    posteriors = Posteriors(calibration.object_ids, np.log(p), 1.0)
    product = {"gain_product": {"policy": "information_gain", "fusion": "product"}}
    found = select_methods(calibration, product | EXTENSIONS, FEW_DENSITIES, posteriors)
    assert found["gain_product"].lookup is None
    assert found["selected"].fusion != "product"
    row = choices_frame(found).set_index("method").loc["gain_product"]
    assert row[["bandwidth_deg", "pseudo_observations", "validated_error_deg"]].isna().all()
    L = found["gain_product"].evidence.conditionals.estimate
    np.testing.assert_allclose(L[4], p[:, 35:45].mean(axis=(0, 1)))
    with pytest.raises(ValueError, match="needs posteriors"):
        select_methods(calibration, product, FEW_DENSITIES)
