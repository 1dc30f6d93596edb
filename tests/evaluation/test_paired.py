from __future__ import annotations

import numpy as np
import pytest

from nbv.errors import UserError
from nbv.evaluation import metrics, paired


def test_groups_are_the_papers_quarters():
    azimuths = np.arange(360.0)
    expected = [
        1 if a < 45 or a >= 315 else 2 if a < 135 else 3 if a < 225 else 4 for a in azimuths
    ]
    assert paired.viewpoint_group(azimuths).tolist() == expected
    assert np.bincount(paired.viewpoint_group(azimuths))[1:].tolist() == [90] * 4


def test_methods_are_lined_up_image_by_image(evaluations, rng):
    frame = evaluations["mug", 0]
    straight = paired.pair_methods(frame, "mug")
    shuffled = paired.pair_methods(frame.sample(frac=1.0, random_state=3), "mug")
    for method, errors in straight.errors_deg.items():
        np.testing.assert_array_equal(errors, shuffled.errors_deg[method])
    # Opposite sees the same pair of views from azimuths 180 apart, so its errors come in pairs.
    opposite = straight.errors_deg["opposite"].reshape(-1, 360)
    np.testing.assert_allclose(opposite[:, :180], opposite[:, 180:], atol=1e-3)


def test_methods_on_different_images_are_refused(evaluations):
    frame = evaluations["mug", 0]
    fewer = frame.drop(frame.index[(frame["method"] == "random")][:1])
    with pytest.raises(UserError, match="random was evaluated on other images than single"):
        paired.pair_methods(fewer, "mug")


def test_pooled_images_keep_their_objects_apart(evaluations):
    parts = [paired.pair_methods(evaluations[unit], unit[0]) for unit in (("mug", 0), ("chair", 0))]
    both = paired.pool(parts)
    assert both.n_objects == 18
    assert both.n_images == sum(part.n_images for part in parts)
    joined = np.concatenate([part.errors_deg["single"] for part in parts])
    found = paired.estimate("mae", both, "single", paired.Resampler(0, 50))
    assert found.value == pytest.approx(joined.mean())


def test_draws_do_not_depend_on_what_was_asked_before(evaluations):
    mug = paired.pair_methods(evaluations["mug", 0], "mug")
    chair = paired.pair_methods(evaluations["chair", 0], "chair")
    one, other = paired.Resampler(3, 20), paired.Resampler(3, 20)
    one.multiplicities(chair)
    np.testing.assert_array_equal(one.multiplicities(mug), other.multiplicities(mug))
    assert (one.multiplicities(mug) != one.multiplicities(chair)).any()


def test_draws_by_fold_keep_each_folds_size(evaluations):
    mug = paired.pair_methods(evaluations["mug", 0], "mug")
    drawn = paired.Resampler(3, 20).multiplicities_by_fold(mug)
    for fold in (1, 2, 3):
        members = np.unique(mug.objects[mug.folds == fold])
        assert (drawn[:, members].sum(axis=1) == members.size).all()


@pytest.mark.parametrize(
    ("statistic", "expected"),
    [
        ("mae", np.mean),
        ("median", np.median),
        ("pauc", lambda e: 100 - np.mean(np.minimum(e, 100))),
    ],
)
def test_statistics_of_pooled_images(evaluations, statistic, expected):
    sample = paired.pair_methods(evaluations["mug", 0], "mug")
    found = paired.estimate(statistic, sample, "random", paired.Resampler(0, 200))
    assert found.value == pytest.approx(expected(sample.errors_deg["random"]))
    interval = found.interval()
    assert interval.low < interval.value < interval.high


def test_sigma_is_over_fold_means(evaluations):
    frame = evaluations["mug", 0]
    means = frame[frame["method"] == "proposed"].groupby("fold")["error_deg"].mean()
    sample = paired.pair_methods(frame, "mug")
    found = paired.estimate("mae_sigma", sample, "proposed", paired.Resampler(0, 200))
    assert found.value == pytest.approx(metrics.fold_std(means))
    assert paired.fold_sigma("mae", sample, "proposed") == pytest.approx(means.std())


def test_one_fold_has_no_sigma(evaluations):
    sample = paired.pair_methods(evaluations["mug", 0], "mug")
    found = paired.estimate(
        "mae_sigma", sample.select(sample.folds == 1), "single", paired.Resampler(0, 10)
    )
    assert np.isnan(found.value)
    assert np.isnan(found.interval().low)
