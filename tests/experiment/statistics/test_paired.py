import zlib

import numpy as np
import pandas as pd
import pytest

from nbv.errors import UserError
from nbv.experiment.statistics import metrics, paired

METHODS = ("single", "random", "opposite", "proposed")


def evaluated(seed: int, n_objects: int = 9, n_folds: int = 3) -> pd.DataFrame:
    """Errors of one unit, as `load_evaluations` gives them: each object is tested in one fold."""
    rng = np.random.default_rng(seed)
    parts = []
    for method in METHODS:
        errors = rng.gamma(2.0, 8.0, (n_objects, 360)) % 90
        # Now and then the front is taken for the back.
        errors = np.where(rng.random(errors.shape) < 0.1, 180 - errors, errors)
        if method == "opposite":
            errors[:, 180:] = errors[:, :180]
        for fold in range(1, n_folds + 1):
            for one in range(fold - 1, n_objects, n_folds):
                columns = {"method": method, "fold": fold, "object_id": f"{one:04d}"}
                views = {"initial_deg": np.arange(360.0), "error_deg": errors[one]}
                parts.append(pd.DataFrame(columns | views))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def unit_frames() -> dict[tuple[str, int], pd.DataFrame]:
    return {("mug", 0): evaluated(0), ("chair", 0): evaluated(1)}


def test_groups_are_the_papers_quarters():
    azimuths = np.arange(360.0)
    expected = [
        1 if a < 45 or a >= 315 else 2 if a < 135 else 3 if a < 225 else 4 for a in azimuths
    ]
    assert paired.viewpoint_group(azimuths).tolist() == expected
    assert np.bincount(paired.viewpoint_group(azimuths))[1:].tolist() == [90] * 4


def test_methods_are_lined_up_image_by_image(unit_frames, rng):
    frame = unit_frames["mug", 0]
    straight = paired.pair_methods(frame, "mug")
    shuffled = paired.pair_methods(frame.sample(frac=1.0, random_state=3), "mug")
    for method, errors in straight.errors_deg.items():
        np.testing.assert_array_equal(errors, shuffled.errors_deg[method])
    # Opposite sees the same pair of views from azimuths 180 apart, so its errors come in pairs.
    opposite = straight.errors_deg["opposite"].reshape(-1, 360)
    np.testing.assert_allclose(opposite[:, :180], opposite[:, 180:], atol=1e-3)


def test_methods_on_different_images_are_refused(unit_frames):
    frame = unit_frames["mug", 0]
    fewer = frame.drop(frame.index[(frame["method"] == "random")][:1])
    message = "^mug: random was evaluated on other images than single; evaluate both again$"
    with pytest.raises(UserError, match=message):
        paired.pair_methods(fewer, "mug")


def test_pooled_images_keep_their_objects_apart(unit_frames):
    parts = [paired.pair_methods(unit_frames[unit], unit[0]) for unit in (("mug", 0), ("chair", 0))]
    both = paired.pool(parts)
    assert both.n_objects == 18
    assert both.n_images == sum(part.n_images for part in parts)
    joined = np.concatenate([part.errors_deg["single"] for part in parts])
    found = paired.estimate("mae", both, "single", paired.Resampler(0, 50))
    assert found.value == pytest.approx(joined.mean())
    for name in ("folds", "initial_deg"):
        expected = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(getattr(both, name), expected)
    np.testing.assert_array_equal(both.objects[: parts[0].n_images], parts[0].objects)
    np.testing.assert_array_equal(both.objects[parts[0].n_images :], parts[1].objects + 9)
    assert both.category_of == ("mug",) * 9 + ("chair",) * 9


def test_pooled_methods_are_those_that_all_categories_have(unit_frames):
    first = paired.pair_methods(unit_frames["mug", 0], "mug")
    rest = unit_frames["chair", 0]
    second = paired.pair_methods(rest[rest["method"] != "random"], "chair")
    for parts in ([first, second], [second, first]):
        assert list(paired.pool(parts).errors_deg) == ["single", "opposite", "proposed"]
    assert list(paired.pool([first]).errors_deg) == list(METHODS)


def test_methods_keep_the_order_in_which_they_appear(unit_frames):
    """Also as categories, of which some are not used."""
    frame = unit_frames["mug", 0]
    some = frame[frame["method"] != "opposite"]
    names = pd.CategoricalDtype(sorted(METHODS))
    found = paired.pair_methods(some.assign(method=some["method"].astype(names)), "mug")
    assert list(found.errors_deg) == ["single", "random", "proposed"]


def test_objects_are_numbered_by_their_names(unit_frames):
    frame = unit_frames["mug", 0]
    found = paired.pair_methods(frame.assign(object_id=frame["object_id"].astype(int) + 5), "mug")
    # 5 to 13 in the order of text: 10, 11, 12, 13, 5, ... In fold 1 are 5, 8 and 11.
    assert found.objects[: 3 * 360 : 360].tolist() == [4, 7, 1]


