"""The plan of a run: its units and jobs, what is shown, and what a wrong setting is told."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.data.meshes import save_meshes
from nbv.data.sources import open_source, prepare_meshes
from nbv.errors import UserError
from nbv.experiment.config import load_config
from nbv.experiment.plan import FEWEST_EPOCHS, FEWEST_OBJECTS, Plan, paths, too_small
from nbv.experiment.report.figures import FIGURES
from nbv.experiment.report.tables import TABLES
from nbv.experiment.stages import STAGES, stage_from, stage_settings, start_of
from projects import ROOT, TINY

ELEVATIONS = st.sets(st.integers(0, 89), min_size=1)


def plan_of(*overrides: str) -> Plan:
    return Plan.load(ROOT / "config", ("experiment=small", *TINY, *overrides))


def test_a_plan_of_two_categories_and_two_folds():
    plan = plan_of("elevations_deg.mug=[30,15]")
    assert plan.results == "results/tiny"
    assert plan.units == [("mug", 30), ("mug", 15), ("chair", 0)]
    assert plan.lowest_units == [("mug", 15), ("chair", 0)]
    assert plan.folds_of([("mug", 30)]) == [("mug", 30, 1), ("mug", 30, 2)]
    assert {name: len(ids) for name, ids in plan.objects.items()} == {"mug": 8, "chair": 8}
    assert plan.lookup_criteria == ["pose_ambiguity"]
    assert plan.lookup_criteria == ["pose_ambiguity"]
    methods = list(plan.config["methods"])
    expected = [("mug", 15, fold, name) for name in methods for fold in (1, 2)]
    assert plan.evaluations_of([("mug", 15)]) == expected
    assert plan.parts == ()


def test_a_plan_is_made_once_for_all_parts_of_a_workflow():
    assert plan_of() is plan_of()


def test_a_path_has_the_values_in_the_order_of_its_wildcards():
    pattern = "<results>/estimates/{category}/el{elevation}/fold{fold}/test.csv"
    assert paths(pattern, [("mug", 5, 1), ("car", "75", "2")]) == [
        "<results>/estimates/mug/el05/fold1/test.csv",
        "<results>/estimates/car/el75/fold2/test.csv",
    ]
    with pytest.raises(ValueError, match="shorter"):
        paths(pattern, [("mug", 5)])


def test_cross_fitting_trains_on_parts_and_in_fewer_epochs():
    plan = plan_of("calibration=crossfit", "crossfit_epochs=2", "estimator.epochs=4")
    assert list(plan.parts) == list(range(1, plan.config["crossfit_parts"] + 1))
    assert plan.stage("training")["epochs"] == 2
    assert plan_of("estimator.epochs=4").stage("training")["epochs"] == 4


@pytest.mark.parametrize(
    ("overrides", "rules"),
    [
        ((), {"meshes": 2, "render": 2, "train": 4}),
        (("calibration=crossfit", "crossfit_epochs=1"), {"train_part": 8, "estimate": 4}),
        (("estimator.warm_start=both",), {"pretrain": 2}),
    ],
)
def test_every_job_of_a_run_is_counted(overrides, rules):
    always = {"splits": 2, "lookup": 4, "evaluate": 4}
    expected = {"meshes": 2, "render": 2, "train": 4} | always | rules
    expected |= {"table": 7, "figure": len(FIGURES), "claims": 1, "settings": 1}
    jobs = plan_of(*overrides).jobs(TABLES, FIGURES)
    rule, log = zip(*jobs, strict=True)
    assert {name: rule.count(name) for name in rule} == expected
    assert len(set(log)) == len(log)
    assert ("train", "train/mug/el00/fold2") in jobs
    assert list(log) == sorted(log, key=lambda name: Path(name).parts)


def test_tables_and_figures_are_of_the_focus_or_of_all_categories():
    plan = plan_of("elevations_deg.mug=[0,15]")
    assert plan.units_of("table1") == [("mug", 0), ("chair", 0)]
    assert plan.units_of("table2") == [("mug", 0), ("mug", 15)]
    assert plan.units_of("figure2") == [("mug", 0)]
    assert plan.settings_of("table2")["focus_category"] == "mug"
    assert set(plan.settings_of("figure9")) == {"methods"}
    assert set(plan.settings_of("table1")) == {"methods", "n_resamples", "seed"}


def test_the_data_set_of_a_category_holds_nothing_of_the_others():
    plan = plan_of("dataset.turn_deg={mug: 10, chair: 20}", "dataset.handle_reach=0.3")
    mug, chair = plan.dataset_of("mug"), plan.dataset_of("chair")
    assert (mug["turn_deg"], chair["turn_deg"]) == ({"mug": 10}, {"chair": 20})
    assert (mug["handle_reach"], chair["handle_reach"]) == (0.3, 0.0)


def test_objects_of_a_data_set_that_is_gone_are_those_of_the_last_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    gone = ("dataset=folder", "dataset.root=gone", "categories=[mug]", "name=left")
    with pytest.raises(UserError, match="gone does not exist"):
        plan_of(*gone)
    path = tmp_path / "results/left/meshes/mug.npz"
    path.parent.mkdir(parents=True)
    source = open_source(plan_of().config["dataset"], 0)
    save_meshes(path, prepare_meshes(source, "mug", ["mug-0003"]))
    assert plan_of(*gone).objects == {"mug": ["mug-0003"]}


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (("camera.framing=axis",), "camera.framing=axis: a bundle's frames"),
        (("calibration=crossfit", "crossfit_epochs=1"), "a bundle needs calibration=holdout"),
        ((), "estimator=regressor: a bundle needs"),
        (("estimator=classifier", "~sensor.diagonal_m.mug"), "sensor.diagonal_m.mug: a bundle"),
    ],
)
def test_settings_that_make_no_bundle_are_named(overrides, message):
    with pytest.raises(UserError, match=message):
        plan_of(*overrides).check_bundle("mug")


def test_estimates_of_another_program_have_no_images(tmp_path):
    rows = [
        f"{category},0,{number},{azimuth},{azimuth}"
        for category in ("mug", "chair")
        for number in range(4)
        for azimuth in range(0, 360, 15)
    ]
    header = "category,elevation_deg,object_id,azimuth_deg,estimate_deg"
    (tmp_path / "pairs.csv").write_text("\n".join([header, *rows, ""]))
    plan = plan_of("estimator=external", f"estimator.pairs={tmp_path / 'pairs.csv'}")
    assert {name: len(ids) for name, ids in plan.objects.items()} == {"mug": 4, "chair": 4}
    rules = {rule for rule, _ in plan.jobs(TABLES, ())}
    assert "estimate" in rules
    assert not {"meshes", "render", "train"} & rules
    with pytest.raises(UserError, match="estimator=external has no meshes"):
        plan.check_images()


def test_a_script_depends_on_the_renderer_and_the_sensor_that_draw_its_images():
    script = ROOT / "workflow/scripts/render_depth.py"
    plan = plan_of("renderer=embree")
    noisy = plan.config | {"sensor": plan.config["sensor"] | {"name": "kinect"}}
    plain, kinect = (
        {Path(path).name for path in plan.sources(script, settings)} for settings in (None, noisy)
    )
    assert "embree.py" in plain
    assert "pyrender.py" not in plain
    assert kinect - plain == {"triangulation.py"}


@given(ELEVATIONS, st.sampled_from(["none", "elevations", "categories", "both"]))
def test_every_chain_of_starts_ends_with_what_the_setting_says(elevations, warm_start):
    for elevation in elevations:
        chain: list[int | str | None] = [elevation]
        while isinstance(chain[-1], int):
            chain.append(start_of(warm_start, elevations, chain[-1]))
        *steps, last = chain
        if warm_start in ("elevations", "both"):
            assert steps == sorted((e for e in elevations if e <= elevation), reverse=True)
        else:
            assert steps == [elevation]
        assert last == ("pretrained" if warm_start in ("categories", "both") else None)


@pytest.mark.parametrize("kind", ["regressor", "classifier"])
def test_a_stage_has_its_own_epochs_and_rate_and_nothing_of_the_others(kind):
    estimator = load_config(ROOT / "config", [f"estimator={kind}"])["estimator"]
    stages = {stage: stage_settings(estimator, stage) for stage in STAGES}
    for stage, settings in stages.items():
        own = estimator if stage == "training" else estimator[stage]
        assert (settings["epochs"], settings["learning_rate"]) == (
            own["epochs"],
            own["learning_rate"],
        )
    # What a training from random weights is recorded with: the same keys as ever.
    assert set(stages["training"]) == set(estimator) - {"warm_start", "mirror_images", *STAGES}
    assert all(set(settings) == set(stages["training"]) for settings in stages.values())


@pytest.mark.parametrize(
    ("start", "stage"), [(None, "training"), ("pretrained", "fine_tuning"), (0, "next_elevation")]
)
def test_what_a_training_starts_from_decides_its_stage(start, stage):
    assert stage_from(start) == stage


@given(st.integers(1, 100), st.integers(1, 100), st.integers(1, 100))
def test_stages_keep_their_proportion_where_epochs_are_fewer(whole, fewer, own):
    estimator = {
        "epochs": whole,
        "learning_rate": 0.1,
        "fine_tuning": {"epochs": own, "learning_rate": 0.2},
    }
    assert stage_settings(estimator, "training", fewer)["epochs"] == fewer
    epochs = stage_settings(estimator, "fine_tuning", fewer)["epochs"]
    assert epochs >= 1
    assert abs(epochs - own * fewer / whole) <= max(0.5, 1 - own * fewer / whole)


ENOUGH = {"mug": FEWEST_OBJECTS, "car": FEWEST_OBJECTS}


def of_experiment(name):
    settings = load_config(ROOT / "config", [f"experiment={name}"])
    objects = dict.fromkeys(settings["categories"], settings["n_objects"])
    return too_small(objects, settings["estimator"].get("epochs"))


def test_the_tests_experiment_is_too_small_and_the_others_are_not():
    assert len(of_experiment("small")) == 1
    assert of_experiment("paper") == of_experiment("quick") == of_experiment("bundles") == ()


@pytest.mark.parametrize(
    ("objects", "epochs", "words"),
    [
        *((ENOUGH, epochs, ()) for epochs in (None, FEWEST_EPOCHS, 100)),
        (ENOUGH | {"mug": FEWEST_OBJECTS - 1}, 11, ["49 objects of mug"]),
        (ENOUGH, FEWEST_EPOCHS - 1, ["3 epochs of training"]),
        ({"mug": 9}, 2, ["9 objects of mug", "2 epochs"]),
    ],
)
def test_every_reason_why_a_run_is_too_small_is_named_in_one_sentence(objects, epochs, words):
    sentences = too_small(objects, epochs)
    assert len(sentences) == bool(words)
    assert all(word in sentences[0] for word in words)


def test_a_linear_estimator_has_no_stage_of_training():
    linear = plan_of("estimator=linear")
    assert linear.start("mug", 0) is None
    with pytest.raises(UserError, match="estimator=linear trains no network, which this target"):
        linear.stage("training")


@pytest.mark.parametrize("kind", ["regressor", "linear"])
def test_estimators_learn_from_mirror_images_where_a_category_has_a_plane(kind):
    estimator = f"estimator={kind}"
    assert plan_of(estimator).mirror_plane_deg("mug") == 90.0
    assert plan_of(estimator, "estimator.mirror_images=false").mirror_plane_deg("mug") is None
    assert plan_of(estimator, "~mirror_plane_deg.mug").mirror_plane_deg("mug") is None


def test_networks_without_mirror_images_that_are_meant_to_have_them_are_told():
    assert plan_of().unmirrored == ()
    assert plan_of("~mirror_plane_deg.mug", "estimator.mirror_images=false").unmirrored == ()
    (sentence,) = plan_of("~mirror_plane_deg.mug").unmirrored
    assert sentence.startswith("mug: ")
