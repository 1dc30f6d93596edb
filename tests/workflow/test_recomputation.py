"""The written results, recomputed from the written files without any of the package's code."""

import math

import numpy as np
import pandas as pd
import pytest

pytestmark = pytest.mark.slow

PLACES = [f"{category}/el00/fold{fold}" for category in ("mug", "chair") for fold in (1, 2)]
TWO_VIEWS = ["random", "opposite", "proposed"]


def unit(angle_deg):
    return np.exp(1j * np.radians(angle_deg))


def apart(a_deg, b_deg):
    return np.degrees(np.abs(np.angle(unit(a_deg) / unit(b_deg))))


def read(finished, stage, place, name):
    return pd.read_csv(finished.results / stage / place / f"{name}.csv", dtype={"object_id": str})


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("method", TWO_VIEWS)
def test_second_views_fusion_and_errors(finished, place, method):
    test = read(finished, "estimates", place, "test")
    answer = test.set_index(["object_id", "azimuth_deg"])["estimate_deg"]
    rows = read(finished, "evaluation", place, method)
    first = answer.loc[list(zip(rows.object_id, rows.initial_deg, strict=True))].to_numpy()
    seen_from = (rows.initial_deg + rows.delta_deg) % 360
    second = answer.loc[list(zip(rows.object_id, seen_from, strict=True))].to_numpy()
    assert apart(rows.initial_estimate_deg, first).max() < 0.02
    assert apart(rows.next_estimate_deg, second).max() < 0.02
    total = unit(first) + unit(second - rows.delta_deg)
    clear = np.abs(total) > 1e-3
    assert apart(rows.pose_estimate_deg, np.degrees(np.angle(total)))[clear].max() < 0.02
    assert np.abs(rows.error_deg - apart(rows.pose_estimate_deg, rows.initial_deg)).max() < 0.02


@pytest.mark.parametrize("place", PLACES)
def test_rotations_follow_their_rule(finished, place):
    assert (read(finished, "evaluation", place, "opposite").delta_deg == 180).all()
    drawn = read(finished, "evaluation", place, "random").delta_deg
    assert drawn.between(1, 359).all()
    assert 160 < drawn.mean() < 200
    rows = read(finished, "evaluation", place, "proposed")
    with np.load(finished.results / "lookup" / place / "pose_ambiguity.npz") as lookup:
        ambiguity = lookup["cost"]
    for estimate, delta in zip(rows.initial_estimate_deg, rows.delta_deg, strict=True):
        row = ambiguity[math.floor(estimate + 0.5) % 360]
        travel = [min(d, 360 - d) for d in range(360)]
        best = min(range(360), key=lambda d: (row[d], travel[d], d))
        assert delta == best


@pytest.mark.parametrize("place", PLACES)
def test_likelihoods_and_ambiguity(finished, place):
    pairs = read(finished, "estimates", place, "calibration")
    with np.load(finished.results / "lookup" / place / "pose_ambiguity.npz") as stored:
        lookup = {name: stored[name] for name in stored.files}
    counts = np.zeros((360, 360))
    for estimate, truth in zip(pairs.estimate_deg, pairs.azimuth_deg, strict=True):
        counts[math.floor(estimate + 0.5) % 360, truth] += 1
    lag = np.radians(np.arange(360)[:, None] - np.arange(360))
    kernel = np.exp((np.cos(lag) - 1) / math.radians(lookup["bandwidth_deg"]) ** 2)
    kernel /= kernel.sum(axis=1, keepdims=True)
    joint = kernel @ counts @ kernel.T
    alpha = float(lookup["pseudo_observations"])
    V = (joint + alpha / 360) / (joint.sum(axis=1, keepdims=True) + alpha)
    L = ((joint + alpha / 360) / (joint.sum(axis=0, keepdims=True) + alpha)).T
    np.testing.assert_allclose(lookup["viewpoint_likelihood"], V, atol=1e-6)
    np.testing.assert_allclose(lookup["estimate_likelihood"], L, atol=1e-6)
    for delta in (0, 1, 77, 180, 359):
        both = V * np.roll(V, (-delta, -delta), (0, 1))
        both /= both.sum(axis=1, keepdims=True)
        spread = V @ both
        entropy = -(spread * np.log(spread)).sum(axis=1)
        np.testing.assert_allclose(lookup["cost"][:, delta], entropy, atol=5e-3)


def test_no_object_is_estimated_by_a_network_that_saw_it(finished):
    for place in PLACES:
        category, _, fold = place.split("/")
        splits = pd.read_csv(finished.results / "splits" / f"{category}.csv")
        of_fold = splits[splits.fold == int(fold[4:])]
        seen = {
            role: set(read(finished, "estimates", place, role).object_id)
            for role in ("calibration", "test")
        }
        train = set(of_fold.object_id[of_fold.role == "train"])
        assert not train & (seen["calibration"] | seen["test"])
        assert not seen["calibration"] & seen["test"]
        assert len(train | seen["calibration"] | seen["test"]) == 8


@pytest.mark.parametrize(("table", "metric"), [("table1", "mae"), ("table3", "pauc")])
def test_tables_of_categories(finished, table, metric):
    cells = pd.read_csv(finished.results / "tables" / f"{table}.csv")
    for category in ("mug", "chair"):
        for method in ("single", *TWO_VIEWS):
            folds = [
                read(finished, "evaluation", f"{category}/el00/fold{fold}", method).error_deg
                for fold in (1, 2)
            ]
            figures = [figure(metric, errors) for errors in folds]
            cell = cells[(cells.row == category) & (cells.method == method)].iloc[0]
            assert cell.value == pytest.approx(figure(metric, pd.concat(folds)), abs=2e-3)
            sigma = abs(figures[0] - figures[1]) / math.sqrt(2)
            assert cell.sigma == pytest.approx(sigma, abs=2e-3)


def figure(metric, errors):
    if metric == "mae":
        return errors.mean()
    # Trapezes under PEA: the fraction below each threshold, integrated from 0 to 100 degrees.
    thresholds = np.linspace(0, 100, 200_001)
    below = np.searchsorted(np.sort(errors.to_numpy()), thresholds, side="left") / len(errors)
    return float(np.trapezoid(below, thresholds))
