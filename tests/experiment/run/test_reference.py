import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.errors import UserError
from nbv.experiment.config import load_config, read_configuration
from nbv.experiment.report.tables import TABLES
from nbv.experiment.run.compare import compare_runs
from nbv.experiment.run.reference import (
    UNSET,
    collect_reference,
    differing_settings,
    find_reference,
)

ROOT = Path(__file__).parents[3]


def files(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_a_reference_keeps_what_a_reviewer_reads(finished, tmp_path):
    reference = tmp_path / "docs" / "reference" / "synthetic"
    written = collect_reference(finished, reference)
    kept, run = files(reference), files(finished)
    assert {str(path.relative_to(reference)) for path in written} == set(kept)
    expected = {f"tables/{name}.{kind}" for name in TABLES for kind in ("csv", "md")}
    expected |= {"figures/figure7.png", "figures/figure8.png", "claims.csv", "claims.md"}
    expected |= {"runtime.csv", "runtime.md", "configuration.yaml", "provenance.json"}
    assert set(kept) == expected
    for name, content in kept.items():
        assert content == run[f"tables/{name}" if name.startswith("runtime") else name]
    assert compare_runs(reference, finished).agrees


def test_a_reference_made_again_loses_what_the_run_has_not(run, tmp_path, caplog):
    reference = tmp_path / "reference"
    (run.parent / "bench.json").write_text("[]\n")
    collect_reference(run, reference)
    assert (reference.parent / "bench.json").read_text() == "[]\n"
    assert "clean commit" not in caplog.text
    (run.parent / "bench.json").unlink()
    (reference / "README.md").write_text("kept\n")
    for kind in ("csv", "md"):
        (run / "tables" / f"table7.{kind}").unlink()
    (run / "figures" / "figure7.png").unlink()
    (run / "provenance.json").write_text(json.dumps({"commit": "0123-dirty"}))
    collect_reference(run, reference)
    kept = files(reference)
    assert not any("table7" in name or "figure7" in name for name in kept)
    assert {"README.md", "tables/table1.csv"} <= set(kept)
    assert "made at 0123-dirty, not at a clean commit" in caplog.text


@pytest.mark.parametrize("name", ["claims.md", "tables/runtime.csv", "figures/*.png"])
def test_an_unfinished_run_leaves_the_reference_as_it_was(run, finished, tmp_path, name):
    reference = tmp_path / "reference"
    collect_reference(finished, reference)
    before = files(reference)
    (run / "claims.csv").write_text("other\n")
    for path in run.glob(name):
        path.unlink()
    with pytest.raises(UserError, match="finish the run first"):
        collect_reference(run, reference)
    assert files(reference) == before


def test_a_name_without_a_reference_is_told_those_there_are(finished, tmp_path):
    with pytest.raises(UserError, match="no reference exists yet"):
        find_reference(tmp_path / "reference", {"name": "quick"})
    collect_reference(finished, tmp_path / "reference" / "paper")
    with pytest.raises(UserError, match=r"'quick' cannot be compared \(references: paper\)"):
        find_reference(tmp_path / "reference", {"name": "quick"})


def test_other_settings_are_told_before_a_run_is_made(finished, tmp_path):
    reference = tmp_path / "synthetic"
    collect_reference(finished, reference)
    configuration = read_configuration(finished)
    assert find_reference(tmp_path, configuration) == reference
    with pytest.raises(UserError, match=r"settings differ from .*: seed=3 \(reference: not set\)$"):
        find_reference(tmp_path, configuration | {"seed": 3})


@pytest.mark.parametrize("name", ["paper", "quick"])
def test_a_run_of_today_can_be_compared_with_what_is_kept(name):
    configuration = load_config(ROOT / "config", [f"experiment={name}"])
    kept = ROOT / "docs/reference" / name
    assert find_reference(kept.parent, configuration) == kept


def test_settings_that_no_table_of_every_run_depends_on():
    sizes = {"parameters": {}, "diagonal_m": {"mug": 0.17}}
    before = {"sensor": {"name": "ideal"}}
    after = {"sensor": {"name": "ideal", **sizes}, "transfer": {"folds": [1]}}
    assert differing_settings(before, after) == ()
    kinect = {"sensor": {"name": "kinect", **sizes}}
    other = {"sensor": {"name": "kinect", **sizes, "diagonal_m": {"mug": 0.2}}}
    assert differing_settings(kinect, other) == (("sensor.diagonal_m.mug", 0.17, 0.2),)


def test_a_key_that_is_younger_than_the_reference_has_its_default_there():
    assert differing_settings({}, {"calibration": "holdout", "compared_runs": ["other"]}) == ()
    changed = ("calibration", "holdout", "crossfit")
    assert differing_settings({}, {"calibration": "crossfit"}) == (changed,)
    younger = {"estimator": {"n_classes": 72}}
    assert differing_settings({"estimator": {}}, younger) == (("estimator.n_classes", None, 72),)


@given(
    st.dictionaries(st.sampled_from("abc"), st.integers(0, 2)),
    st.dictionaries(st.sampled_from("abc"), st.integers(0, 2)),
)
def test_settings_differ_where_either_side_says_otherwise(a, b):
    found = {key: (x, y) for key, x, y in differing_settings({"in": a}, {"in": b})}
    for key in "abc":
        x, y = a.get(key, UNSET), b.get(key, UNSET)
        assert (f"in.{key}" in found) == (x != y)
        assert found.get(f"in.{key}", (x, y)) == (x, y)
