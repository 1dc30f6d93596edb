"""Distributions of any estimator: calibration, and the next view."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from commands import POSE, fails, run, same_move
from made_bundles import BINS, WIDTH, random_codes, sweep_logits
from made_estimates import unclear_sweeps
from nbv.bundles.recommender import Recommender
from nbv.choice.moves import moved_camera
from nbv.cli import main
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.selection import AFFINITY
from nbv.errors import FrameError, UserError
from nbv.experiment.config import load_config
from nbv.tables.distribution_table import DistributionTable
from nbv.tables.lookup import LookupTable
from nbv.tables.pairs import PairTable, read_distributions

AZIMUTHS = np.arange(BINS) * WIDTH
CONFIG = Path(__file__).parents[2] / "config"


def softmax(logits):
    p = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return p / p.sum(axis=-1, keepdims=True)


def sweeps(seed=0, n=3, sharpness=1.0):
    logits = sweep_logits(np.random.default_rng(seed), n) * sharpness
    return {f"o{k}": (AZIMUTHS, softmax(own)) for k, own in enumerate(logits)}


@pytest.fixture(scope="module")
def table():
    return DistributionTable.from_pairs(sweeps())


def test_the_affinity_is_that_of_the_experiments():
    config = load_config(CONFIG)["affinity"]
    assert {key: config[key] for key in AFFINITY} == dict(AFFINITY)


@pytest.mark.parametrize("rotations", [[0.0], [0.0, 90.0], [0.0, 90.0, -40.0]])
def test_it_answers_as_a_bundle_does_of_frames(bundle, rotations):
    """A bundle's own network, as if it were another estimator."""
    same = replace(bundle, affinity=AFFINITY)
    recommender = Recommender(same)
    codes = random_codes(np.random.default_rng(5), len(rotations))
    wanted = recommender.recommend_crops(codes, rotations, max_travel_deg=150.0)
    table = DistributionTable(same.object_ids, same.temperature, same.distributions, BINS)
    of_network = softmax(recommender.network(codes).astype(np.float64))
    found = table.recommend(of_network, rotations, max_travel_deg=150.0)
    for name in ("azimuth_deg", "spread_deg", "expected_error_deg", "belief", "bayes_factor"):
        assert getattr(found, name) == pytest.approx(getattr(wanted, name), rel=1e-3, abs=1e-5)
    assert found.error_after_deg == pytest.approx(wanted.error_after_deg, rel=1e-3)
    assert found.move.rotation_deg == wanted.move.rotation_deg
    assert found.n_views == wanted.n_views == len(rotations)
    assert np.isnan(found.ood_score)
    assert found.crops == ()


def test_the_expected_error_is_that_of_its_definition(table):
    """Written out: every view of every object counts by its affinity with the one at hand."""
    given = softmax(sweep_logits(np.random.default_rng(9), 1)[0, 5] / table.temperature)
    n_bins = table.distributions.shape[-1]
    width = 360 / n_bins
    azimuths = np.arange(n_bins) * width
    p = np.interp(azimuths, AZIMUTHS, given, period=360) * BINS / n_bins
    power, alpha = AFFINITY["power"], AFFINITY["pseudo_observations"]
    weights, errors = [], []
    for rows in table.distributions.astype(np.float64):
        for view in range(n_bins):
            weights.append(width * np.sqrt(p * rows[view]).sum() ** power)
            others = rows[(view + np.arange(n_bins)) % n_bins]
            back = (np.arange(n_bins) + np.arange(n_bins)[:, None]) % n_bins
            both = rows[view] * np.take_along_axis(others, back, axis=1)
            mean = np.angle(both @ np.exp(1j * np.radians(azimuths)), deg=True)
            errors.append(circular_distance_deg(mean, azimuths[view]))
    weights, errors = np.array(weights), np.array(errors)
    wanted = (weights @ errors + alpha * errors.mean(axis=0)) / (weights.sum() + alpha)
    uncalibrated = given**table.temperature
    found = table.recommend(uncalibrated / uncalibrated.sum()).error_after_deg
    free = np.isfinite(found)
    assert free.sum() > n_bins / 2
    # All are raised alike: the least of them would be too low.
    more = found[free] - wanted[free]
    assert more.min() >= -1e-3
    assert more == pytest.approx(more[0], abs=1e-2)


