from __future__ import annotations

import shutil
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.config import (
    default_of,
    load_condition,
    load_config,
    read_configuration,
    snakemake_overrides,
)
from nbv.config.compose import equal_cost_epochs
from nbv.errors import UserError
from nbv.estimation import hardware, networks
from nbv.recommendation.criteria.pose_ambiguity import POSE_LIKELIHOODS
from nbv.recommendation.criteria.spreads import SPREADS
from nbv.rendering.camera import FRAMINGS

ROOT = Path(__file__).parents[1]
CONFIG = ROOT / "config"
CHOICES = [f"{path.parent.name}={path.stem}" for path in sorted(CONFIG.glob("*/*.yaml"))]


@pytest.mark.parametrize("choice", CHOICES)
def test_every_choice_composes_and_validates(choice):
    assert load_config(CONFIG, [choice])["name"]


def test_the_default_is_the_paper():
    config = load_config(CONFIG)
    assert config["name"] == "paper"
    assert (config["n_objects"], config["n_folds"]) == (125, 5)
    units = [(c, e) for c in config["categories"] for e in config["elevations_deg"][c]]
    assert len(units) == 10


@pytest.mark.parametrize(
    ("key", "names"),
    [
        ("camera.framing", FRAMINGS),
        ("density.pose_likelihood", POSE_LIKELIHOODS),
        ("density.spread", SPREADS),
        ("estimator.device", hardware.DEVICES),
        ("estimator.precision", hardware.PRECISIONS),
    ],
)
def test_names_are_those_that_the_code_knows(key, names):
    section, name = key.split(".")
    assert all(load_config(CONFIG, [f"{key}={n}"])[section][name] == n for n in names)
    with pytest.raises(UserError, match=f"choose from: {', '.join(sorted(names))}$"):
        load_config(CONFIG, [f"{key}=0"])


def test_every_kind_of_estimator_has_its_file():
    assert {path.stem for path in (CONFIG / "estimator").glob("*.yaml")} == set(networks.KINDS)


def test_only_an_estimator_that_gives_distributions_has_methods_that_need_them():
    for estimator, expected in (("regressor", False), ("classifier", True)):
        config = load_config(CONFIG, [f"estimator={estimator}"])
        assert config["gives_distributions"] is expected
        fusions = [method["fusion"] for method in config["extensions"].values()]
        assert ("product" in fusions) is expected
        assert "gives_distributions" not in config["estimator"]


def plain(value) -> bool:
    if isinstance(value, dict):
        return all(type(key) is str and plain(item) for key, item in value.items())
    if isinstance(value, list):
        return all(map(plain, value))
    return type(value) in (str, int, float, bool, type(None))


