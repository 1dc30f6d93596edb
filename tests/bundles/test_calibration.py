"""What held-out sweeps teach about a network."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from made_bundles import BINS, WIDTH, random_codes, sweep_logits
from nbv.bundles.bundle import ELEVATION_BANDWIDTH_DEG, elevation_weights
from nbv.bundles.calibration import (
    DENSITY,
    PRIOR_SWEEPS,
    paper_tables,
    recalibrated,
    temperature_of,
    without_offset,
)
from nbv.bundles.network import Sweep
from nbv.bundles.ood import ood_score
from nbv.bundles.recommender import Recommender
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.distributions import mean_direction_deg, rotated
from nbv.core.circle.logits import from_logits
from nbv.core.circle.selection import chosen_lookup
from nbv.core.circle.sweeps import WIDEST_GAP_DEG, bin_apart
from nbv.errors import UserError

AZIMUTHS = np.arange(BINS) * WIDTH
# Where the choice of a density does not matter.
ONE_DENSITY = {**DENSITY, "bandwidths_deg": [8], "pseudo_observations": [10]}


def sweep(
    name="a", seed=0, azimuth_deg=AZIMUTHS, elevation=0.0, logits=None, codes=None, sequence="1"
):
    rng = np.random.default_rng(seed)
    n = len(azimuth_deg)
    if logits is None:
        classes = np.arange(BINS) * WIDTH
        aim = 3.0 * np.cos(np.radians(classes - np.asarray(azimuth_deg)[:, None]))
        logits = aim + rng.normal(0, 0.5, (n, BINS))
    codes = random_codes(rng, n) if codes is None else codes
    return Sweep(name, sequence, elevation, np.asarray(azimuth_deg, float), logits, codes)


def without_common_error(logits):
    """The mean of views and of their mirror images at 0°: errors come in pairs, e and -e."""
    return (logits + logits[-np.arange(len(logits))][:, -np.arange(logits.shape[1])]) / 2


# Views a bin apart


@given(order=st.permutations(range(BINS)), start=st.integers(-3, 3))
def test_views_a_bin_apart_stay_as_they_are_in_any_order(order, start):
    rows = np.random.default_rng(0).dirichlet(np.ones(BINS), BINS)
    order = np.array(order)
    azimuth_deg = AZIMUTHS[order] + 360.0 * start
    assert np.array_equal(bin_apart(azimuth_deg, rows[order]), rows.astype(np.float32))


@given(seed=st.integers(0, 10**6), base=st.integers(0, BINS - 1))
def test_a_turn_of_the_object_turns_views_and_rows(seed, base):
    """Azimuths that all grow by some bins give the same table, rolled along both axes."""
    rng = np.random.default_rng(seed)
    azimuth_deg = (np.arange(0, 360, 7.5) + rng.uniform(-3, 3, 48)) % 360
    rows = rng.dirichlet(np.ones(BINS), 48)
    moved = bin_apart(azimuth_deg + base * WIDTH, np.roll(rows, base, axis=1))
    wanted = np.roll(bin_apart(azimuth_deg, rows), (base, base), axis=(0, 1))
    assert moved == pytest.approx(wanted, abs=1e-6)


@given(seed=st.integers(0, 10**6), n=st.integers(30, 200))
def test_each_bin_takes_its_nearest_view(seed, n):
    """By a search over all views, for each bin."""
    rng = np.random.default_rng(seed)
    azimuth_deg = (np.arange(n) * 360.0 / n + rng.uniform(0, 360.0 / n)) % 360
    order = rng.permutation(n)
    azimuth_deg, rows = azimuth_deg[order], rng.dirichlet(np.ones(BINS), n)
    found = bin_apart(azimuth_deg, rows)
    assert found.sum(axis=1) == pytest.approx(1.0, abs=1e-5)
    for bin_, row in enumerate(found):
        apart = circular_distance_deg(azimuth_deg, bin_ * WIDTH)
        tied = np.flatnonzero(apart < apart.min() + 1e-9)
        choices = [
            rotated(rows[view], (azimuth_deg[view] - bin_ * WIDTH + 180) % 360 - 180)
            for view in tied
        ]
        assert min(np.abs(row - choice).max() for choice in choices) < 1e-6


@pytest.mark.parametrize("views", [[0], [0, 180], list(range(0, 340, 5)), list(range(10, 355, 15))])
def test_a_gap_is_refused(views):
    views = np.array(views, dtype=float)
    with pytest.raises(UserError, match="views leave a gap of ") as error:
        bin_apart(views, np.full((len(views), BINS), 1 / BINS))
    widest = np.diff(np.sort(views), append=views.min() + 360).max()
    assert f"{widest:.0f}°" in str(error.value)


def test_a_view_every_15_degrees_is_enough():
    views = np.arange(0, 360, WIDEST_GAP_DEG) + 7.0
    assert bin_apart(views, np.full((len(views), 120), 1 / 120)).shape == (120, 120)


# Temperature


@pytest.mark.parametrize("temperature", [0.3, 1.0, 4.0])
def test_the_temperature_of_samples_is_found(temperature):
    """Truths that are drawn from the distributions at a temperature, at the classes' centres."""
    rng = np.random.default_rng(0)
    logits = rng.normal(0, 3, (4000, BINS))
    p = np.exp(logits / temperature)
    p /= p.sum(axis=1, keepdims=True)
    truth = np.array([rng.choice(BINS, p=row) for row in p]) * WIDTH
    halves = [
        sweep(azimuth_deg=truth[part], logits=logits[part]) for part in (np.s_[:1500], np.s_[1500:])
    ]
    assert temperature_of(halves) == pytest.approx(temperature, rel=0.1)