@pytest.mark.parametrize("n_classes", [8, 12, 24, 36])
def test_between_two_classes_an_estimator_errs_by_up_to_half_a_class(n_classes):
    """Every view has the nearest class for certain, so errors are uniform up to half a class."""
    width = 360 / n_classes
    azimuths = np.arange(0.0, 360.0)
    nearest = np.floor(azimuths / width + 0.5).astype(int) % n_classes
    rows = np.eye(n_classes)[nearest] * 0.97 + 0.03 / n_classes
    table = DistributionTable.from_pairs({"a": (azimuths, rows), "b": (azimuths, rows)})
    n_bins = table.distributions.shape[-1]
    assert 360 / n_bins <= 6
    assert n_bins % n_classes == 0
    answer = table.recommend(rows[0])
    assert circular_distance_deg(answer.azimuth_deg, 0.0) < 1e-6
    assert answer.expected_error_deg == pytest.approx(width / 4, rel=0.15)
    best = answer.moves[0].expected_error_deg
    if n_bins == 2 * n_classes:  # All other views see as much of an object as the first one.
        assert best == pytest.approx(width / 4, rel=1e-6)
    else:  # Between two classes a view halves the error, and none is without error.
        assert 0.02 * width < best < 0.5 * width / 4
    more = DistributionTable.from_pairs(
        {"a": (azimuths, np.eye(120)[nearest * 0 + 3] * 0.5 + 0.5 / 120)}
    )
    assert more.distributions.shape[-1] == more.n_classes == 120


def test_a_temperature_at_its_limit_is_told(here, capsys):
    right = 0.1 * np.eye(BINS) + 0.9 / BINS
    certain = {"a": (AZIMUTHS, right), "b": (AZIMUTHS, right)}
    assert "the temperature 0.05 is at its limit" in DistributionTable.from_pairs(certain).warning
    assert DistributionTable.from_pairs(sweeps()).warning == ""
    written(here, certain)
    out = run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    assert out.splitlines()[-1].startswith("warning: the temperature 0.05 is at its limit")


@settings(max_examples=20, deadline=None)
@given(power=st.floats(0.3, 6.0), seed=st.integers(0, 5))
def test_how_sure_an_estimator_says_it_is_does_not_matter(power, seed):
    """The same probabilities to any power: another temperature, the same table and answer."""
    plain = DistributionTable.from_pairs(sweeps(seed))
    sharp = DistributionTable.from_pairs(sweeps(seed, sharpness=power))
    assert sharp.temperature == pytest.approx(power * plain.temperature, rel=2e-3)
    assert sharp.distributions == pytest.approx(plain.distributions, abs=2e-3)


def test_views_come_in_any_order_and_anywhere_closer_than_15_degrees():
    given_sweeps = sweeps()
    order = np.random.default_rng(0).permutation(BINS)
    shuffled = {name: (a[order], p[order]) for name, (a, p) in given_sweeps.items()}
    wanted, found = (DistributionTable.from_pairs(each) for each in (given_sweeps, shuffled))
    assert found.temperature == pytest.approx(wanted.temperature)
    assert found.distributions == pytest.approx(wanted.distributions, abs=1e-5)
    with pytest.raises(UserError, match=r"^object '.*': views leave a gap of 30°"):
        DistributionTable.from_pairs({n: (a[::2], p[::2]) for n, (a, p) in given_sweeps.items()})


def test_what_does_not_fit_is_one_line(table):
    p = sweeps()["o0"][1][0]
    for probabilities, rotations, kind, message in (
        (p[:12] / p[:12].sum(), [0.0], UserError, "12 probabilities; calibration objects have 24"),
        (2 * p, [0.0], UserError, "row 1: probabilities sum to 2 "),
        ([p, -p], [0.0, 90.0], UserError, "row 2, p0: a probability is negative"),
        (p, [0.0, 90.0], FrameError, "1 view and 2 rotations"),
        (p + 0j, [0.0], UserError, "give probabilities as numbers"),
        ([p, p[:5]], [0.0, 90.0], UserError, "rows of different lengths"),
        (np.log(p), [0.0], UserError, "give probabilities, not their logarithms"),
    ):
        with pytest.raises(kind, match=message):
            table.recommend(probabilities, rotations)
    for azimuths in (AZIMUTHS[:5], ["a"] * BINS, [*AZIMUTHS[1:], np.nan], AZIMUTHS[None]):
        with pytest.raises(UserError, match="object 'x': azimuths"):
            DistributionTable.from_pairs({"x": (azimuths, sweeps()["o0"][1])})
    other = {"x": (np.arange(36) * 10.0, np.full((36, 36), 1 / 36)), **sweeps()}
    with pytest.raises(UserError, match=r"\[24, 36\] classes"):
        DistributionTable.from_pairs(other)


