import json
import shutil
from fractions import Fraction
from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nbv.core.circle.criteria import POSE_LIKELIHOODS, SPREADS
from nbv.data.camera import FRAMINGS
from nbv.data.sources.files import open_shapenet
from nbv.errors import UserError
from nbv.experiment.config import (
    default_of,
    equal_cost_epochs,
    load_config,
    read_configuration,
    snakemake_overrides,
)
from nbv.experiment.config.schema import LINEAR, NAME_RULE, Dataset
from nbv.experiment.estimation import networks
from nbv.experiment.run.reference import differing_settings

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config"
CHOICES = [f"{path.parent.name}={path.stem}" for path in sorted(CONFIG.glob("*/*.yaml"))]


@pytest.mark.parametrize("choice", CHOICES)
def test_every_choice_composes_and_validates(choice):
    needed = ["estimator.pairs=pairs.csv"] if choice.startswith("estimator=external") else []
    assert load_config(CONFIG, [choice, *needed])["name"]


def test_an_external_estimator_and_its_file_belong_together():
    for overrides in (
        ["estimator=external"],
        ["estimator=external_distributions"],
        ["estimator.pairs=pairs.csv"],
    ):
        with pytest.raises(UserError, match="needs a file of calibration pairs"):
            load_config(CONFIG, overrides)


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
        ("estimator.device", ("auto", "cpu", "cuda", "mps")),
        ("estimator.precision", ("auto", "bfloat16", "float32")),
    ],
)
def test_names_are_those_that_the_code_knows(key, names):
    section, name = key.split(".")
    assert all(load_config(CONFIG, [f"{key}={n}"])[section][name] == n for n in names)
    with pytest.raises(UserError, match=f"choose from: {', '.join(sorted(names))}$"):
        load_config(CONFIG, [f"{key}=0"])


def test_every_layout_in_the_schema_is_one_of_shapenet(tmp_path):
    settings = load_config(CONFIG, ["dataset=shapenet", f"dataset.root={tmp_path}"])["dataset"]
    for layout in get_args(Dataset.model_fields["layout"].annotation):
        assert open_shapenet(settings | {"layout": layout}, 0).root == tmp_path


def test_every_kind_of_estimator_has_its_file():
    assert {path.stem for path in (CONFIG / "estimator").glob("*.yaml")} == {
        *networks.KINDS,
        *LINEAR,
        "external",
        "external_distributions",
    }


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
        ("renderer=pyrendr", "renderer=pyrendr is unknown: did you mean 'pyrender'?"),
        ("categories=[mgu]", "'mgu' is unknown: did you mean 'mug'?"),
        (
            "dataset.turn_deg.mgu=270",
            "dataset.turn_deg.mgu: elevations_deg has no mgu; did you mean 'mug'",
        ),
        ("estimator.epochs=many", "estimator.epochs=many: input should be a valid integer"),
        ("~seed", "seed is missing"),
        ("elevations_deg.mug=[95]", "elevations_deg.mug[0]=95: input should be less than or"),
        ("density.bandwidths_deg=[8,8.0]", "density.bandwidths_deg=[8, 8.0]: 8.0 occurs twice"),
        ("transfer.folds=[6]", "transfer.folds=[6] is out of range: 1 to n_folds=5"),
        ("rotations.judged_folds=[0]", "rotations.judged_folds=[0] is out of range"),
        ("camera.distance=900", "camera.distance=900 with camera.fov_deg=25 and camera."),
        ("estimator.kind=classifier", "it needs both"),
        ("estimator.n_classes=72", "a classifier has n_classes"),
        ("dataset.root=a\nb", r"dataset.root=a\nb: use one line of text"),
        ("dataset.root=~nobody-of-that-name/x", "~nobody-of-that-name/x: unknown user"),
        ("dataset.categories.mug=../../etc", "mug=../../etc: not below dataset.root"),
        ("dataset.up=up", "dataset.up=up: use an axis such as +y, a vector such as 0,0,1, or auto"),
        ("estimator", "is not of the form key=value"),
        ("methods={}", "methods={} changes nothing; ~methods.<key> leaves a key out"),
        ("seed=1,2", "'++seed=1,2'; 1. To use it as a list, use key=[value1,value2]"),
        ("seed=[1", "override 'seed=[1' cannot be read: "),
        ("seed=" + "9" * 5000, "configuration: Exceeds the limit"),
        ("dataset.root=???", "configuration key 'dataset.root': Missing mandatory value"),
    ],
)
def test_a_mistake_is_one_line_with_its_key(override, message):
    with pytest.raises(UserError) as caught:
        load_config(CONFIG, [override])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_kept_reference_has_the_settings_of_today():
    kept, ours = read_configuration(ROOT / "docs/reference/paper"), load_config(CONFIG)
    same = ("methods", "density", "more_views", "gives_distributions")
    assert {key: kept[key] for key in same} == {key: ours[key] for key in same}
    # What came later has the default that the reference was made with.
    both = ({"estimator": settings["estimator"]} for settings in (kept, ours))
    assert differing_settings(*both) == ()


