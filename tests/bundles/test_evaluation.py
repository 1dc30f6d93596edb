"""How far each way of choosing views gets on recordings, against brute force."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from made_bundles import BINS, WIDTH, random_codes, sweep_logits
from nbv.bundles.evaluation import (
    FIXED,
    OPPOSITE,
    PAPER,
    RANDOM,
    RECOMMENDED,
    SINGLE,
    SPACED,
    UNTIL,
    at_random,
    best_fixed_deg,
    count_ood,
    evaluate,
    fixed_errors_deg,
)
from nbv.bundles.network import Sweep
from nbv.bundles.ood import ood_score
from nbv.bundles.recommender import Recommender
from nbv.core.alike.compare import CalibrationViews
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.fusion import product
from nbv.core.circle.logits import from_logits
from nbv.errors import UserError

COLUMNS = [
    *("object_id", "sequence", "choice", "n_views", "mae_deg", "median_deg", "above_45_percent"),
    *("offset_deg", "mae_without_offset_deg", "expected_deg", "mean_views"),
]
CHOICES = {RANDOM, FIXED, OPPOSITE, RECOMMENDED, PAPER}


def recording(seed=0, n=BINS, elevation=np.nan, name="cup", logits=None) -> Sweep:
    azimuth_deg = np.arange(n) * (360.0 / n)
    if logits is None:
        logits = sweep_logits(np.random.default_rng(seed), 1, n)[0]
    codes = random_codes(np.random.default_rng(seed), n)
    return Sweep(name, "1", elevation, azimuth_deg, logits.astype(np.float32), codes)


def sure(azimuth_deg, error_deg=0.0) -> np.ndarray:
    """Logits whose distributions have their mean direction at each azimuth and an error.

    They are wide for the bins, which pull the direction of what is narrow to their centres.
    """
    apart = np.arange(BINS) * WIDTH - (np.asarray(azimuth_deg) + error_deg)[:, None]
    return 8.0 * np.cos(np.radians(apart))


def rows_of(found, choice, n_views):
    return found[(found["choice"] == choice) & (found["n_views"] == n_views)].iloc[0]


def error(pose, truth):
    return (pose - truth + 180.0) % 360.0 - 180.0


# Known answers


def test_a_network_that_is_right_has_no_error(bundle):
    sweep = recording(logits=sure(np.arange(BINS) * WIDTH))
    found = evaluate(bundle, [sweep])
    assert list(found.columns) == COLUMNS
    assert len(found) == 1 + 4 * 5
    for column in ("mae_deg", "median_deg", "mae_without_offset_deg", "above_45_percent"):
        assert np.abs(found[column]).max() < 0.01
    assert np.abs(found["offset_deg"]).max() < 0.01


@pytest.mark.parametrize("offset", [30.0, -75.0, 170.0, 3.0])
def test_a_constant_offset_is_told_and_taken_off(bundle, offset):
    """The turntable's zero: all errors are alike."""
    sweep = recording(logits=sure(np.arange(BINS) * WIDTH, offset))
    found = evaluate(bundle, [sweep], n_views=(2, 3))
    assert found["offset_deg"].to_numpy() == pytest.approx(offset, abs=0.2)
    assert found["mae_deg"].to_numpy() == pytest.approx(abs(offset), abs=0.3)
    assert found["median_deg"].to_numpy() == pytest.approx(abs(offset), abs=0.3)
    assert found["mae_without_offset_deg"].max() < 0.3
    assert (found["above_45_percent"] == (100.0 if abs(offset) > 45 else 0.0)).all()


def test_the_offset_is_the_circular_median_of_single_view_errors(bundle):
    sweep = recording(3)
    rows = from_logits(sweep.logits, bundle.temperature)
    angles = np.exp(2j * np.pi * np.arange(BINS) / BINS)
    errors = error(np.degrees(np.angle(rows @ angles)), sweep.azimuth_deg)
    left = [np.abs(error(errors, one)).mean() for one in errors]
    found = evaluate(bundle, [sweep], n_views=(2,))
    (offset,) = set(found["offset_deg"])
    single = rows_of(found, SINGLE, 1)
    assert single["mae_deg"] == pytest.approx(np.abs(errors).mean())
    assert single["median_deg"] == pytest.approx(np.median(np.abs(errors)))
    assert single["above_45_percent"] == pytest.approx(100 * (np.abs(errors) > 45).mean())
    rest = np.abs(error(errors, offset))
    assert single["mae_without_offset_deg"] == pytest.approx(rest.mean())
    assert rest.mean() == pytest.approx(min(left))