def test_zeros_exclude_no_pose(table):
    """They count as the smallest other probability, or less."""
    p = np.zeros(BINS)
    p[3] = 1.0
    found = table.recommend([p, np.roll(p, 12)], [0.0, 0.0])
    assert np.isfinite(found.error_after_deg[np.isfinite(found.error_after_deg)]).all()
    assert 0 < found.bayes_factor < 1e-3
    assert found.warnings
    many = table.recommend(np.tile(p, (300, 1)), [0.0] * 300)
    assert np.isfinite(many.bayes_factor)
    assert many.azimuth_deg == pytest.approx(3 * WIDTH, abs=1e-6)


@pytest.mark.parametrize("period", [1, 2, 12])
def test_where_no_direction_is_likelier_the_error_is_90(period):
    """Uniform, or the same every 360 / period degrees: rounding gives no direction."""
    classes = np.arange(BINS)
    peaked = 1e-4 + (classes % (BINS // period or 1) == 0) if period > 1 else np.ones(BINS)
    rows = np.stack([np.roll(peaked, k) for k in range(BINS)])
    rows = rows / rows.sum(axis=1, keepdims=True)
    flat = DistributionTable.from_pairs({"a": (AZIMUTHS, rows)})
    answer = flat.recommend(rows[0])
    assert answer.expected_error_deg == pytest.approx(90.0)
    assert answer.move.expected_error_deg == pytest.approx(90.0)


# Files and the command line


def written(folder: Path, pairs, columns=BINS) -> Path:
    rows = [
        (name, azimuth, (azimuth + 1.0) % 360, *p[:columns])
        for name, (azimuths, rows) in pairs.items()
        for azimuth, p in zip(azimuths, rows, strict=True)
    ]
    names = ["object_id", "azimuth_deg", "estimate_deg", *(f"p{k}" for k in range(columns))]
    table = pd.DataFrame(rows, columns=names)
    table.to_csv(folder / "pairs.csv", index=False)
    return folder / "pairs.csv"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, sweeps())
    (tmp_path / "pose.json").write_text(json.dumps(POSE))
    rows = softmax(sweep_logits(np.random.default_rng(7), 1)[0, [3, 9]])
    pd.DataFrame(rows, columns=[f"p{k}" for k in range(BINS)]).to_csv("views.csv", index=False)
    np.save("views.npy", rows)
    return tmp_path


def test_an_object_that_looks_the_same_from_all_round_is_told(rng):
    """A bottle: each distribution is as sharp as that of a mug, and anywhere."""
    azimuths = np.arange(72) * 5.0
    sweeps = {
        name: (azimuths, sharp(rng.uniform(0, 360, 72)[:, None] - azimuths)) for name in "abcdefgh"
    }
    (warning,) = DistributionTable.from_pairs(sweeps).recommend(sweeps["a"][1][7]).warnings
    assert "looks the same from all round" in warning


def sharp(apart_deg):
    rows = np.exp(20 * np.cos(np.radians(apart_deg)))
    return rows / rows.sum(axis=1, keepdims=True)


def test_pairs_with_distributions_come_back_as_they_are(here):
    found = PairTable.load("pairs.csv").distributions
    for (name, (azimuth, rows)), (own, wanted) in zip(found.items(), sweeps().items(), strict=True):
        assert name == own
        assert azimuth.tolist() == AZIMUTHS.tolist()
        assert rows == pytest.approx(wanted[1], abs=1e-9)
    assert np.array_equal(read_distributions("views.csv"), read_distributions("views.npy"))


@pytest.mark.slow
def test_one_file_holds_the_lookup_table_and_the_distributions(here, capsys):
    out = run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    wanted = DistributionTable.from_pairs(PairTable.load("pairs.csv").distributions)
    told = f"distributions: {BINS} classes, temperature {wanted.temperature:.2f}; offset "
    assert out.splitlines()[-1].startswith(told)
    printed = json.loads(run(capsys, "calibrate", "pairs.csv", "--output", "j.npz", "--json"))
    assert printed["distributions"]["temperature"] == wanted.temperature
    assert abs(printed["distributions"]["offset_deg"]) < 10
    assert printed["distributions"]["warning"] is None
    found = DistributionTable.load("t.npz")
    assert found.object_ids == wanted.object_ids
    assert found.temperature == wanted.temperature
    assert np.array_equal(found.distributions, wanted.distributions)
    of_estimates = pd.read_csv("pairs.csv").iloc[:, :3]
    of_estimates.to_csv("plain.csv", index=False)
    run(capsys, "calibrate", "plain.csv", "--output", "plain.npz")
    same, plain = LookupTable.load("t.npz"), LookupTable.load("plain.npz")
    assert np.array_equal(same.cost, plain.cost)
    assert run(capsys, "next", "t.npz", "--estimate", "20") == run(
        capsys, "next", "plain.npz", "--estimate", "20"
    )
    message = fails(capsys, "next", "plain.npz", "--estimate", "views.csv")
    assert "plain.npz holds azimuths; give one number of degrees" in message
    with pytest.raises(UserError, match="holds no distributions, which pairs have in columns p0"):
        DistributionTable.load("plain.npz")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (lambda p: p[:, ::-1], "warning: estimates run opposite to azimuths"),
        (lambda p: np.roll(p, 6, axis=1), "warning: offset +"),
    ],
)
def test_distributions_that_count_otherwise_than_azimuths_are_doubted(
    here, capsys, changed, message
):
    """The estimates are right, so they raise no doubt."""
    written(here, {name: (a, changed(p)) for name, (a, p) in sweeps().items()})
    out = run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    assert out.count("warning:") == 1
    assert message in out.splitlines()[-1]


