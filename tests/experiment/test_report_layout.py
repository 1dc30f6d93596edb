"""Paths: one place spells them, with values and with wildcards alike."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path

from nbv.experiment.layout import Layout, files_by_run, fold_folder, unit_folder

ROOT = Path(__file__).parents[2]
LAYOUT = Layout("results/paper")
OF_FOLD = [
    LAYOUT.estimator,
    *(
        lambda *fold, path=path, name=name: path(*fold, name)
        for path, name in [
            *product([LAYOUT.estimates, LAYOUT.posteriors], ["calibration", "test"]),
            *product([LAYOUT.lookup, LAYOUT.evaluation, LAYOUT.extension], ["one", "another"]),
            *product([LAYOUT.part_estimator], ["1", "2"]),
        ]
    ),
]


def test_wildcards_stand_for_values():
    for path in OF_FOLD:
        pattern = path("{category}", "{elevation}", "{fold}")
        assert pattern.format(category="mug", elevation="05", fold=3) == path("mug", 5, 3)
    assert LAYOUT.depth("{category}", "{elevation}").format(category="mug", elevation="75") == (
        LAYOUT.depth("mug", 75)
    )
    assert LAYOUT.table("{table}", "csv").format(table="table1") == LAYOUT.table("table1", "csv")


def test_no_two_things_share_a_path():
    places = list(product(("mug", "chair"), (0, 15), (1, 2)))
    found = [path(*place) for path in OF_FOLD for place in places]
    found += [LAYOUT.depth(category, elevation) for category, elevation, fold in places if fold < 2]
    found += [path(c) for path in (LAYOUT.meshes, LAYOUT.splits) for c in ("mug", "chair")]
    found += [LAYOUT.ablation("one"), LAYOUT.log("train"), LAYOUT.benchmark("train")]
    found += [LAYOUT.table("table1", kind) for kind in ("csv", "md", "tex", "html")]
    found += [LAYOUT.figure("figure2", kind) for kind in ("png", "pdf")]
    found += [LAYOUT.claims("csv"), LAYOUT.report, LAYOUT.configuration, LAYOUT.provenance]
    assert len(set(found)) == len(found)
    assert all(path.startswith("results/paper/") for path in found)


def test_a_subfolder_has_the_same_paths():
    below = LAYOUT.below("transfer", "kinect")
    assert below.depth("mug", 0) == "results/paper/transfer/kinect/depth/mug/el00.npy"
    for path in ("estimator", "part_estimator", "evaluation"):
        arguments = ("mug", 0, 1, *(["x"] if path != "estimator" else []))
        relative = getattr(LAYOUT, path)(*arguments).removeprefix("results/paper/")
        assert getattr(below, path)(*arguments) == f"results/paper/transfer/kinect/{relative}"


def test_folders_are_parts_of_paths():
    assert unit_folder("mug", 5) == "mug/el05"
    assert fold_folder("mug", 5, 2) in LAYOUT.estimator("mug", 5, 2)


def test_rules_and_scripts_spell_no_path():
    stages = "meshes|splits|depth|estimators|estimates|lookup|evaluation|extensions|tables|figures"
    spelt = re.compile(rf"[}}\"'/](?:{stages}|logs|benchmarks|ablation|transfer)/")
    for path in [*ROOT.glob("workflow/rules/**/*.smk"), *ROOT.glob("workflow/scripts/*.py")]:
        code = re.sub(r"\.(?:log|benchmark)\(\s*f?\".*?\"\s*\)", "", path.read_text(), flags=re.S)
        assert not spelt.search(code), path


def test_files_are_told_apart_by_run():
    keys = [("one", "mug", 1), ("two", "mug", 1), ("one", "mug", 2)]
    assert files_by_run(keys, ["a", "b", "c"]) == {
        "one": {("mug", 1): "a", ("mug", 2): "c"},
        "two": {("mug", 1): "b"},
    }
