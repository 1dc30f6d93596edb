"""The target `rotations` of the studies' Snakefile, run small."""

import json

import pandas as pd
import pytest

from projects import STUDIES, TINY
from rotation_pairs import orientation_pairs

from .conftest import CUBE

pytestmark = pytest.mark.slow


def test_a_table_of_pairs_is_judged(fresh):
    orientation_pairs().to_csv(fresh.folder / "pairs.csv", index=False)
    about_z = {"symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}]}
    (fresh.folder / "models_info.json").write_text(json.dumps({"1": about_z}))
    more = ("rotations.pairs=pairs.csv", "rotations.models_info=models_info.json")
    fresh.run("--cores", "2", *STUDIES, "rotations", overrides=(*TINY, *more))
    cells = pd.read_csv(fresh.results / "tables/rotations.csv")
    assert set(cells["group"]) == {"no symmetry or a discrete one", "turning freely", "all objects"}
    for made in ("tables/rotations.md", "tables/rotation_reliability.md", "figures/rotations.png"):
        assert (fresh.results / made).stat().st_size


def test_without_a_table_the_studys_own_estimators_are_judged(studied):
    cells = pd.read_csv(studied.results / "tables/rotations.csv")
    assert set(cells["group"]) == {"mug"}
    walks = [pd.read_csv(path) for path in studied.results.glob("rotations/mug/*/walks.csv")]
    assert [len(each["instance"].unique()) for each in walks] == [4, 4]
    single = pd.concat(walks).query("n_views == 1 and order == 'random'")
    pairs = [pd.read_csv(path) for path in studied.results.glob("rotations/mug/*/pairs.csv")]
    test = pd.concat(pairs).query("role == 'test'")
    assert single["error_deg"].mean() == pytest.approx(test["error_deg"].mean(), abs=1e-3)
    cube = pd.read_csv(studied.folder / CUBE)
    # The largest angle between two poses of a cube.
    assert cube["error_deg"].max() < 62.8