@pytest.mark.parametrize(
    ("dataset", "reach", "share"),
    [(["dataset=procedural"], 0.2, 0.3), (["dataset=folder", "dataset.root=/tmp"], 0.0, 0.0)],
)
def test_only_generated_mugs_have_settings_of_mugs(dataset, reach, share):
    settings = load_config(
        CONFIG,
        ["experiment=bundles", "estimator=classifier", *dataset, "dataset.square_share=0.3"],
    )
    assert settings["dataset"]["handle_reach"] == reach
    assert settings["dataset"]["square_share"] == share


@pytest.mark.parametrize(
    ("key", "default"),
    [
        ("dataset.centre", "box"),
        ("seed", "none"),
        ("density.spread", "none"),
        ("packages.numpy", "none"),
        ("estimator.pretraining", {"epochs": 2, "learning_rate": 9e-3}),
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


BAD_NAMES = ("..", "", "-a", "a/b", "a{b}c", "a\nb", "é", "a" * 101)


NAMED = {
    "experiment": "NAME",
    "name": "NAME",
    "focus_category": "NAME",
    "categories": ["mug", "NAME"],
    "elevations_deg": {"mug": [0], "NAME": [0]},
    "methods": {"NAME": {"policy": "none"}},
    "extensions": {"NAME": {"policy": "random"}},
    "compared_runs": ["NAME"],
    "leaderboard_runs": ["NAME"],
    "dataset": {"categories": {"NAME": "folder"}},
    "dataset.turn_deg": {"NAME": 0},
    "sensor": {"diagonal_m": {"NAME": 1}},
    "sensor.parameters": {"NAME": 1},
    "transfer": {"conditions": {"NAME": {"sensor": "ideal", "framing": "axis"}}},
    "transfer.category": "NAME",
}


@pytest.mark.parametrize("key", NAMED)
@pytest.mark.parametrize("name", BAD_NAMES)
def test_the_same_rule_holds_for_every_name(tmp_path, key, name):
    """Written in a file, for there is no way to write most of them as an override."""
    section, _, last = key.partition(".")
    text = json.dumps({section: {last: NAMED[key]} if last else NAMED[key]} | {"n_folds": 2})
    written = text.replace('"NAME"', json.dumps(name))
    (tmp_path / "configuration.yaml").write_text(written, encoding="utf-8")
    with pytest.raises(UserError) as caught:
        read_configuration(tmp_path)
    assert f": {section}" in str(caught.value)
    assert NAME_RULE in str(caught.value)
    (tmp_path / "configuration.yaml").write_text(text.replace("NAME", "a.b_c-1"))
    if key not in ("categories",):
        assert read_configuration(tmp_path)


@pytest.mark.parametrize(
    "root", ["~/data", "/data/v=2", "/data/(old) set", "it's", "a\\", "a\\'b", "\\\\'"]
)
def test_a_path_needs_no_quotes(root):
    config = load_config(CONFIG, ["dataset=folder", f"dataset.root={root}"])
    assert config["dataset"]["root"] == root


def test_conditions_can_be_left_out_and_added():
    config = load_config(
        CONFIG,
        [
            "~transfer.conditions.axis",
            "transfer.conditions.both={sensor: stereo, framing: axis}",
        ],
    )
    assert list(config["transfer"]["conditions"]) == ["ideal", "kinect", "stereo", "both"]


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        ([], "paper"),
        (["estimator=classifier"], "paper-classifier"),
        (["calibration=crossfit"], "paper-crossfit"),
        (["dataset=shapenet", "estimator=classifier"], "paper-shapenet-classifier"),
        (["experiment=small", "calibration=crossfit", "name=mine"], "mine"),
        (["estimator=linear"], "paper-linear"),
        (["experiment=quick"], "quick"),
        (["experiment=quick", "estimator=regressor"], "quick-regressor"),
    ],
)
def test_another_data_set_estimator_or_calibration_gets_its_own_folder(overrides, name):
    assert load_config(CONFIG, overrides)["name"] == name


