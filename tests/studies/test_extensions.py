import numpy as np
import pytest
from studies.extensions import evaluate_extensions
from studies.selection import select_methods

from made_estimates import EXTENSIONS, FEW_DENSITIES, objects
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.estimates import Estimates, Posteriors
from nbv.core.circle.fusion import FUSIONS
from nbv.experiment.results import COLUMNS


@pytest.fixture(scope="module")
def evaluated():
    generators = {name: np.random.default_rng(0) for name in EXTENSIONS}
    return evaluate_extensions(
        objects(6, 0), objects(5, 1), EXTENSIONS, FEW_DENSITIES, generators.__getitem__
    )


def test_rows_of_extensions_agree_with_the_estimates_they_came_from(evaluated):
    test, selected = objects(5, 1), select_methods(objects(6, 0), EXTENSIONS, FEW_DENSITIES)
    assert list(evaluated.frames) == list(EXTENSIONS)
    for name, frame in evaluated.frames.items():
        for row in frame.iloc[[3, 400, 1200]].itertuples():
            which = test.object_ids.index(row.object_id)
            assert row.initial_estimate_deg == test.estimate_deg[which, row.initial_deg]
            seen = test.estimate_deg[which, (row.initial_deg + row.delta_deg) % 360]
            assert row.next_estimate_deg == seen
            fused = FUSIONS[selected[name].fusion](
                row.initial_estimate_deg, seen, row.delta_deg, selected[name].evidence
            )
            assert circular_distance_deg(fused, row.pose_estimate_deg) < 0.05


def test_extensions_come_with_their_choices_tables_and_travel(evaluated):
    assert evaluated.choices["method"].tolist() == list(EXTENSIONS)
    with_tables = {"gain_posterior", "error_average", "selected"}
    assert set(evaluated.lookups) == with_tables
    assert with_tables < set(evaluated.travel["method"])


N_CLASSES = 36
PRODUCTS = {
    "gain_product": {"policy": "information_gain", "fusion": "product"},
    "opposite_product": {"policy": "opposite", "fusion": "product"},
    "error_product": {"policy": "expected_error", "fusion": "product"},
    "random_product": {"policy": "random", "fusion": "product"},
}


def hidden_handle(n_objects: int, seed: int) -> Posteriors:
    """Distributions that know the azimuth, except within 50 degrees of 90, where all are alike."""
    rng = np.random.default_rng(seed)
    truth = np.arange(360.0)
    centres = np.arange(N_CLASSES) * 360 / N_CLASSES
    answer = truth + rng.normal(0, 3, (n_objects, 360))
    seen = np.exp((np.cos(np.radians(centres - answer[..., None])) - 1) / np.radians(8) ** 2)
    hidden = circular_distance_deg(truth, 90) < 50
    blind = np.where(circular_distance_deg(centres, 90) < 50, 1.0, 1e-6)
    p = np.where(hidden[:, None], blind, seen) + 1e-9
    names = tuple(f"{seed}-{i}" for i in range(n_objects))
    return Posteriors(names, np.log(p / p.sum(axis=-1, keepdims=True)), 1.0)


def mean_directions(posteriors: Posteriors) -> Estimates:
    centres = np.radians(np.arange(N_CLASSES) * 360 / N_CLASSES)
    mean = np.exp(posteriors.log_posterior) @ np.exp(1j * centres)
    return Estimates(posteriors.object_ids, np.degrees(np.angle(mean)) % 360)


def test_by_its_images_distributions_a_hidden_handle_is_sought_and_found():
    test, calibration = hidden_handle(3, 0), hidden_handle(5, 1)
    estimates = mean_directions(test)
    frames = evaluate_extensions(
        mean_directions(calibration),
        estimates,
        PRODUCTS,
        FEW_DENSITIES | {"affinity": {"power": 16, "pseudo_observations": 90}},
        lambda name: np.random.default_rng(0),
        calibration,
        test,
    ).frames
    hidden = circular_distance_deg(frames["gain_product"]["initial_deg"], 90) < 50
    for frame in frames.values():
        assert tuple(frame.columns) == COLUMNS
        views = (frame["initial_deg"] + frame["delta_deg"]) % 360
        expected = estimates.estimate_deg.reshape(3, 360)
        rows = np.repeat(np.arange(3), 360)
        np.testing.assert_allclose(frame["next_estimate_deg"], expected[rows, views])
    assert (frames["opposite_product"]["delta_deg"] == 180).all()
    # The product is exact for whole classes.
    assert set(frames["random_product"]["delta_deg"]) == set(range(10, 360, 10))
    assert circular_distance_deg(estimates.estimate_deg, np.arange(360)).ravel()[hidden].mean() > 20
    for name in ("gain_product", "error_product"):
        assert frames[name]["error_deg"][hidden].mean() < 5
