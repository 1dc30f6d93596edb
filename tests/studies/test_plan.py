"""What the studies make: of which runs, trainings, conditions and variants of bundles."""

import json
from pathlib import Path

import pytest
import yaml
from studies.kept_estimates import keep_estimates
from studies.plan import Studies, shuffle_folder, training_folder, variant_folder

from nbv.errors import UserError
from nbv.experiment.plan import Plan
from projects import ROOT, TINY


def studies_of(*overrides: str) -> Studies:
    return Studies(Plan.load(ROOT / "config", ("experiment=small", *TINY, *overrides)))


@pytest.fixture
def other(tmp_path, monkeypatch) -> Path:
    """The configuration of another, finished run, with one fold more."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "results/other"
    folder.mkdir(parents=True)
    config = studies_of("categories=[mug]").run.config
    settings = {key: value for key, value in config.items() if key != "gives_distributions"}
    path = folder / "configuration.yaml"
    path.write_text(yaml.safe_dump(json.loads(json.dumps(settings | {"n_folds": 3}))))
    return path


def test_the_run_itself_is_the_only_one_where_no_other_is_named():
    studies = studies_of()
    expected = [("tiny", name, 0, fold) for name in ("mug", "chair") for fold in (1, 2)]
    assert studies.leaderboard_folds == expected
    assert studies.compared_runs == ["tiny"]


def test_the_leaderboard_has_all_folds_of_every_run(other):
    folds = studies_of("leaderboard_runs=[other]").leaderboard_folds
    assert folds == [("other", "mug", 0, fold) for fold in (1, 2, 3)]


def test_runs_are_compared_by_this_runs_folds_and_by_the_roles_that_all_have(other):
    studies = studies_of("compared_runs=[other]", "categories=[mug]")
    keys = studies.compared(studies.compared_roles)
    assert keys == [
        (run, "mug", 0, fold, role)
        for run in ("tiny", "other")
        for fold in (1, 2)
        for role in ("calibration", "test")
    ]
    crossfit = ("calibration=crossfit", "crossfit_epochs=1")
    assert studies_of("compared_runs=[other]", *crossfit).compared_roles("tiny") == ("test",)
    methods = studies.two_view_methods("other")
    assert "single" not in methods
    assert {"random", "opposite", "proposed"} <= set(methods)


def test_a_file_of_another_run_has_to_be_there(other):
    studies = studies_of("compared_runs=[other]")
    studies.check_file("tiny", "results/tiny/absent.csv", "compared_runs")
    with pytest.raises(UserError, match=r"compared_runs: .*absent.csv does not exist; finish the"):
        studies.check_file("other", "results/other/absent.csv", "compared_runs")


def test_extensions_that_follow_a_table_have_one():
    studies = studies_of()
    extensions = studies.run.config["extensions"]
    assert studies.extension_lookups
    for name in studies.extension_lookups:
        assert extensions[name]["fusion"] != "product"
    studies.check_posterior("random", "opposite")
    with pytest.raises(UserError, match="policy: opposite, fusion: posterior"):
        studies_of("~extensions.opposite_posterior").check_posterior("random", "opposite")


def test_a_condition_changes_sensor_and_framing_alone():
    studies = studies_of("camera.framing=axis", "camera.image_side=16", "seed=3")
    run = studies.run.config
    for name, condition in run["transfer"]["conditions"].items():
        found = studies.condition(name)
        assert found["camera"] == run["camera"] | {"framing": condition["framing"]}
        chosen = Plan.load(ROOT / "config", (f"sensor={condition['sensor']}",)).config
        assert found["sensor"] == chosen["sensor"]
        same = {key: value for key, value in found.items() if key not in ("camera", "sensor")}
        assert same == {key: run[key] for key in same}, name


def test_parameters_belong_to_the_sensor_that_they_were_given_for():
    given = ("sensor=stereo", "sensor.parameters.baseline_m=0.1", "sensor.diagonal_m.mug=0.2")
    conditions = [
        f"transfer.conditions.{s}={{sensor:{s},framing:silhouette}}" for s in ("stereo", "kinect")
    ]
    studies = studies_of(*given, *conditions)
    run = studies.run.config
    assert studies.condition("stereo") == run
    kinect = studies.condition("kinect")["sensor"]
    default = Plan.load(ROOT / "config", ("sensor=kinect",)).config["sensor"]
    assert kinect["parameters"] == default["parameters"]
    assert kinect["diagonal_m"] == run["sensor"]["diagonal_m"]


def test_the_run_is_used_where_it_was_made_under_the_condition():
    studies = studies_of()
    assert studies.condition_folder("ideal") == studies.estimator_folder("ideal") == ""
    assert studies.condition_folder("kinect") == "/transfer/kinect"
    assert studies.condition("kinect")["sensor"]["name"] == "kinect"
    warm = studies_of("estimator.warm_start=both")
    assert warm.condition_folder("ideal") == ""
    assert warm.estimator_folder("ideal") == "/transfer/ideal"
    with pytest.raises(UserError, match=r"transfer\.conditions has no sonar"):
        studies.condition("sonar")
    crossfit = studies_of("calibration=crossfit", "crossfit_epochs=1")
    with pytest.raises(UserError, match="needs calibration=holdout"):
        crossfit.estimator_folder("ideal")


def test_the_first_training_is_the_run_itself():
    assert training_folder("0", "0") == training_folder(0, 0) == shuffle_folder("0") == ""
    assert training_folder(0, 2) == "/confirmation/shuffle0/replicate2"
    assert shuffle_folder("3") == "/confirmation/shuffle3"
    studies = studies_of("confirmation.replicates=[[0,2],[],[1]]")
    assert studies.trainings == [(0, 0), (0, 2), (2, 1)]
    (kept,) = studies.kept_runs.values()
    assert kept.path is None
    assert list(kept.keys) == [(*t, c, 0) for t in studies.trainings for c in ("mug", "chair")]
    assert [one["category"] for one in studies.kept_trainings] == ["mug", "chair"] * 3


def test_files_of_one_run_are_not_joined(tmp_path):
    config = studies_of().run.config
    files = [tmp_path / "one.npz", tmp_path / "two.npz"]
    for path in files:
        keep_estimates(path, {}, config)
    kept = f"confirmation.kept=[{','.join(map(str, files))}]"
    with pytest.raises(UserError, match=r"two\.npz is of the run tiny, as .*one\.npz is"):
        _ = studies_of(kept).kept_runs


def test_a_bundle_is_trained_without_each_ingredient_and_by_each_replicate():
    assert variant_folder() == ""
    assert variant_folder("size", 2) == "/without_size/replicate2"
    studies = studies_of(
        "++bundles.ingredients.size.size=0", "++bundles.replicates=[0,2]", "categories=[mug]"
    )
    assert studies.variants == {
        "/replicate2": ("", 2),
        "/without_size": ("size", 0),
        "/without_size/replicate2": ("size", 2),
    }
    assert studies.rendered_variants == ["/without_size"]
    assert len(studies.compared_variants) == 4
    own = studies.run.config["randomisation"]
    assert studies.randomisation("/replicate2") == own
    assert studies.randomisation("/without_size") == own | {"size": 0}
    assert "replicate" not in studies.bundle_settings("/without_size")
    assert studies.bundle_settings("/replicate2")["replicate"] == 2


def test_rotations_are_estimated_by_networks_with_calibration_objects_alone():
    studies = studies_of("categories=[mug]", "rotations.judged_folds=[2]")
    assert studies.judged_folds == [("mug", 2)]
    assert studies.category_folds == [("mug", 1), ("mug", 2)]
    assert studies.shape_folds[:3] == [("mug", 1), ("mug", 2), ("tetrahedron", 1)]
    crossfit = ("calibration=crossfit", "crossfit_epochs=1")
    for refused in (("estimator=linear",), crossfit):
        with pytest.raises(UserError, match=r"rotations.pairs=null"):
            assert studies_of(*refused).category_folds