# Brute force


def two_view_errors(bundle, sweep, rotation) -> np.ndarray:
    """From every frame, with the frame that is nearest to the rotation."""
    rows = from_logits(sweep.logits, bundle.temperature)
    found = []
    for first, azimuth in enumerate(sweep.azimuth_deg):
        apart = circular_distance_deg(sweep.azimuth_deg - azimuth, rotation)
        apart[first] = np.inf
        second = int(apart.argmin())
        pose = product(rows[first], rows[second], sweep.azimuth_deg[second] - azimuth)
        found.append(error(pose, azimuth))
    return np.array(found)


@pytest.mark.parametrize("seed", range(3))
def test_the_opposite_view_is_half_a_turn_away(bundle, seed):
    sweep = recording(seed)
    wanted = np.abs(two_view_errors(bundle, sweep, 180.0))
    row = rows_of(evaluate(bundle, [sweep], n_views=(2,)), OPPOSITE, 2)
    assert row["mae_deg"] == pytest.approx(wanted.mean(), rel=1e-4)
    assert row["median_deg"] == pytest.approx(np.median(wanted), rel=1e-4)
    assert row["above_45_percent"] == pytest.approx(100 * (wanted > 45).mean())


@pytest.mark.parametrize("n_views", [3, 4, 6])
def test_evenly_spaced_views_are_the_product_of_all(bundle, n_views):
    sweep = recording(5)
    rows = from_logits(sweep.logits, bundle.temperature)
    step = BINS // n_views
    angles = np.exp(2j * np.pi * np.arange(BINS) / BINS)
    wanted = []
    for first in range(BINS):
        views = [(first + step * view) % BINS for view in range(n_views)]
        logs = sum(np.roll(np.log(rows[v]), -step * i) for i, v in enumerate(views))
        pose = np.degrees(np.angle(np.exp(logs - logs.max()) @ angles))
        wanted.append(abs(error(pose, first * WIDTH)))
    found = rows_of(evaluate(bundle, [sweep], n_views=(n_views,)), SPACED, n_views)
    assert found["mae_deg"] == pytest.approx(np.mean(wanted), rel=1e-4)


@pytest.mark.parametrize("elevation", [np.nan, 0.0, 25.0])
def test_the_best_fixed_rotation_is_that_of_the_calibration(bundle, elevation):
    share = np.ones(len(bundle.elevation_deg))
    if np.isfinite(elevation):
        share = np.exp(-0.5 * ((bundle.elevation_deg - elevation) / 10.0) ** 2)
    cost = np.zeros(BINS)
    for own, counts in zip(bundle.distributions.astype(float), share, strict=True):
        for first in range(BINS):
            for step in range(BINS):
                pose = product(own[first], own[(first + step) % BINS], step * WIDTH)
                cost[step] += counts * abs(error(pose, first * WIDTH))
    wanted = np.abs(two_view_errors(bundle, recording(1), cost.argmin() * WIDTH))
    sweep = recording(1, elevation=elevation)
    row = rows_of(evaluate(bundle, [sweep], n_views=(2,)), FIXED, 2)
    assert row["mae_deg"] == pytest.approx(wanted.mean(), rel=1e-4)