def test_no_method_at_all_is_refused(unit_frames):
    frame = unit_frames["mug", 0]
    with pytest.raises(UserError, match="mug: no evaluated method; evaluate one first"):
        paired.pair_methods(frame[:0], "mug")


def test_selected_images_keep_everything_that_belongs_to_them(unit_frames):
    sample = paired.pair_methods(unit_frames["mug", 0], "mug")
    mask = sample.initial_deg < 90
    kept = sample.select(mask)
    assert (kept.n_images, kept.n_objects) == (9 * 90, 9)
    assert (kept.initial_deg < 90).all()
    np.testing.assert_array_equal(kept.folds, sample.folds[mask])
    np.testing.assert_array_equal(kept.objects, sample.objects[mask])
    assert kept.category_of == sample.category_of
    for method in METHODS:
        np.testing.assert_array_equal(kept.errors_deg[method], sample.errors_deg[method][mask])


def test_images_are_ordered_by_fold_object_and_azimuth(unit_frames):
    sample = paired.pair_methods(unit_frames["mug", 0], "mug")
    np.testing.assert_array_equal(sample.folds, np.repeat([1, 2, 3], 3 * 360))
    np.testing.assert_array_equal(sample.objects[::360], [0, 3, 6, 1, 4, 7, 2, 5, 8])
    np.testing.assert_array_equal(sample.initial_deg, np.tile(np.arange(360.0), 9))
    assert sample.category_of == ("mug",) * 9
    assert sample.objects.dtype == sample.folds.dtype == np.int64


def test_a_resampler_takes_one_seed_from_the_generator_and_two_thousand_resamples():
    one, other = (paired.Resampler.seeded(np.random.default_rng(s), 7) for s in (1, 2))
    assert one.seed == int(np.random.default_rng(1).integers(2**31)) != other.seed
    assert one.n_resamples == 7
    assert paired.Resampler(0).n_resamples == 2000


def test_draws_do_not_depend_on_what_was_asked_before(unit_frames):
    mug = paired.pair_methods(unit_frames["mug", 0], "mug")
    chair = paired.pair_methods(unit_frames["chair", 0], "chair")
    one, other = paired.Resampler(3, 20), paired.Resampler(3, 20)
    one.multiplicities(chair)
    np.testing.assert_array_equal(one.multiplicities(mug), other.multiplicities(mug))
    assert (one.multiplicities(mug) != one.multiplicities(chair)).any()


def test_draws_are_those_of_the_seed_the_category_and_the_fold(unit_frames):
    """Published intervals depend on it: 0 stands for all folds."""
    mug = paired.pair_methods(unit_frames["mug", 0], "mug")
    seeds = ([3, zlib.crc32(b"mug"), fold] for fold in range(4))
    together, *by_fold = (np.random.default_rng(seed) for seed in seeds)
    found = paired.Resampler(3, 20)
    expected = metrics.resample_objects(9, together, 20)
    np.testing.assert_array_equal(found.multiplicities(mug), expected)
    drawn = found.multiplicities_by_fold(mug)
    for rng, first in zip(by_fold, range(3), strict=True):
        np.testing.assert_array_equal(drawn[:, first::3], metrics.resample_objects(3, rng, 20))


def test_columns_of_other_widths_are_paired_alike(unit_frames):
    frame = unit_frames["mug", 0]
    narrow = frame.astype({"fold": np.int8, "initial_deg": np.int16, "error_deg": np.float32})
    sample = paired.pair_methods(narrow, "mug")
    assert sample.folds.dtype == np.int64
    assert sample.initial_deg.dtype == sample.errors_deg["single"].dtype == np.float64


def test_draws_by_fold_keep_each_folds_size(unit_frames):
    mug = paired.pair_methods(unit_frames["mug", 0], "mug")
    drawn = paired.Resampler(3, 20).multiplicities_by_fold(mug)
    assert drawn.dtype == np.int64
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
def test_statistics_of_pooled_images(unit_frames, statistic, expected):
    sample = paired.pair_methods(unit_frames["mug", 0], "mug")
    found = paired.estimate(statistic, sample, "random", paired.Resampler(0, 200))
    errors = sample.errors_deg["random"]
    assert found.value == pytest.approx(expected(errors))
    assert found.value == metrics.statistic_of(errors, statistic)
    interval = found.interval()
    assert interval.low < interval.value < interval.high


@pytest.mark.parametrize("statistic", ["mae", "median", "pauc"])
def test_no_images_have_no_statistic(unit_frames, statistic):
    sample = paired.pair_methods(unit_frames["mug", 0], "mug")
    nothing = sample.select(sample.folds == 9)
    with pytest.raises(ValueError, match="no errors"):
        paired.estimate(statistic, nothing, "single", paired.Resampler(0, 10))


