"""Linear estimators on depth features, by the real Snakefile, run small."""

import json

import numpy as np
import pandas as pd
import pytest
from safetensors import safe_open

from nbv.core.circle.angles import circular_distance_deg
from nbv.experiment.splits import objects_with_role, read_splits
from projects import TINY, Project, finished_project

pytestmark = pytest.mark.slow

LINEAR = ("estimator=linear", "camera.image_side=64", "categories=[mug]")
CLASSES = ("estimator=linear_classifier", "estimator.n_classes=24", "camera.image_side=64")
FOLD = "results/tiny/estimators/mug/el00/fold2/estimator.safetensors"


@pytest.fixture(scope="module")
def linear(tmp_path_factory) -> Project:
    """A run up to the errors of each method."""
    return finished_project(tmp_path_factory, "linear", "evaluation", overrides=(*TINY, *LINEAR))


def error_deg(project: Project, role: str = "test") -> float:
    found = project.results.glob(f"estimates/mug/el00/fold*/{role}.csv")
    estimates = pd.concat([pd.read_csv(path) for path in found])
    return float(circular_distance_deg(estimates["estimate_deg"], estimates["azimuth_deg"]).mean())


def test_estimates_mean_something(linear):
    # Two training objects are enough for this, and chance is 90.
    assert error_deg(linear) < 30


def test_no_network_is_trained(linear):
    rules = {path.name for path in (linear.results / "logs").iterdir()}
    assert "fit" in rules
    assert not {"train", "estimate"} & rules


def test_a_fold_says_what_it_was_fitted_to(linear):
    for fold in (1, 2):
        path = linear.results / f"estimators/mug/el00/fold{fold}/estimator.safetensors"
        with safe_open(path, framework="np") as stored:
            history = json.loads(stored.metadata()["nbv"])
        splits = read_splits(linear.results / "splits/mug.csv")
        assert history["trained_on"] == objects_with_role(splits, fold, "train")


def test_a_single_fold_is_made_again_by_its_name(linear):
    assert linear.would_run(*LINEAR, targets=(FOLD, "--forcerun", "fit")) == {"fit": 1}


def test_the_features_are_even_and_odd_parts_of_every_view(linear):
    features = np.load(linear.results / "features/mug/el00.npy", mmap_mode="r")
    assert features.shape == (8, 360, 1024)
    assert features.dtype == np.float16


def test_cross_fitted_distributions_come_from_a_classifier(fresh):
    overrides = (*TINY, *CLASSES, "calibration=crossfit", "categories=[mug]", "n_objects=6")
    fresh.run("--cores", "2", "estimates", overrides=overrides)
    assert error_deg(fresh) < 30
    assert error_deg(fresh, "calibration") < 30
    stored = np.load(fresh.results / "estimates/mug/el00/fold1/test_posteriors.npz")
    assert stored["log_posterior"].shape[1:] == (360, 24)