def test_a_linear_estimator_has_no_settings_of_a_training():
    settings = load_config(CONFIG, ["experiment=small", "estimator=linear", "estimator.epochs=3"])
    assert settings["estimator"] == {"kind": "linear", "mirror_images": True}
    classes = load_config(CONFIG, ["estimator=linear_classifier"])
    assert set(classes["estimator"]) == {
        *("kind", "mirror_images", "n_classes", "target_bandwidth_deg")
    }
    assert classes["gives_distributions"]


def test_the_quick_experiment_is_the_paper_with_another_estimator_and_a_fixed_density():
    paper, quick = (load_config(CONFIG, [f"experiment={name}"]) for name in ("paper", "quick"))
    differs = {key for key in paper if paper[key] != quick[key]}
    assert differs == {"experiment", "name", "estimator", "density"}


@pytest.mark.parametrize("n_classes", [45, 50])
def test_classes_divide_the_circle_and_its_half(n_classes):
    with pytest.raises(UserError, match=f"estimator.n_classes={n_classes} is"):
        load_config(CONFIG, ["estimator=classifier", f"estimator.n_classes={n_classes}"])


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
    with pytest.raises(UserError, match=r"crossfit_parts=99: estimator\.epochs=20 leaves"):
        load_config(CONFIG, ["calibration=crossfit", "estimator.epochs=20", "crossfit_parts=99"])


@pytest.mark.parametrize(
    ("handed", "expected"),
    [
        ({"experiment": "small"}, ["experiment=small"]),
        ({"n_objects": None}, ["n_objects=null"]),
        ({"overrides": ["a=1", "b=2"]}, ["a=1", "b=2"]),
        ({"overrides": "[a=[1,2],b={c:[3,4]},d=5]"}, ["a=[1,2]", "b={c:[3,4]}", "d=5"]),
        ({"overrides": ["a='0", 0, "1'", "b=2"]}, ["a='0,0,1'", "b=2"]),
        ({}, []),
    ],
)
def test_what_snakemake_hands_over(handed, expected):
    assert snakemake_overrides(handed) == expected


@pytest.mark.parametrize("given", [5, 0, True, 2.5, {"seed": 1}])
def test_overrides_are_a_list_or_text(given):
    with pytest.raises(UserError, match=r"--config overrides=.*: write it as overrides="):
        snakemake_overrides({"overrides": given})


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("config.yaml", b"", "config.yaml holds no settings"),
        ("experiment/paper.yaml", b"\xff\xfe\x00", "cannot be read as YAML"),
        ("estimator/regressor.yaml", b"kind: a\nkind: b\n", "YAML in line 2: found duplicate key"),
    ],
)
def test_a_damaged_file_of_the_configuration_is_named(tmp_path, file, content, message):
    shutil.copytree(CONFIG, tmp_path / "config")
    (tmp_path / "config" / file).write_bytes(content)
    with pytest.raises(UserError) as caught:
        load_config(tmp_path / "config")
    assert file in str(caught.value)
    assert message in str(caught.value)