@pytest.mark.parametrize("n_folds", [2, 3])
@pytest.mark.parametrize("statistic", ["mae", "pauc"])
def test_sigma_is_resampled_within_each_fold(n_folds, statistic):
    """Each resample's images put together one object at a time."""
    sample = paired.pair_methods(evaluated(4, n_folds=n_folds), "mug")
    found = paired.estimate(f"{statistic}_sigma", sample, "single", paired.Resampler(3, 20))
    drawn = paired.Resampler(3, 20).multiplicities_by_fold(sample)
    errors = sample.errors_deg["single"]
    in_fold = [sample.folds == fold for fold in range(1, n_folds + 1)]
    assert found.value == pytest.approx(
        np.std([metrics.statistic_of(errors[one], statistic) for one in in_fold], ddof=1)
    )
    for counts, sigma in zip(drawn, found.samples, strict=True):
        repeated = [np.repeat(errors[one], counts[sample.objects[one]]) for one in in_fold]
        assert sigma == pytest.approx(
            np.std([metrics.statistic_of(each, statistic) for each in repeated], ddof=1)
        )


def test_one_fold_has_no_sigma(unit_frames):
    sample = paired.pair_methods(unit_frames["mug", 0], "mug")
    found = paired.estimate(
        "mae_sigma", sample.select(sample.folds == 1), "single", paired.Resampler(0, 10)
    )
    assert np.isnan(found.value)
    assert np.isnan(found.interval().low)
    assert found.samples.shape == (10,)
    assert found.samples.dtype == np.float64
    assert np.isnan(found.samples).all()


def sample_of(a, b, objects, categories=("mug",)):
    """Two methods' errors; objects in equal shares of the categories."""
    n_objects = int(np.max(objects)) + 1
    per_category = -(-n_objects // len(categories))
    return paired.PairedErrors(
        {"a": np.asarray(a, dtype=float), "b": np.asarray(b, dtype=float)},
        np.asarray(objects),
        np.asarray(objects) % 3 + 1,
        np.arange(len(objects)) * 10.0 % 360,
        tuple(categories[index // per_category] for index in range(n_objects)),
    )


def difference(sample, seed=1, n_resamples=2000, a="a", b="b", statistic="mae"):
    resampler = paired.Resampler(seed, n_resamples)
    first = paired.estimate(statistic, sample, a, resampler)
    return first.minus(paired.estimate(statistic, sample, b, resampler))


def uneven(rng, n_objects=7):
    objects = np.repeat(np.arange(n_objects), rng.integers(1, 9, n_objects))
    return rng.gamma(2.0, 5.0, objects.size), rng.gamma(2.0, 6.0, objects.size), objects


@pytest.mark.parametrize("statistic", paired.LOWER_IS_BETTER)
def test_identical_methods_differ_by_exactly_nothing(rng, statistic):
    a, _, objects = uneven(rng)
    found = difference(sample_of(a, a.copy(), objects), statistic=statistic)
    assert found == metrics.Interval(0, 0, 0)


@pytest.mark.parametrize("statistic", paired.LOWER_IS_BETTER)
def test_swapping_the_methods_mirrors_the_interval(rng, statistic):
    sample = sample_of(*uneven(rng))
    one = difference(sample, statistic=statistic)
    other = difference(sample, a="b", b="a", statistic=statistic)
    mirrored = (-other.value, -other.high, -other.low)
    assert (one.value, one.low, one.high) == pytest.approx(mirrored)


def test_repeating_every_view_does_not_narrow_the_interval(rng):
    # Whole objects are the units of evidence: more views of the same ones are no more of it.
    a, b, objects = rng.normal(5, 2, 30), rng.normal(6, 2, 30), np.arange(30)
    few = difference(sample_of(a, b, objects))
    many = difference(sample_of(*(np.repeat(each, 360) for each in (a, b, objects))))
    assert (many.low, many.high) == pytest.approx((few.low, few.high))


def test_the_interval_covers_the_truth_about_as_often_as_it_says():
    hits = 0
    for seed in range(200):
        a = np.repeat(np.random.default_rng(seed).normal(1.0, 2.0, 40), 5)
        sample = sample_of(a, np.zeros(200), np.repeat(np.arange(40), 5))
        interval = difference(sample, seed, 400)
        hits += interval.low <= 1.0 <= interval.high
    assert 0.89 <= hits / 200 <= 0.99


def test_objects_that_are_resampled_together_are_counted():
    objects = np.repeat(np.arange(12), 4)
    sample = sample_of(objects, objects, objects, ("chair", "mug"))
    assert paired.fewest_resampled("mae", sample) == 6
    assert paired.fewest_resampled("mae_sigma", sample) == 2
    assert paired.fewest_resampled("mae", sample.select(objects != 11)) == 5
    assert paired.fewest_resampled("mae", sample.select(objects < 0)) == 0
