"""Another estimator and calibration in the real Snakefile, compared with a finished default run."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import safetensors

from projects import MUGS, STUDIES, Project, copy_run, finished_project

pytestmark = pytest.mark.slow

OTHER = (
    *MUGS,
    "name=other",
    "estimator=classifier",
    "estimator.n_classes=24",
    "calibration=crossfit",
    "crossfit_epochs=1",
)
PLACES = [f"mug/el00/fold{fold}" for fold in (1, 2)]


@pytest.fixture(scope="module")
def other(evaluated: Project, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of a cross-fitted classifier; the default run lies in the same folder."""
    made = finished_project(
        tmp_path_factory,
        "other",
        *(*STUDIES, "runs"),
        overrides=(*OTHER, "compared_runs=[tiny]"),
        prepare=partial(copy_run, evaluated),
    )
    return made.folder / "results/other"


def test_a_classifier_says_how_likely_each_azimuth_is(other):
    for place in PLACES:
        test = pd.read_csv(other / "estimates" / place / "test.csv", dtype={"object_id": str})
        with np.load(other / "estimates" / place / "test_posteriors.npz") as stored:
            p = np.exp(stored["log_posterior"].astype(float))
        assert p.shape == (4, 360, 24)
        np.testing.assert_allclose(p.sum(axis=-1), 1, atol=1e-5)
        mean = (p @ np.exp(2j * np.pi * np.arange(24) / 24)).ravel()
        scaled = np.exp(1j * np.radians(test["estimate_deg"])) * abs(mean)
        np.testing.assert_allclose(scaled, mean, atol=1e-4)


def test_image_distributions_recommend_for_the_images_of_the_default_run(other):
    for place in PLACES:
        single = pd.read_csv(other.parent / "tiny/evaluation" / place / "single.csv")
        chosen, opposite = (
            pd.read_csv(other / "evaluation" / place / f"{name}.csv")
            for name in ("gain_product", "opposite_product")
        )
        for rows in (chosen, opposite):
            assert list(rows.columns) == list(single.columns)
            assert (rows["object_id"] == single["object_id"]).all()
        assert (chosen["delta_deg"] % 15 == 0).all()
        assert (opposite["delta_deg"] == 180).all()


def test_runs_of_different_calibration_are_compared_on_test_objects_alone(other):
    text = (other / "tables/runs.md").read_text()
    assert "| MAE | other | tiny | tiny − other |" in text
    assert "| Mug: Gain product, test objects |" in text
    assert "| Mug: Single, test objects |" in text
    assert "calibration objects |" not in text


def test_cross_fitting_calibrates_with_every_object_that_is_not_tested(other):
    splits = pd.read_csv(other / "splits/mug.csv")
    held_out = pd.read_csv(other.parent / "tiny/splits/mug.csv")
    assert ((splits["role"] == "test") == (held_out["role"] == "test")).all()
    for fold, place in enumerate(PLACES, start=1):
        of_fold = splits[splits["fold"] == fold].set_index("object_id")["role"]
        everyone = set(of_fold.index[of_fold != "test"])
        estimates = pd.read_csv(other / "estimates" / place / "calibration.csv")
        assert set(estimates["object_id"]) == everyone
        folder = other / "estimators" / place
        assert trained_on(folder / "estimator.safetensors") == everyone
        for part in (1, 2):
            own = set(of_fold.index[of_fold == f"part{part}"])
            assert trained_on(folder / f"without_part{part}.safetensors") == everyone - own


def trained_on(path):
    with safetensors.safe_open(path, framework="np") as stored:
        return set(json.loads(stored.metadata()["nbv"])["trained_on"])