# The paper's tables


def test_each_elevation_has_the_lookup_table_of_its_own_pairs(bundle):
    """As made of calibration pairs that are a degree apart."""
    density = {**DENSITY, "bandwidths_deg": [6, 12], "pseudo_observations": [10]}
    found = paper_tables(bundle.elevation_deg, bundle.distributions, density)
    assert found.elevation_deg.tolist() == [0.0, 30.0]
    angles = np.exp(2j * np.pi * np.arange(BINS) / BINS)
    for elevation, rotations in zip(found.elevation_deg, found.rotation_deg, strict=True):
        of_level = bundle.distributions[bundle.elevation_deg == elevation]
        means = np.degrees(np.angle(of_level @ angles))
        # Views between two bins take the error of the nearer one; of equals, that of the first.
        view = np.arange(360)
        near = np.array([np.abs((AZIMUTHS - v + 180) % 360 - 180).argmin() for v in view])
        estimates = (means[:, near] + view - AZIMUTHS[near]) % 360
        wanted = chosen_lookup(estimates, "pose_ambiguity", density).recommended_delta_deg
        assert np.mean(rotations == wanted) > 0.99


# A bundle for another camera


def test_a_bundle_is_calibrated_again(bundle):
    logits = [without_common_error(2 * t) for t in sweep_logits(np.random.default_rng(5), 3)]
    sweeps = [
        sweep("x", logits=logits[0], elevation=10.0),
        sweep("x", logits=logits[1], elevation=np.nan),
        sweep("y", logits=logits[2], elevation=40.0),
    ]
    found = recalibrated(bundle, sweeps, "recording.csv", ONE_DENSITY)
    assert found.object_ids == ("x", "x", "y", *bundle.object_ids)
    assert np.array_equal(
        found.elevation_deg, [10.0, np.nan, 40.0, *bundle.elevation_deg], equal_nan=True
    )
    assert found.elevation_deg.dtype == found.sweep_weights.dtype == np.float32
    # The pseudo-observations have the weight that they had next to the bundle's own sweeps.
    assert np.array_equal(found.sweep_weights[3:], bundle.sweep_weights)
    assert found.sweep_weights[:3] == pytest.approx(len(bundle.object_ids) / PRIOR_SWEEPS)
    # The bundle's own sweeps stay, as they are at the new temperature.
    prior = np.log(bundle.distributions.astype(float)) * bundle.temperature / found.temperature
    prior -= np.log(np.exp(prior).sum(axis=-1, keepdims=True))
    assert np.log(found.distributions[3:]) == pytest.approx(prior, abs=1e-3)
    for row, own in zip(found.distributions[:3], logits, strict=True):
        assert row == pytest.approx(from_logits(own, found.temperature), rel=1e-5)
    known = bundle.ood
    scores = np.concatenate([ood_score(known, one.codes, one.logits) for one in sweeps])
    limit = max(np.quantile(scores, 0.95), 1.0)
    assert found.ood.threshold == pytest.approx(limit * known.threshold)
    assert np.array_equal(found.ood.references, known.references)
    # Each sweep counts for the nearest table; without an elevation, for the lowest.
    of_table = np.array([0.0, 0.0, 30.0, *bundle.elevation_deg])
    wanted = paper_tables(of_table, found.distributions, ONE_DENSITY)
    assert found.paper.elevation_deg.tolist() == bundle.paper.elevation_deg.tolist() == [0.0, 30.0]
    assert np.array_equal(found.paper.rotation_deg, wanted.rotation_deg)
    assert found.network is bundle.network
    more = {"calibrated_by": "recording.csv", "turns_made_with": len(bundle.object_ids)}
    assert found.provenance == {**bundle.provenance, **more}
    assert "calibrated_by" not in bundle.provenance


