from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from made_estimates import N_BINS, direction_by_loops, estimates, evidence_of, product_by_loops
from nbv.core.circle import fusion
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.density import Conditionals
from nbv.core.circle.fusion import ESTIMATE_FUSIONS, average, posterior, product

angle = st.integers(0, 3599).map(lambda tenths: tenths / 10)
rotation = st.integers(0, 359)


@given(angle, angle, rotation, rotation)
def test_averaging_turns_with_the_object(first, second, delta, k):
    before = fusion.average(first, second, delta)
    after = fusion.average(first + k, second + k, delta)
    antipodal = circular_distance_deg(first, second - delta) > 180 - 1e-6
    assert antipodal or circular_distance_deg(before + k, after) < 1e-6


@given(angle, angle, rotation)
def test_the_mean_lies_half_way_between_the_two_the_shorter_way(first, second, delta):
    fused = fusion.average(first, second, delta)
    apart = circular_distance_deg(first, second - delta)
    if apart < 180 - 1e-6:
        assert abs(circular_distance_deg(fused, first) - apart / 2) < 1e-6
        assert abs(circular_distance_deg(fused, second - delta) - apart / 2) < 1e-6


def test_antipodal_answers_fall_back_on_the_first():
    assert fusion.average(10.0, 250.0, 60) == 10.0


def test_second_views_wrap_round():
    estimate = np.arange(24.0).reshape(2, 12)  # 12 views, 30 degrees apart
    delta = np.array([[330] * 12, [60] * 12])
    seen = fusion.at_second_view(estimate, delta)
    np.testing.assert_array_equal(seen[0], np.roll(estimate[0], 1))
    np.testing.assert_array_equal(seen[1], np.roll(estimate[1], -2))


def test_every_whole_degree_leads_to_its_own_view():
    seen = fusion.at_second_view(np.arange(360.0)[None], np.arange(360)[None])
    np.testing.assert_array_equal(seen[0], 2 * np.arange(360) % 360)