KEPT = (ROOT / "docs/reference/paper/configuration.yaml").read_bytes()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "holds no settings"),
        (b"a: !!python/object/apply:os.system [true]\nn_folds: 5", "cannot be read as YAML"),
        (KEPT.replace(b"n_folds: 5", b"n_folds: x"), "n_folds=x: input should be a valid integer"),
        (KEPT.replace(b"- mug", b"- ../mug"), "categories[3]=../mug: use letters"),
        (b"n_folds: 5\ncategories: [mug]\nelevations_deg: {}", "elevations_deg.mug is missing"),
    ],
)
def test_a_damaged_kept_configuration_is_named(tmp_path, content, message):
    (tmp_path / "configuration.yaml").write_bytes(content)
    with pytest.raises(UserError) as caught:
        read_configuration(tmp_path)
    assert str(caught.value).startswith(str(tmp_path / "configuration.yaml"))
    assert message in str(caught.value)


def test_a_kept_configuration_has_the_keys_that_are_needed(tmp_path):
    (tmp_path / "configuration.yaml").write_text("n_folds: 5\n")
    with pytest.raises(UserError, match=r"configuration\.yaml: categories is missing"):
        read_configuration(tmp_path, ("categories", "methods"))


@pytest.mark.parametrize("kept", sorted((ROOT / "docs/reference").rglob("configuration.yaml")))
def test_every_kept_reference_can_be_read(kept):
    assert read_configuration(kept.parent, ("categories", "elevations_deg", "methods"))


# Fuzzing: whatever is given, the answer is a result or one line.

KEYS = (
    *("name", "seed", "experiment", "categories", "methods", "estimator", "estimator.epochs"),
    *("dataset.root", "density.bandwidths_deg", "transfer.conditions.x", "overrides", "sensor"),
    *("camera.fov_deg", "elevations_deg.mug", "dataset.turn_deg", "compared_runs", "~methods"),
)
NUMBERS = st.one_of(st.integers(), st.floats(), st.sampled_from(["1e999", ".inf", "0x", "1_0"]))
SNIPPETS = st.sampled_from(
    ["[", "]", "{", "}", "'", '"', "\\", "${", "}", ",", ":", "=", "~", "+", "@", "/", "..", "\n"]
)
TEXTS = st.one_of(st.text(max_size=30), st.lists(SNIPPETS, max_size=8).map("".join))
LISTS = st.lists(st.one_of(NUMBERS, TEXTS), max_size=3).map(
    lambda items: "[" + ",".join(map(str, items)) + "]"
)
OVERRIDES = st.one_of(
    TEXTS, st.builds("{}={}".format, st.sampled_from(KEYS), st.one_of(NUMBERS, TEXTS, LISTS))
)
# One composition takes a twentieth of a second and more; how long says nothing here.
FUZZED = settings(max_examples=30, deadline=None)


def result_or_one_line(function, *arguments):
    line = None
    try:
        return function(*arguments)
    except UserError as error:
        line = str(error)
    assert line
    assert line.isprintable()
    assert len(line) < 1000
    return None


@pytest.mark.slow
@FUZZED
@given(st.lists(OVERRIDES, max_size=3))
def test_any_override_gives_a_configuration_or_one_line(overrides):
    result_or_one_line(load_config, CONFIG, overrides)


SCALARS = st.one_of(NUMBERS, TEXTS, st.none(), st.booleans(), st.binary(max_size=5), st.dates())
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=6,
)


@FUZZED
@given(st.dictionaries(st.one_of(st.sampled_from(KEYS), st.integers(), TEXTS), VALUES, max_size=4))
def test_whatever_snakemake_hands_over_gives_overrides_or_one_line(given):
    overrides = result_or_one_line(snakemake_overrides, given)
    assert overrides is None or all(type(override) is str for override in overrides)


def test_what_cannot_be_printed_is_shown_by_its_escape():
    assert str(UserError("a\nb\x00c\ud800é")) == r"a\nb\x00c\ud800é"