def test_values_are_plain_python_which_is_all_that_snakemake_compares():
    assert plain(load_config(CONFIG))


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("estimator.epocs=3", "'estimator.epocs' is unknown: did you mean 'estimator.epochs'?"),
        ("sed=1", "'sed' is unknown: did you mean 'seed'?"),
        ("renderer=foo", "renderer=foo is unknown: choose from: embree, pyrender"),
        ("renderer=pyrendr", "renderer=pyrendr is unknown: did you mean 'pyrender'?"),
        ("experiment=quik", "did you mean 'quick'?"),
        ("renderer.name=embre", "renderer.name=embre is unknown: did you mean 'embree'?"),
        ("camera.framing=axs", "camera.framing=axs is unknown: did you mean 'axis'?"),
        ("density.pose_likelihood=truth", "density.pose_likelihood=truth is unknown"),
        ("density.spread=entrop", "density.spread=entrop is unknown: did you mean 'entropy'?"),
        ("estimator.epochs=many", "estimator.epochs=many is not a whole number"),
        ("n_objects=1.5", "n_objects=1.5 is not a whole number"),
        ("seed=true", "seed=True is not a whole number"),
        ("estimator.learning_rate=fast", "estimator.learning_rate=fast is not a number"),
        ("estimator.learning_rate=nan", "estimator.learning_rate=nan is out of range: a finite"),
        ("density.bandwidths_deg=4", "density.bandwidths_deg=4 is not a list"),
        ("camera=near", "camera=near is not a mapping"),
        ("~seed", "seed is missing"),
        ("estimator.epochs.more=3", "'estimator.epochs.more' is unknown"),
        ("methods.proposed.polcy=x", "did you mean 'methods.proposed.policy'?"),
        ("camera.distance=1", "camera.distance=1 is out of range: above 1, in object diagonals"),
        ("camera.fov_deg=180", "camera.fov_deg=180 is out of range: between 0 and 180"),
        ("recommendation.max_travel_deg=181", "max_travel_deg=181 is out of range: 0 to 180"),
        ("estimator.channels=[4,0]", "estimator.channels[1]=0 is out of range: 1 or more"),
        ("categories=[mgu]", "'mgu' is unknown: did you mean 'mug'?"),
        ("elevations_deg.mug=[95]", "elevations_deg.mug[0]=95 is out of range: 0 to 89"),
        ("estimator.epochs=0", "estimator.epochs=0 is out of range: 1 or more"),
        ("n_folds=1", "n_folds=1 is out of range: 2 or more"),
        ("seed=-1", "seed=-1 is out of range: 0 or more"),
        ("n_objects=3", "n_objects=3 is out of range"),
        ("dataset.centre=midle", "dataset.centre=midle is unknown: choose from: box, origin"),
        ("dataset.turn_deg.mgu=270", "dataset.turn_deg.mgu: no such category; did you mean 'mug'"),
        ("density.bandwidths_deg=[]", "density.bandwidths_deg=[] is out of range: one or more"),
        ("name='a b'", "name=a b: use letters"),
        ("estimator", "is not of the form key=value"),
        ("sensor=kinct", "sensor=kinct is unknown: did you mean 'kinect'?"),
        ("sensor.diagonal_m.mug=0", "sensor.diagonal_m.mug=0 is out of range: above 0"),
        ("transfer.folds=[6]", "transfer.folds=[6] is out of range: 1 to n_folds=5"),
        ("transfer.category=mgu", "transfer.category=mgu is no category of this run"),
        ("transfer.elevation_deg=90", "transfer.elevation_deg=90 is out of range: 0 to 89"),
        ("transfer.conditions.stereo.sensor=sterio", "did you mean 'stereo'?"),
        ("transfer.conditions.axis.framing=axs", "transfer.conditions.axis.framing=axs is unknown"),
        ("transfer.conditions.new.sensr=ideal", "did you mean 'transfer.conditions.new.sensor'?"),
        ("transfer.conditions={a b: {sensor: ideal, framing: axis}}", "a b: use letters"),
        ("calibration=crosfit", "calibration=crosfit is unknown: did you mean 'crossfit'?"),
        ("crossfit_parts=1", "crossfit_parts=1 is out of range: 2 or more"),
        ("crossfit_epochs=0", "crossfit_epochs=0 is out of range: 1 or more"),
        ("estimator.kind=classifier", "it needs both; choose estimator=classifier"),
        ("estimator.n_classes=72", "only a classifier has n_classes"),
        ("gives_distributions=true", "'gives_distributions' is unknown"),
    ],
)
def test_a_mistake_is_one_line_with_its_key(override, message):
    with pytest.raises(UserError) as caught:
        load_config(CONFIG, [override])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("contenders.x={rotation: fixed}", "configuration key 'contenders' is now 'extensions'"),
        ("beside=[a]", "configuration key 'beside' is now 'compared_runs'"),
        ("sequence.n_views=3", "configuration key 'sequence' is now 'more_views'"),
        ("density.reading=given_truth", "'density.reading' is now 'density.pose_likelihood'"),
        ("methods.proposed.rotation=fixed", "rotation' is now 'methods.proposed.policy'"),
        ("extensions.x={rotation: fixed}", "'extensions.x.rotation' is now 'extensions.x.policy'"),
        ("methods.proposed.policy=entropy", "policy 'entropy' is now 'pose_ambiguity'"),
        ("extensions.x={policy: chosen}", "extensions.x.policy: policy 'chosen' is now 'selected'"),
        ("extensions.selected.fusion=chosen", "fusion 'chosen' is now 'selected'"),
    ],
)
def test_an_earlier_name_is_one_line_with_the_new_name(override, message):
    with pytest.raises(UserError) as caught:
        load_config(CONFIG, [override])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_with_an_earlier_name_is_one_line_with_the_new_name(tmp_path):
    shutil.copytree(CONFIG, tmp_path / "config")
    decision = tmp_path / "config/density/decision.yaml"
    decision.write_text(decision.read_text().replace("pose_likelihood", "reading"))
    with pytest.raises(UserError, match=r"'density\.reading' is now 'density\.pose_likelihood'"):
        load_config(tmp_path / "config")