def test_the_same_frames_keep_their_flag_after_a_calibration(bundle):
    """Clean frames of one object say little of other objects before the same camera."""
    model = replace(bundle.ood, threshold=1e3 * bundle.ood.threshold)
    familiar = replace(bundle, ood=model)
    found = recalibrated(familiar, [sweep("x")], "recording.csv", ONE_DENSITY)
    assert found.ood.threshold == model.threshold


def test_the_zero_of_the_turntable_does_not_matter(bundle):
    """Nor whether several sweeps have several."""
    sweeps = [sweep("x", 1), sweep("y", 2, azimuth_deg=AZIMUTHS + 4.0)]
    wanted = recalibrated(bundle, sweeps, "r", ONE_DENSITY)
    for zero in (1.0, -9.0, 90.0):
        moved = [
            replace(sweeps[0], azimuth_deg=(sweeps[0].azimuth_deg + zero) % 360),
            replace(sweeps[1], azimuth_deg=(sweeps[1].azimuth_deg - 2 * zero) % 360),
        ]
        found = recalibrated(bundle, moved, "r", ONE_DENSITY)
        assert found.temperature == pytest.approx(wanted.temperature)
        assert found.distributions == pytest.approx(wanted.distributions, abs=1e-6)
        assert np.array_equal(found.paper.rotation_deg, wanted.paper.rotation_deg)


@pytest.mark.parametrize("temperature", [0.2, 1.0])
def test_the_offset_is_that_of_the_estimates_at_the_temperature(temperature):
    given = sweep("x", 1, azimuth_deg=AZIMUTHS + 4.0)
    estimates = mean_direction_deg(from_logits(given.logits, temperature))
    errors = (estimates - given.azimuth_deg + 180) % 360 - 180
    wanted = (given.azimuth_deg + np.median(errors)) % 360
    found = without_offset(given, temperature).azimuth_deg
    assert circular_distance_deg(found, wanted).max() < 1e-9


@pytest.mark.parametrize("azimuth_deg", [-AZIMUTHS, np.radians(AZIMUTHS), 7.0 * AZIMUTHS])
def test_azimuths_that_estimates_do_not_follow_stay(azimuth_deg):
    given = replace(sweep("x", 1), azimuth_deg=azimuth_deg % 360)
    assert without_offset(given, 1.0) is given


def test_azimuths_in_radians_are_named_for_a_bundle_too(bundle):
    given = replace(sweep("x", 1), azimuth_deg=np.radians(AZIMUTHS))
    with pytest.raises(UserError, match="these azimuths seem to be radians"):
        recalibrated(bundle, [given], "r", ONE_DENSITY)


def test_calibrations_one_after_the_other_weigh_turns_as_one_with_all(bundle):
    logits = 2 * sweep_logits(np.random.default_rng(5), 3)
    first, *others = (sweep(str(place), logits=rows) for place, rows in enumerate(logits))
    twice = recalibrated(bundle, [first], "one.csv", ONE_DENSITY)
    twice = recalibrated(twice, others, "others.csv", ONE_DENSITY)
    once = recalibrated(bundle, [*others, first], "all.csv", ONE_DENSITY)
    assert twice.object_ids == once.object_ids
    assert np.array_equal(twice.sweep_weights, once.sweep_weights)
    assert twice.temperature == pytest.approx(once.temperature, rel=0.02)


def log_likelihood_at(temperature: float, logits, azimuth_deg) -> float:
    """The mean over views whose azimuths are classes' centres, by hand."""
    scaled = logits / temperature
    logs = scaled - np.log(np.exp(scaled).sum(axis=1, keepdims=True))
    place = np.rint(azimuth_deg / WIDTH).astype(int)
    return float(np.mean([row[c] for row, c in zip(logs, place, strict=True)]))