@pytest.mark.parametrize("n_views", [2, 3, 4, 6])
def test_the_best_fixed_step_keeps_views_apart_and_errs_least(bundle, n_views):
    """The views lie at equal steps on the calibration sweeps and are multiplied one by one."""
    angles = np.exp(2j * np.pi * np.arange(BINS) / BINS)
    errors = {}
    for step in range(BINS):
        places = [view * step * WIDTH % 360 for view in range(n_views)]
        pairs = [(one - other) % 360 for one in places for other in places if one is not other]
        if any(min(gap, 360 - gap) < 15 for gap in pairs):
            continue
        wanted = []
        for own in np.log(bundle.distributions.astype(float)):
            for first in range(BINS):
                views = [np.roll(own[(first + k * step) % BINS], -k * step) for k in range(n_views)]
                pose = np.degrees(np.angle(np.exp(sum(views) - sum(views).max()) @ angles))
                wanted.append(abs(error(pose, first * WIDTH)))
        errors[step] = np.mean(wanted)
    found = fixed_errors_deg(CalibrationViews.of_sweeps(bundle.distributions), n_views).mean(axis=0)
    assert np.flatnonzero(np.isfinite(found)).tolist() == list(errors)
    assert found[list(errors)] == pytest.approx(list(errors.values()), rel=1e-3)
    share = np.ones(len(bundle.distributions))
    found = fixed_errors_deg(CalibrationViews.of_sweeps(bundle.distributions), n_views)
    assert errors[round(best_fixed_deg(found, share) / WIDTH)] == pytest.approx(
        min(errors.values()), rel=1e-3
    )


@given(seed=st.integers(0, 2**32), n_taken=st.integers(1, 6))
def test_random_views_keep_away_from_all_so_far(seed, n_taken):
    rng = np.random.default_rng(seed)
    taken = rng.uniform(0, 360, (50, n_taken))
    taken[:, 0] = 0.0
    chosen = at_random(rng)(np.empty((50, 1)), taken)
    assert circular_distance_deg(chosen[:, None], taken).min() >= 15.0


def test_random_views_end_where_there_is_no_room():
    taken = np.arange(0.0, 360.0, 20.0)[None]
    assert np.isfinite(at_random(np.random.default_rng(0))(np.empty((1, 1)), taken)).all()


@pytest.mark.parametrize("elevation", [np.nan, 20.0])
@pytest.mark.parametrize("n_views", [2, 3, 4])
def test_recommended_views_are_those_that_the_recommender_names(bundle, elevation, n_views):
    """Frame after frame: the recommender is shown all frames so far and asked where to go.

    It says which error it expects, and where that is at most 8° one may stop.
    """
    sweep = recording(2, elevation=elevation)
    recommender = Recommender(bundle)
    recommender.network = lambda codes: sweep.logits[codes[:, 0, 0].astype(int)]
    known = None if np.isnan(elevation) else elevation
    wanted, expected, stopped, until_deg = [], [], [], 8.0
    for first in range(BINS):
        taken, stop = [first], None
        while True:
            codes = np.zeros((len(taken), 32, 32), dtype=np.uint8)
            codes[:, 0, 0] = taken
            rotations = [(frame - first) % BINS * WIDTH for frame in taken]
            answer = recommender.recommend_crops(codes, rotations, elevation_deg=known)
            now = abs(error(answer.azimuth_deg, taken[-1] * WIDTH))
            is_enough = answer.expected_error_deg <= until_deg or len(taken) == n_views
            if stop is None and is_enough:
                stop = now, answer.expected_error_deg, len(taken)
            if len(taken) == n_views:
                break
            taken.append((taken[-1] + round(answer.move.rotation_deg / WIDTH)) % BINS)
        wanted.append(now)
        expected.append(answer.expected_error_deg)
        stopped.append(stop)
    table = evaluate(bundle, [sweep], n_views=(n_views,), until_deg=until_deg)
    found = rows_of(table, RECOMMENDED, n_views)
    # A tie in single precision may be decided otherwise in one of them.
    assert found["mae_deg"] == pytest.approx(np.mean(wanted), rel=0.02)
    assert found["median_deg"] == pytest.approx(np.median(wanted), rel=0.05)
    assert found["expected_deg"] == pytest.approx(np.mean(expected), rel=0.02)
    assert found["mean_views"] == n_views
    ended = rows_of(table, UNTIL, n_views)[["mae_deg", "expected_deg", "mean_views"]]
    assert 1.0 < ended["mean_views"] < n_views
    assert ended.to_numpy(float) == pytest.approx(np.mean(stopped, axis=0), rel=0.02)