EARLIER = """
n_folds: 5
methods: {proposed: {rotation: entropy, fusion: average}, rotation: {rotation: none}}
contenders: {chosen: {rotation: chosen, fusion: chosen}}
density: {reading: given_truth, spread: entropy}
sequence: {n_views: 5}
beside: [entropy]
elevations_deg: {sequence: [0]}
estimator: {kind: classifier, n_classes: 120}
dropped: {key: 1}
"""


def test_a_kept_configuration_is_read_under_the_names_of_today(tmp_path):
    (tmp_path / "configuration.yaml").write_text(EARLIER)
    assert read_configuration(tmp_path) == {
        "n_folds": 5,
        "methods": {
            "proposed": {"policy": "pose_ambiguity", "fusion": "average"},
            "rotation": {"policy": "none"},
        },
        "extensions": {"chosen": {"policy": "selected", "fusion": "selected"}},
        "density": {"pose_likelihood": "given_truth", "spread": "entropy"},
        "more_views": {"n_views": 5},
        "compared_runs": ["entropy"],
        "elevations_deg": {"sequence": [0]},
        "estimator": {"kind": "classifier", "n_classes": 120},
        "dropped": {"key": 1},
        "gives_distributions": True,
    }


def test_a_kept_reference_has_the_settings_of_today():
    kept, ours = read_configuration(ROOT / "docs/reference/paper"), load_config(CONFIG)
    same = ("methods", "density", "more_views", "estimator", "gives_distributions")
    assert {key: kept[key] for key in same} == {key: ours[key] for key in same}


@pytest.mark.parametrize(
    ("key", "default"),
    [
        ("calibration", "holdout"),
        ("compared_runs", []),
        ("dataset.centre", "box"),
        ("methods.any.fusion", "average"),
        ("seed", "none"),
        ("density.spread", "none"),
        ("packages.numpy", "none"),
        ("sensor.parameters.focal_px", "none"),
    ],
)
def test_a_key_that_a_configuration_lacks_has_its_default(key, default):
    assert default_of(key, "none") == default


@pytest.mark.parametrize(
    "override", ["elevations_deg.bottle=[0,30]", "elevations_deg={bottle:[0,30]}"]
)
def test_a_category_of_ones_own(override):
    config = load_config(CONFIG, ["dataset=folder", override, "categories=[bottle]"])
    assert config["elevations_deg"]["bottle"] == [0, 30]


@pytest.mark.parametrize("root", ["~/data", "/data/v=2", "/data/(old) set", "it's"])
def test_a_path_needs_no_quotes(root):
    config = load_config(CONFIG, ["dataset=folder", f"dataset.root={root}"])
    assert config["dataset"]["root"] == root


def test_a_method_of_ones_own():
    config = load_config(CONFIG, ["methods.mine={policy: opposite}"])
    assert config["methods"]["mine"] == {"policy": "opposite", "fusion": "average"}


def test_conditions_can_be_left_out_and_added():
    config = load_config(
        CONFIG,
        [
            "~transfer.conditions.axis",
            "transfer.conditions.both={sensor: stereo, framing: axis}",
        ],
    )
    assert list(config["transfer"]["conditions"]) == ["ideal", "kinect", "stereo", "both"]


