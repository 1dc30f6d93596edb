"""The shipped bundle on real depth frames, where they are."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from nbv.bundles.evaluation import OPPOSITE, RANDOM, RECOMMENDED, SINGLE, evaluate
from nbv.bundles.manifest import read_manifest, see
from nbv.bundles.recommender import Recommender, shipped_bundles

ROOT = Path(__file__).parents[2]
FRAMES = Path(os.environ.get("NBV_FRAMES", ROOT.parent / "shared/data/frames"))

pytestmark = pytest.mark.skipif(
    not (FRAMES / "manifest.csv").is_file(), reason="the recordings are not here: NBV_FRAMES"
)


@pytest.fixture(scope="module")
def errors():
    recommender = Recommender.load("mug", "torch")
    recordings = read_manifest(FRAMES / "manifest.csv")
    turns = [see(recommender, one, None, None, pytest.fail) for one in recordings]
    found = evaluate(recommender.bundle, turns, n_views=(2, 3))
    return found.set_index(["sequence", "choice", "n_views"])["mae_deg"]


def test_no_frame_of_a_mug_is_refused_and_the_level_ones_are_right(errors):
    """Bounds of the project's aims; nothing was trained or chosen on these frames."""
    assert errors["1", SINGLE, 1] <= 12
    assert errors["1", RECOMMENDED, 2] <= 5
    assert errors["1", RECOMMENDED, 2] < errors["1", RANDOM, 2]
    assert errors["1", RECOMMENDED, 2] <= errors["1", OPPOSITE, 2] + 0.5


def test_from_above_two_views_are_right(errors):
    assert errors["2", RECOMMENDED, 2] <= 10
    assert errors["2", RECOMMENDED, 2] < errors["2", RANDOM, 2]


def test_the_shipped_bundle_is_small():
    assert {path.stem for path in shipped_bundles().values()} == {"mug"}
    assert shipped_bundles()["mug"].stat().st_size <= 3_000_000