@pytest.mark.parametrize("n_sweeps", [1, 40])
def test_the_temperature_is_the_likeliest_of_turns_and_of_the_bundles_own(bundle, n_sweeps):
    """The bundle's sweeps together count as `PRIOR_SWEEPS` of the others."""
    logits = [without_common_error(5 * t) for t in sweep_logits(np.random.default_rng(6), n_sweeps)]
    sweeps = [sweep(str(place), logits=rows) for place, rows in enumerate(logits)]
    found = recalibrated(bundle, sweeps, "recording.csv", ONE_DENSITY).temperature
    own = [bundle.temperature * np.log(rows.astype(float)) for rows in bundle.distributions]

    def total(temperature: float) -> float:
        of_own = [log_likelihood_at(temperature, rows, AZIMUTHS) for rows in own]
        of_sweeps = [log_likelihood_at(temperature, t.logits, t.azimuth_deg) for t in sweeps]
        return PRIOR_SWEEPS * float(np.mean(of_own)) + sum(of_sweeps)

    assert total(found) > max(total(found * factor) for factor in (0.97, 0.99, 1.01, 1.03))
    ends = sorted([bundle.temperature, temperature_of(sweeps)])
    assert ends[0] < found < ends[1]
    assert (abs(found - temperature_of(sweeps)) < abs(found - bundle.temperature)) == (
        n_sweeps == 40
    )


def test_one_turn_does_not_decide_the_temperature(bundle):
    """One that is nearly always right would make a bundle three times as sure."""
    easy = sweep("x", logits=3.0 * np.eye(BINS) + np.zeros((BINS, BINS)))
    alone = temperature_of([easy])
    found = recalibrated(bundle, [easy], "recording.csv", ONE_DENSITY).temperature
    own = temperature_of([sweep("y", logits=bundle.temperature * np.log(bundle.distributions[0]))])
    assert alone < found < 2 * max(own, bundle.temperature)
    assert found > 3 * alone


def test_a_paper_table_without_new_turns_stays(bundle):
    marked = replace(bundle.paper, rotation_deg=np.full((2, 360), 77, np.int16))
    known = replace(bundle, paper=marked)
    found = recalibrated(known, [sweep("x", elevation=31.0)], "recording.csv", ONE_DENSITY)
    assert (found.paper.rotation_deg[0] == 77).all()
    assert (found.paper.rotation_deg[1] != 77).any()
    assert (known.paper.rotation_deg == 77).all()


def test_without_elevations_all_turns_count_alike(bundle):
    sweeps = [sweep("x", 1, elevation=np.nan), sweep("y", 2, elevation=np.nan)]
    found = recalibrated(bundle, sweeps, "recording.csv", ONE_DENSITY)
    found = replace(found, elevation_deg=np.full(len(found.elevation_deg), np.nan, np.float32))
    codes = np.random.default_rng(0).integers(0, 256, (1, 32, 32)).astype(np.uint8)
    recommender = Recommender(found)
    one, other = (recommender.recommend_crops(codes, elevation_deg=e) for e in (None, 20.0))
    assert one.move == other.move


def test_the_cameras_focal_length_is_kept_where_it_is_known(bundle):
    unknown, *known = (
        replace(sweep(name), focal_px=f) for name, f in zip("abc", (np.nan, 610, 620), strict=True)
    )
    assert recalibrated(bundle, [unknown], "r", ONE_DENSITY).focal_px == bundle.focal_px
    assert recalibrated(bundle, [unknown, *known], "r", ONE_DENSITY).focal_px == 615


@given(
    known=arrays(np.float64, (5,), elements=st.floats(0, 60)),
    elevation=st.floats(-10, 80),
)
def test_sweeps_count_by_how_near_their_elevation_is(known, elevation):
    share = elevation_weights(known, elevation)
    apart = np.abs(known - elevation)
    assert share.max() == share[apart.argmin()] == 1.0
    kernel = np.exp(-0.5 * (apart / ELEVATION_BANDWIDTH_DEG) ** 2)
    nearest = kernel.max()
    if nearest > 1e-300:
        assert share == pytest.approx(kernel / nearest, abs=1e-9)
    order = np.argsort(apart)
    assert (np.diff(share[order]) <= 1e-12).all()


def test_a_frame_from_far_above_takes_the_nearest_sweeps():
    """There the kernel itself is 0 in double precision."""
    assert elevation_weights(np.array([0.0, 30.0, 30.0]), 800.0) == pytest.approx([0.0, 1.0, 1.0])
    assert elevation_weights(np.full(4, 20.0), -75.0) == pytest.approx(1.0)


def test_what_has_no_known_elevation_counts_whole():
    known = np.array([0.0, np.nan, 40.0])
    assert elevation_weights(known, 40.0) == pytest.approx([np.exp(-8.0), 1.0, 1.0])
    assert elevation_weights(known, np.nan).tolist() == [1.0, 1.0, 1.0]
    assert elevation_weights(np.full(3, np.nan), 40.0).tolist() == [1.0, 1.0, 1.0]