@pytest.mark.parametrize("n_views", [2, 3, 5])
@pytest.mark.parametrize(("elevation", "table"), [(np.nan, 0), (4.0, 0), (26.0, 1)])
def test_the_papers_views_are_those_of_the_table_of_the_nearest_elevation(
    bundle, elevation, table, n_views
):
    """Without a known elevation the lowest table; estimates are averaged as directions."""
    sweep = recording(2, elevation=elevation)
    rows = from_logits(sweep.logits, bundle.temperature)
    angles = np.exp(2j * np.pi * np.arange(BINS) / BINS)
    estimates = np.degrees(np.angle(rows @ angles)) % 360
    wanted = []
    for first, azimuth in enumerate(sweep.azimuth_deg):
        taken, total = [first], np.exp(1j * np.radians(estimates[first]))
        while len(taken) < n_views:
            here = taken[-1]
            rotation = bundle.paper.rotation_deg[table][round(estimates[here]) % 360]
            apart = circular_distance_deg(sweep.azimuth_deg - sweep.azimuth_deg[here], rotation)
            apart[taken] = np.inf
            taken.append(int(apart.argmin()))
            moved = estimates[taken[-1]] - (sweep.azimuth_deg[taken[-1]] - azimuth)
            total += np.exp(1j * np.radians(moved))
        wanted.append(abs(error(np.degrees(np.angle(total)), azimuth)))
    found = rows_of(evaluate(bundle, [sweep], n_views=(n_views,)), PAPER, n_views)
    assert found["mae_deg"] == pytest.approx(np.mean(wanted), rel=1e-4)


def test_random_views_are_the_mean_over_many(bundle):
    """Over all rotations from 15 to 345 degrees, within the error of 200 draws.

    Views from nearly the same place err alike, opposite ones the other way.
    """
    azimuth_deg = np.arange(BINS) * WIDTH
    sweep = recording(logits=sure(azimuth_deg, 40.0 * np.sin(np.radians(azimuth_deg))))
    each = np.stack(
        [np.abs(two_view_errors(bundle, sweep, WIDTH * step)) for step in range(1, BINS)]
    )
    # A draw within half a bin of 15 or 345 degrees is half as likely.
    weights = np.r_[0.5, np.ones(BINS - 3), 0.5] / (BINS - 2)
    wanted = weights @ each.mean(axis=1)
    assert each.mean(axis=1).max() > 5 * each.mean(axis=1).min()
    row = rows_of(evaluate(bundle, [sweep], n_views=(2,), n_random=200), RANDOM, 2)
    assert row["mae_deg"] == pytest.approx(wanted, rel=0.05)


# What does not matter


def test_draws_depend_on_the_seed_alone(bundle):
    sweep = recording(4)
    one, same = (evaluate(bundle, [sweep], n_views=(2,), seed=1) for _ in range(2))
    other = evaluate(bundle, [sweep], n_views=(2,), seed=2)
    assert one.equals(same)
    assert rows_of(one, RANDOM, 2)["mae_deg"] != rows_of(other, RANDOM, 2)["mae_deg"]
    for choice in CHOICES - {RANDOM}:
        assert rows_of(one, choice, 2).equals(rows_of(other, choice, 2))


def test_the_order_of_frames_does_not_matter(bundle, rng):
    sweep = recording(6)
    order = rng.permutation(BINS)
    shuffled = replace(sweep, azimuth_deg=sweep.azimuth_deg[order], logits=sweep.logits[order])
    one, other = (evaluate(bundle, [each], n_views=(2, 3)) for each in (sweep, shuffled))
    kept = one["choice"] != RANDOM
    numbers = COLUMNS[4:]
    wanted = other[kept][numbers].to_numpy()
    assert one[kept][numbers].to_numpy() == pytest.approx(wanted, rel=1e-3, nan_ok=True)


def test_recordings_do_not_matter_to_one_another(bundle):
    sweeps = [recording(1, name="a"), recording(2, name="b"), recording(3, name="a")]
    sweeps[2] = replace(sweeps[2], sequence="2")
    done: list[int] = []
    together = evaluate(bundle, sweeps, n_views=(2,), report=done.append)
    assert done == [1, 2, 3]
    assert list(dict.fromkeys(zip(together["object_id"], together["sequence"], strict=True))) == [
        *(("a", "1"), ("b", "1"), ("a", "2"))
    ]
    for sweep in sweeps:
        alone = evaluate(bundle, [sweep], n_views=(2,))
        part = together[
            (together["object_id"] == sweep.object_id) & (together["sequence"] == sweep.sequence)
        ]
        assert part.reset_index(drop=True).equals(alone)


# Few frames