def test_a_damaged_table_is_one_line(here, capsys):
    run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    stored = dict(np.load("t.npz"))
    for name, value, reason in (
        ("temperature", np.array(0.0), "temperature"),
        ("temperature", np.array(np.nan), "temperature"),
        ("of_views", stored["distribution.of_views"][:0], "shape"),
        ("object_ids", stored["distribution.object_ids"][:2], "shape"),
        ("n_classes", np.array(40), "number of classes"),
        ("n_classes", np.array(BINS + 0.5), "number of classes"),
    ):
        np.savez("d.npz", **(stored | {f"distribution.{name}": value}))
        message = fails(capsys, "next", "d.npz", "--estimate", "views.csv")
        assert "d.npz: " in message
        assert reason in message


@pytest.mark.parametrize("file", ["views.csv", "views.npy"])
def test_the_command_answers_as_python_does(here, capsys, file):
    run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    options = ("t.npz", "--estimate", file, "--rotations", "0", "90")
    limits = ("--max-travel", "120", "--camera-pose", "pose.json", "--axis", "0.5", "0", "0.1")
    printed = json.loads(run(capsys, "next", *options, *limits, "--json"))
    table = DistributionTable.load("t.npz")
    answer = table.recommend(read_distributions(file), [0.0, 90.0], max_travel_deg=120.0)
    assert printed["azimuth_deg"] == answer.azimuth_deg
    same_move(printed, answer)
    assert printed["ood_score"] is None
    assert printed["assumed_focal_px"] is None
    target = moved_camera(np.array(POSE), [0.5, 0, 0.1], [0, 0, 1], answer.move.rotation_deg)
    assert printed["target_camera_pose"] == pytest.approx(target)
    former = ("--distribution", file, "--table", "t.npz", "--rotations", "0", "90")
    assert main(["recommend", *former, *limits, "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == printed
    assert "--distribution --estimate" in err
    told = run(capsys, "next", *options, "--allowed", "45,120")
    only = table.recommend(read_distributions(file), [0.0, 90.0], allowed_deg=[45, 120])
    assert f"azimuth {only.azimuth_deg:.1f}° (camera around object;" in told
    assert "; 2 views)" in told
    assert f"rotate by {only.move.rotation_deg:+g}°" in told


def test_what_a_user_gets_wrong_is_one_line(here, capsys):
    run(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    both = ("t.npz", "--estimate", "views.csv")
    Path("bad.npy").write_bytes(b"PK\3\4 not a zip")
    for arguments, message in (
        ((*both, "--sphere", "3"), "--sphere does not go with t.npz, which holds distributions"),
        ((*both[:-1], "1", "2"), "t.npz holds azimuths; give one number of degrees"),
        (
            (
                *both,
                "--rotations",
                "0",
                "90",
                "--camera-pose",
                "pose.json",
                "--axis",
                "0.5",
                "0",
                "0.1",
                "0",
                "0",
                "-1",
            ),
            "does the direction point up",
        ),
        (("no.npz", "--estimate", "views.csv"), "no.npz does not exist"),
        (("t.npz", "--estimate", "pose.json"), "pose.json"),
        (
            ("pairs.csv", "--estimate", "views.csv"),
            "pairs.csv: cannot be read (it is not an array of numbers)",
        ),
        (("t.npz", "--estimate", "bad.npy"), "bad.npy cannot be read"),
    ):
        assert message in fails(capsys, "next", *arguments)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (
            lambda t: t.drop(columns="p3"),
            "23 columns of probabilities are not p0 to p22: rename 'p23'",
        ),
        (lambda t: t.assign(p3=[*t["p3"][:-1], -0.5]), "row 73, p3: a probability is negative"),
        (lambda t: t.rename(columns={"p3": "p_3"}), "rename 'p_3'"),
        (lambda t: pd.concat([t, t[:1]]), "object 'o0' has 2 views at 0°"),
        (lambda t: t[[*t.columns[:7]]], "8 classes or more"),
    ],
)
def test_damaged_distributions_of_pairs_are_one_line(here, capsys, edit, message):
    edit(pd.read_csv("pairs.csv")).to_csv("pairs.csv", index=False)
    assert message in fails(capsys, "calibrate", "pairs.csv", "--output", "t.npz")
    assert not Path("t.npz").exists()


def test_the_expected_error_of_one_view_is_right_where_it_is_small_and_where_it_is_large():
    rng = np.random.default_rng(6)
    azimuths = np.arange(24) * 15.0
    table = DistributionTable.from_pairs(
        {f"{k}": (azimuths, rows) for k, rows in enumerate(unclear_sweeps(rng, 60))}
    )
    promised, errors = [], []
    for rows in unclear_sweeps(rng, 60):
        for azimuth, view in zip(azimuths, rows, strict=True):
            answer = table.recommend(view)
            promised.append([answer.expected_error_deg, answer.probability_within["15"]])
            errors.append(float(circular_distance_deg(answer.azimuth_deg, azimuth)))
    promised, errors = np.array(promised), np.array(errors)
    for half in np.array_split(promised[:, 0].argsort(), 2):
        assert promised[half, 0].mean() == pytest.approx(errors[half].mean(), rel=0.2, abs=1.0)
        assert promised[half, 1].mean() == pytest.approx((errors[half] <= 15).mean(), abs=0.05)


@pytest.mark.parametrize(
    ("wrong", "verdict"),
    [
        (lambda k: 0.0, "enough"),
        (lambda k: k % 2, "no view helps"),
        (lambda k: 0.5 * (AZIMUTHS < 180), "one more view"),
    ],
    ids=["never wrong", "wrong from everywhere", "unsure from one side"],
)
def test_a_view_helps_where_errors_differ_between_views(wrong, verdict):
    peaks = [
        softmax(20 * np.cos(np.radians(AZIMUTHS - AZIMUTHS[:, None] - turn))) for turn in (0, 60)
    ]
    known = {}
    for k in range(40):
        share = np.broadcast_to(wrong(k), BINS)[:, None]
        known[f"o{k}"] = AZIMUTHS, (1 - share) * peaks[0] + share * peaks[1]
    answer = DistributionTable.from_pairs(known).recommend(known["o0"][1][3])
    assert answer.decision.verdict == verdict