def test_posterior_fusion_is_the_direction_of_the_sum():
    evidence = evidence_of()
    rng = np.random.default_rng(3)
    first, second = rng.uniform(0, 360, (2, 40))
    delta = rng.integers(0, N_BINS, 40) * (360 / N_BINS)
    fused = posterior(first, second, delta, evidence)
    V, L = evidence.conditionals.viewpoint, evidence.conditionals.estimate
    for one in range(40):
        e1, e2 = (int(np.floor(x / 15 + 0.5)) % N_BINS for x in (first[one], second[one]))
        total = sum(
            V[e1, t] * L[(t + int(delta[one] // 15)) % N_BINS, e2] * np.exp(2j * np.pi * t / N_BINS)
            for t in range(N_BINS)
        )
        assert circular_distance_deg(fused[one], np.degrees(np.angle(total))) < 0.01


def test_many_pairs_at_once_are_fused_like_few():
    evidence = evidence_of()
    rng = np.random.default_rng(4)
    first, second = rng.uniform(0, 360, (2, 30, 100))
    delta = rng.integers(0, N_BINS, (30, 100)) * (360 / N_BINS)
    assert first.size > 2 * N_BINS**2
    at_once = posterior(first, second, delta, evidence)
    few = np.stack([posterior(*row, evidence) for row in zip(first, second, delta, strict=True)])
    bins = [np.floor(x / 15 + 0.5).astype(int) % N_BINS for x in (delta, first, second)]
    real, imaginary = (evidence.moments[bins[0], part, bins[1], bins[2]] for part in (0, 1))
    # Where the posterior has next to no direction, rounding chooses one.
    told = np.hypot(real, imaginary) > 1e-4
    assert told.mean() > 0.9
    assert circular_distance_deg(at_once, few)[told].max() < 0.01


def test_posterior_fusion_needs_evidence():
    with pytest.raises(ValueError, match=r"^posterior fusion needs evidence$"):
        posterior(0.0, 0.0, 0.0)


def random_rows(seed, n):
    return np.random.default_rng(seed).dirichlet(np.full(12, 0.5), n)


@given(st.integers(0, 99), st.integers(0, 11), st.integers(0, 11))
def test_the_product_multiplies_in_the_frame_of_the_first_view(seed, delta, k):
    first, second = random_rows(seed, 1), random_rows(seed + 1, 1)
    found = product(first, second, np.array([delta * 30]))
    wanted = direction_by_loops(product_by_loops([first[0], second[0]], [0, delta]))
    assert circular_distance_deg(found[0], wanted) < 1e-6
    rotated = product(np.roll(first, k, axis=1), np.roll(second, k, axis=1), np.array([delta * 30]))
    assert circular_distance_deg(rotated[0], found[0] + 30 * k) < 1e-6


def test_images_that_exclude_each_other_fall_back_on_the_first():
    first, second = np.eye(12)[[3]], np.eye(12)[[8]]
    assert product(first, second, np.array([60]))[0] == pytest.approx(90)
    # Each pair for itself: the other pair here agrees.
    found = product(np.eye(12)[[3, 4]], np.eye(12)[[8, 6]], np.array([60, 60]))
    assert found == pytest.approx([90, 120])


def test_distributions_of_several_objects_are_fused_each_by_its_own_rotation():
    """As policies call it: objects by views, and a rotation for each."""
    first, second = random_rows(0, 6).reshape(2, 3, 12), random_rows(1, 6).reshape(2, 3, 12)
    delta = np.array([[0, 30, 60], [330, 180, 90]])
    found = product(first, second, delta)
    assert found.shape == (2, 3)
    for one in np.ndindex(2, 3):
        alone = product(first[one][None], second[one][None], delta[one][None])
        assert found[one] == pytest.approx(alone[0], abs=1e-9)


def half_turned(rows):
    return (rows + np.roll(rows, rows.shape[-1] // 2, axis=-1)) / 2


@pytest.mark.parametrize("n_pairs", [1, 2000])
def test_without_a_resultant_the_posterior_is_the_first_estimate(n_pairs):
    """Front and back look the same: few pairs and many."""
    density = evidence_of().conditionals
    pair = [half_turned(half_turned(rows.T).T) for rows in (density.viewpoint, density.estimate)]
    evidence = replace(evidence_of(), conditionals=Conditionals(*pair))
    rng = np.random.default_rng(0)
    first, second = rng.uniform(-360, 720, (2, n_pairs))
    delta = 15.0 * rng.integers(0, N_BINS, n_pairs)
    found = posterior(first, second, delta, evidence)
    assert circular_distance_deg(found, average(first, first, 0.0)).max() < 1e-9


@given(st.integers(0, 99), st.integers(0, 11))
def test_without_a_resultant_the_product_is_the_first_estimate(seed, delta):
    first, second = random_rows(seed, 1), half_turned(random_rows(seed + 1, 1))
    periodic = half_turned(first)
    second = half_turned(second)
    found = product(periodic, second, np.array([delta * 30]))
    # An estimate that is as likely as its opposite is the first of the two.
    assert found[0] == 30 * (periodic[0] > periodic[0].max() - 1e-9).argmax()
    rotated = (np.roll(rows, 6, axis=1) for rows in (periodic, second))
    assert product(*rotated, np.array([delta * 30]))[0] == found[0]


def test_errors_without_a_resultant_are_those_of_fusing_each_pair():
    views = half_turned(random_rows(3, 12))[None]
    errors = fusion.rotation_errors_deg(views, evidence_of(), "product")
    for delta, view in np.ndindex(12, 12):
        other = views[0, (view + delta) % 12]
        fused = product(views[0, view][None], other[None], np.array([delta * 30]))
        wanted = circular_distance_deg(fused[0], view * 30)
        assert errors[delta, 0, view] == pytest.approx(float(wanted), abs=1e-4)


@pytest.mark.parametrize("name", ESTIMATE_FUSIONS)
def test_errors_after_every_rotation_are_those_of_fusing_each_pair(name):
    """With more views than bins: l[delta, object, view], one pair of views at a time."""
    evidence, estimate = evidence_of(), estimates(2, 2 * N_BINS, seed=5)
    errors = fusion.rotation_errors_deg(estimate, evidence, name)
    assert errors.shape == (N_BINS, 2, 2 * N_BINS)
    assert errors.dtype == np.float32
    for delta, one, view in [(0, 0, 0), (5, 1, 47), (23, 0, 30), (12, 1, 12)]:
        second = estimate[one, (view + 2 * delta) % (2 * N_BINS)]
        fused = fusion.FUSIONS[name](estimate[one, view], second, delta * 15.0, evidence)
        expected = circular_distance_deg(fused, view * 7.5)
        assert errors[delta, one, view] == pytest.approx(float(expected), abs=0.02)


def test_errors_of_calibration_views_take_one_view_for_each_bin_and_are_made_once():
    evidence = evidence_of()
    found = fusion.calibration_errors_deg(evidence, "average")
    views = evidence.estimate_deg[:, ::2]
    expected = fusion.rotation_errors_deg(views, evidence, "average")
    np.testing.assert_array_equal(found, expected)
    assert fusion.calibration_errors_deg(evidence, "average") is found
    assert not np.array_equal(fusion.calibration_errors_deg(evidence, "posterior"), found)
