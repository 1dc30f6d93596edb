"""The out-of-distribution score of crops."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from made_bundles import BINS, random_codes, sweep_logits
from nbv.bundles.network import Sweep
from nbv.bundles.ood import (
    IN_DISTRIBUTION_SHARE,
    MOST_REFERENCES,
    NEIGHBOUR,
    crop_features,
    energy,
    fit_ood,
    ood_score,
)


def sweeps(n: int, seed: int = 0, views: int = BINS) -> list[Sweep]:
    rng = np.random.default_rng(seed)
    logits = sweep_logits(rng, n, views)
    azimuth_deg = np.arange(views) * (360.0 / views)
    return [
        Sweep(f"o{i}", "1", 0.0, azimuth_deg, logits[i], random_codes(rng, views)) for i in range(n)
    ]


def of_all(found, made) -> np.ndarray:
    return np.concatenate([ood_score(found, one.codes, one.logits) for one in made])


@pytest.mark.parametrize("side", [16, 32, 48])
def test_features_are_share_and_mean_depth_of_each_square(side, rng):
    codes = random_codes(rng, 3, side)
    step = side // 16
    found = crop_features(codes)
    for image in range(3):
        for row in range(16):
            for column in range(16):
                square = codes[image, row * step : (row + 1) * step, column * step :][:, :step]
                seen = square[square > 0].astype(float)
                place = 16 * row + column
                assert found[image, place] == pytest.approx(128 * len(seen) / step**2)
                depth = seen.mean() - 128 if len(seen) else 0.0
                assert found[image, 256 + place] == pytest.approx(depth, abs=1e-4)


@given(shift=st.floats(-1e4, 1e4), seed=st.integers(0, 100))
def test_the_energy_is_that_of_its_definition_at_any_size_of_logits(shift, seed):
    logits = np.random.default_rng(seed).normal(0, 3, (4, 9))
    wanted = -np.log(np.exp(logits).sum(axis=1)) - shift
    assert energy(logits + shift) == pytest.approx(wanted, rel=1e-9, abs=1e-6)


def test_the_score_is_that_of_its_definition():
    made = sweeps(3)
    found = fit_ood(made)
    codes, logits = made[0].codes[:5], made[0].logits[:5]
    for code, logit, score in zip(codes, logits, ood_score(found, codes, logits), strict=True):
        place = (crop_features(code[None])[0] - found.mean) @ found.basis
        apart = np.sort(np.linalg.norm(found.references - place, axis=1))[NEIGHBOUR - 1]
        (near, spread), (low, width) = found.scales
        total = (apart - near) / spread + (energy(logit[None])[0] - low) / width
        assert score == pytest.approx(max(total, 0) / found.threshold, rel=1e-3, abs=1e-3)


def test_the_limit_keeps_its_share_of_other_objects():
    found = fit_ood(sweeps(20))
    others = of_all(found, sweeps(40, seed=1))
    assert np.mean(others <= 1) == pytest.approx(IN_DISTRIBUTION_SHARE, abs=0.04)


def test_the_own_object_does_not_count_in_the_limit():
    """A sweep that is there twice is near itself; the limit must not believe that."""
    made = sweeps(4)
    doubled = [*made, *made]
    found = fit_ood(doubled)
    assert np.mean(of_all(found, made) <= 1) > IN_DISTRIBUTION_SHARE
    assert np.mean(of_all(found, sweeps(20, seed=2)) <= 1) > 0.8


@pytest.mark.parametrize("code", [1, 255])
def test_what_is_seen_otherwise_is_out_of_distribution(code):
    """A near or a far plane that fills the crop, for a network that is as sure as ever."""
    made = sweeps(6)
    found = fit_ood(made)
    strange = np.full_like(made[0].codes, code)
    scores = ood_score(found, strange, made[0].logits)
    assert np.quantile(scores, 0.1) > np.quantile(of_all(found, made), 0.9)
    assert np.median(scores) > 1


def test_what_the_network_is_unsure_of_scores_higher():
    """Outside the range in which the made logits are noise alone."""
    made = sweeps(6)
    found = fit_ood(made)
    is_sure = np.abs(made[0].azimuth_deg - 90.0) > 60.0
    codes, logits = made[0].codes[is_sure], made[0].logits[is_sure]
    scores = [ood_score(found, codes, factor * logits) for factor in (1.0, 0.7, 0.4)]
    assert (np.diff(scores, axis=0) >= 0).all()
    assert np.median(scores[2]) > np.median(scores[0])


def test_there_are_no_more_references_than_a_bundle_can_hold():
    found = fit_ood(sweeps(12, views=360))
    assert 0.5 * MOST_REFERENCES <= len(found.references) <= MOST_REFERENCES


def test_one_object_alone_is_its_own_calibration():
    made = sweeps(1)
    assert np.mean(of_all(fit_ood(made), made) <= 1) >= IN_DISTRIBUTION_SHARE - 0.05
