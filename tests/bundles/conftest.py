"""One small bundle for all tests of bundles."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_bundles import made_bundle

from nbv.bundles.bundle import Bundle, save_bundle
from nbv.bundles.recommender import Recommender


@pytest.fixture(scope="session")
def bundle() -> Bundle:
    """Of random weights: 24 bins, three calibration objects at two elevations."""
    return made_bundle()


@pytest.fixture(scope="session")
def recommender(bundle: Bundle) -> Recommender:
    return Recommender(bundle, "torch")


@pytest.fixture(scope="session")
def bundle_file(bundle: Bundle, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundle as a file. Not to be changed."""
    path = tmp_path_factory.mktemp("bundle") / "made.safetensors"
    save_bundle(path, bundle)
    return path