def test_all_frames_of_a_short_recording_are_one_answer(bundle):
    """Four frames and four views: every way takes all of them, in some order."""
    sweep = recording(0)
    few = np.array([0, 5, 11, 17])
    short = replace(sweep, azimuth_deg=sweep.azimuth_deg[few], logits=sweep.logits[few])
    found = evaluate(bundle, [short], n_views=(4,))
    # Averaged estimates are another answer than the product.
    rows = found[~found["choice"].isin([SINGLE, PAPER])]
    assert len(rows) == 4
    assert rows["mae_deg"].to_numpy() == pytest.approx(rows["mae_deg"].iloc[0], rel=1e-6)


def test_a_number_of_views_counts_once(bundle):
    once = evaluate(bundle, [recording()], n_views=(3, 2))
    assert evaluate(bundle, [recording()], n_views=(3, 2, 3, 2)).equals(once)


def test_more_views_than_frames_are_one_line(bundle):
    sweep = recording(0)
    short = replace(sweep, azimuth_deg=sweep.azimuth_deg[:3], logits=sweep.logits[:3])
    evaluate(bundle, [short], n_views=(2, 3))
    with pytest.raises(UserError, match="object 'cup', sequence '1' has 3 frames, too few for 5"):
        evaluate(bundle, [sweep, short])


@pytest.mark.parametrize("n_views", [(1,), (0,), (-2, 3), (2, 1)])
def test_a_choice_of_views_needs_two(bundle, n_views):
    with pytest.raises(UserError, match="needs 2 or more"):
        evaluate(bundle, [recording()], n_views=n_views)


# Out of distribution


def test_ood_and_wrong_frames_are_counted(bundle):
    """Every third frame is far from everything; every fourth is wrong by 90 degrees."""
    azimuth_deg = np.arange(BINS) * WIDTH
    frames = np.arange(BINS)
    sweep = recording(logits=sure(azimuth_deg, np.where(frames % 4 == 0, 90.0, 0.0)))
    # Far from all crops that were calibrated, and near their middle.
    model = replace(bundle.ood, scales=np.array([[50, 1], [0, 1e9]], np.float32))
    strange = np.indices((32, 32)).sum(axis=0) % 2 * np.uint8(255)
    mean = bundle.ood.mean[:256].reshape(16, 16) > 64
    usual = np.kron(mean, np.ones((2, 2))).astype(np.uint8) * np.uint8(128)
    codes = np.where((frames % 3 == 0)[:, None, None], strange, usual).astype(np.uint8)
    limit = replace(model, threshold=1e-6)
    apart = ood_score(limit, codes, sweep.logits)
    limit = replace(model, threshold=float(1e-6 * np.median([apart.min(), apart.max()])))
    changed = replace(bundle, ood=limit)
    files = tuple(f"{i}.npy" for i in frames)
    (row,) = count_ood(changed, [replace(sweep, codes=codes, files=files)]).to_dict("records")
    wrong = row.pop("wrong")
    assert {one["file"] for one in wrong} == {f"{i}.npy" for i in frames if i % 4 == 0}
    errors_deg = [one["error_deg"] for one in wrong]
    assert errors_deg == sorted(errors_deg, reverse=True)
    assert row == {
        **{"object_id": "cup", "sequence": "1", "n_frames": 24},
        **{"n_ood": 8, "n_wrong": 6, "n_wrong_ood": 2, "warning": ""},
    }


ALL_ROUND = np.arange(BINS) * WIDTH


@pytest.mark.parametrize(
    ("azimuths_deg", "warning"),
    [
        (ALL_ROUND, ""),
        (360.0 - ALL_ROUND, "estimates run opposite to azimuths"),
        (np.roll(ALL_ROUND, 12)[np.argsort(np.sin(7 * np.arange(BINS)))], "do not follow azimuths"),
    ],
)
def test_azimuths_that_estimates_do_not_follow_are_told(bundle, azimuths_deg, warning):
    """A constant offset is no such thing: it is shown apart."""
    sweep = recording(logits=sure(ALL_ROUND, np.zeros(BINS)))
    (row,) = count_ood(bundle, [replace(sweep, azimuth_deg=azimuths_deg)]).to_dict("records")
    assert warning in row["warning"]
    assert bool(warning) == bool(row["warning"])
