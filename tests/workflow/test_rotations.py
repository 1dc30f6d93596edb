"""The target `rotations` of the studies' Snakefile, run small."""

from __future__ import annotations

import json

import pandas as pd
import pytest

from projects import STUDIES, TINY
from rotation_pairs import orientation_pairs

pytestmark = pytest.mark.slow


def test_a_table_of_pairs_is_judged(scratch):
    orientation_pairs().to_csv(scratch.folder / "pairs.csv", index=False)
    turns = {"symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}]}
    (scratch.folder / "models_info.json").write_text(json.dumps({"1": turns}))
    more = ("rotations.pairs=pairs.csv", "rotations.models_info=models_info.json")
    scratch.run("--cores", "2", *STUDIES, "rotations", overrides=(*TINY, *more))
    cells = pd.read_csv(scratch.results / "tables/rotations.csv")
    assert set(cells["group"]) == {"no symmetry or a discrete one", "turning freely"}
    assert set(cells["fusion"]) == {"average", "posterior", "score"}
    assert (
        "# Two views in three dimensions" in (scratch.results / "tables/rotations.md").read_text()
    )


def test_without_a_table_the_studys_own_estimators_are_judged(scratch):
    more = ("categories=[mug]", "rotations.turns=4", "rotations.views=3", "rotations.poses=60")
    targets = ("rotations", "results/tiny/rotations/cube/fold1/pairs.csv")
    scratch.run("--cores", "2", *STUDIES, *targets, overrides=(*TINY, *more))
    cells = pd.read_csv(scratch.results / "tables/rotations.csv")
    assert set(cells["group"]) == {"mug"}
    instances = [
        pd.read_csv(path) for path in scratch.results.glob("rotations/mug/*/instances.csv")
    ]
    assert [len(each["instance"].unique()) for each in instances] == [4, 4]
    single = pd.concat(instances).query("method == 'single' and fusion == 'average'")
    pairs = [pd.read_csv(path) for path in scratch.results.glob("rotations/mug/*/pairs.csv")]
    test = pd.concat(pairs).query("role == 'test'")
    assert single["mean_deg"].mean() == pytest.approx(test["error_deg"].mean(), abs=1e-3)
    cube = pd.read_csv(scratch.results / "rotations/cube/fold1/pairs.csv")
    # The largest angle between two poses of a cube.
    assert cube["error_deg"].max() < 62.8