def test_a_condition_is_the_run_but_for_sensor_and_framing():
    overrides = ["experiment=quick", "camera.framing=axis", "camera.image_side=16", "seed=3"]
    run = load_config(CONFIG, overrides)
    for name, condition in run["transfer"]["conditions"].items():
        found = load_condition(CONFIG, overrides, run, condition)
        assert found["camera"] == run["camera"] | {"framing": condition["framing"]}
        assert found["sensor"] == load_config(CONFIG, [f"sensor={condition['sensor']}"])["sensor"]
        same = {key: value for key, value in found.items() if key not in ("camera", "sensor")}
        assert same == {key: run[key] for key in same}, name


def test_parameters_belong_to_the_sensor_that_they_were_given_for():
    overrides = ["sensor=stereo", "sensor.parameters.baseline_m=0.1", "sensor.diagonal_m.mug=0.2"]
    run = load_config(CONFIG, overrides)

    def seen_by(sensor):
        condition = {"sensor": sensor, "framing": "silhouette"}
        return load_condition(CONFIG, overrides, run, condition)

    assert seen_by("stereo") == run
    kinect = seen_by("kinect")["sensor"]
    assert kinect["parameters"] == load_config(CONFIG, ["sensor=kinect"])["sensor"]["parameters"]
    assert kinect["diagonal_m"] == run["sensor"]["diagonal_m"]


def test_another_data_set_gets_its_own_folder():
    assert load_config(CONFIG, ["dataset=shapenet"])["name"] == "paper-shapenet"
    assert load_config(CONFIG, ["dataset=shapenet", "name=mine"])["name"] == "mine"


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        ([], "paper"),
        (["estimator=classifier"], "paper-classifier"),
        (["calibration=crossfit"], "paper-crossfit"),
        (["dataset=shapenet", "estimator=classifier"], "paper-shapenet-classifier"),
        (["experiment=quick", "calibration=crossfit", "name=mine"], "mine"),
    ],
)
def test_another_estimator_or_calibration_gets_its_own_folder(overrides, name):
    assert load_config(CONFIG, overrides)["name"] == name


@pytest.mark.parametrize("override", ["n_classes=7", "n_classes=4", "target_bandwidth_deg=0"])
def test_a_classifier_with_settings_out_of_range(override):
    with pytest.raises(UserError, match=f"estimator.{override}.* is out of range"):
        load_config(CONFIG, ["estimator=classifier", f"estimator.{override}"])


def test_a_regressor_has_no_setting_of_a_classifier():
    assert "n_classes" not in load_config(CONFIG)["estimator"]
    assert load_config(CONFIG, ["estimator=classifier"])["estimator"]["n_classes"] > 2


@given(st.integers(1, 40), st.integers(1, 19), st.integers(2, 5))
def test_cross_fitting_costs_what_the_hold_out_costs_and_no_epoch_more(epochs, twentieths, parts):
    objects = 100 * parts
    fraction = twentieths / 20
    held_out = Fraction(20 - twentieths, 20) * objects * epochs

    def cost(each):
        return each * (parts * (objects - objects // parts) + objects)

    found = equal_cost_epochs(epochs, fraction, parts)
    assert cost(found) <= held_out < cost(found + 1)


def test_the_epochs_of_cross_fitting_are_written_down():
    config = load_config(CONFIG, ["calibration=crossfit", "estimator.epochs=20"])
    assert config["crossfit_epochs"] == 8
    assert load_config(CONFIG)["crossfit_epochs"] is None
    with pytest.raises(UserError, match="crossfit_epochs=0 is out of range: 1 or more"):
        load_config(CONFIG, ["calibration=crossfit", "estimator.epochs=2"])


@pytest.mark.parametrize(
    ("handed", "expected"),
    [
        ({"experiment": "quick"}, ["experiment=quick"]),
        ({"n_objects": None}, ["n_objects=null"]),
        ({"overrides": ["a=1", "b=2"]}, ["a=1", "b=2"]),
        ({"overrides": "[a=[1,2],b={c:[3,4]},d=5]"}, ["a=[1,2]", "b={c:[3,4]}", "d=5"]),
        ({"overrides": "a=[1,2]"}, ["a=[1,2]"]),
        ({"overrides": ["a='0", 0, "1'", "b=2"]}, ["a='0,0,1'", "b=2"]),
        ({}, []),
    ],
)
def test_what_snakemake_hands_over(handed, expected):
    assert snakemake_overrides(handed) == expected
