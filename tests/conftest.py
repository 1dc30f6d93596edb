"""What holds for all tests, and one small results tree for those that read results."""

import os
import shutil
from pathlib import Path

# As in the workflow's jobs: products of small matrices on several threads wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import hypothesis
import numpy as np
import pytest

import synthetic
from made_bundles import made_bundle
from nbv.bundles.bundle import Bundle
from nbv.bundles.recommender import Recommender
from nbv.experiment.results import load_evaluations
from projects import Project, copy_of_project, finished_project

# Machines are noisy, and a first example may import a library: no test is timed.
EXAMPLES = 200 if os.environ.get("CI") else 50
hypothesis.settings.register_profile("untimed", deadline=None, max_examples=EXAMPLES)
# A mutant is caught by any failing example: the smallest one is not looked for.
hypothesis.settings.register_profile(
    "mutation",
    deadline=None,
    derandomize=True,
    database=None,
    phases=(hypothesis.Phase.explicit, hypothesis.Phase.generate),
)
hypothesis.settings.load_profile("untimed")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What runs the workflow comes first, so that no process has a long test of its own at last."""
    runs = {"finished", "scratch", "fresh", "made"}
    items.sort(key=lambda item: runs.isdisjoint(item.fixturenames))


@pytest.fixture(scope="session")
def tree(tmp_path_factory):
    return synthetic.build_tree(tmp_path_factory.mktemp("results") / "synthetic")


@pytest.fixture(scope="session")
def evaluations(tree):
    return load_evaluations(synthetic.evaluation_files(tree))


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A project after a whole tiny run on two cores. Not to be changed: see `scratch`."""
    return finished_project(tmp_path_factory, "finished")


@pytest.fixture
def scratch(finished: Project, tmp_path: Path) -> Project:
    """A copy of the finished project, with what Snakemake remembers of it."""
    shutil.copytree(finished.folder, tmp_path / "project", symlinks=True)
    return Project(tmp_path / "project")


@pytest.fixture
def fresh(tmp_path: Path) -> Project:
    """A project in which nothing has been run."""
    (tmp_path / "project").mkdir()
    return copy_of_project(tmp_path / "project")


@pytest.fixture(scope="session")
def bundle() -> Bundle:
    """A bundle of random weights: 24 bins, three calibration objects at two elevations."""
    return made_bundle()


@pytest.fixture(scope="session")
def recommender(bundle: Bundle) -> Recommender:
    return Recommender(bundle)


@pytest.fixture(autouse=True)
def no_up(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Random weights do not know what is up in an image."""
    if {"bundle_file", "recommender"} & set(request.fixturenames):
        monkeypatch.setattr(Recommender, "lying_warnings", lambda self, codes, logits: ())


@pytest.fixture(scope="session")
def bundle_file(bundle: Bundle, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundle as a file. Not to be changed."""
    path = tmp_path_factory.mktemp("bundle") / "made.safetensors"
    bundle.save(path)
    return path
