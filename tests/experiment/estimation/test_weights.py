import hashlib

import pytest
import torch

from clock_faces import CPU, SETTINGS, clock_faces, named, untrained
from nbv.data.depth_images import DepthImages
from nbv.errors import UserError
from nbv.experiment.config import load_config
from nbv.experiment.estimation.features import read_features_provenance
from nbv.experiment.estimation.features_network import save_features, train_features
from nbv.experiment.estimation.training import train_estimator, train_network
from nbv.experiment.estimation.weights import read_start, save_estimator, with_category
from nbv.experiment.stages import FEATURES, stage_from, start_of
from projects import ROOT


def test_a_training_starts_from_the_weights_given_and_leaves_them(rng):
    faces = clock_faces(4)
    start = train_network(faces, SETTINGS | {"epochs": 2}, CPU, 0)
    before = {name: values.clone() for name, values in start.state_dict().items()}
    still = {"epochs": 1, "learning_rate": 1e-12, "weight_decay": 0.0}
    warm = train_network(faces, SETTINGS | still, CPU, 1, start.state_dict())
    cold = train_network(faces, SETTINGS | still, CPU, 1)
    own, other = dict(warm.named_parameters()), dict(cold.named_parameters())
    for name, values in start.named_parameters():
        torch.testing.assert_close(values, own[name], atol=1e-6, rtol=0)
    assert any(not torch.allclose(values, other[name]) for name, values in start.named_parameters())
    for name, values in start.state_dict().items():
        assert torch.equal(values, before[name])


def saved(path, seen, settings=SETTINGS) -> str:
    save_estimator(path, untrained(settings, seen=tuple(seen)), CPU)
    return str(path)


def test_an_estimator_says_what_it_started_from(tmp_path):
    (tmp_path / "el00").mkdir()
    path = saved(tmp_path / "el00/estimator.safetensors", ["a", "c"])
    start = read_start(path, "mug", ["c", "a"], str(tmp_path / "el15/one.safetensors"), CPU)
    settings = SETTINGS | {"epochs": 1}
    trained = train_estimator(named(clock_faces(3, 24)), ["a", "c"], settings, CPU, 0, start)
    digest = hashlib.sha256((tmp_path / "el00/estimator.safetensors").read_bytes()).hexdigest()
    assert trained.started_from == {"path": "../el00/estimator.safetensors", "sha256": digest}
    assert trained.trained_on == ["a", "c"]


@pytest.mark.parametrize(
    "seen",
    [
        ["a", "b"],
        ["a"],
        with_category("mug", ["a"]) + with_category("car", ["c"]),
        [],
    ],
)
def test_what_has_seen_other_objects_of_the_category_is_no_start(tmp_path, seen):
    path = saved(tmp_path / "start.safetensors", seen)
    with pytest.raises(UserError, match="it was trained on other objects of mug"):
        read_start(path, "mug", ["a", "c"], path, CPU)


def test_objects_of_other_categories_may_have_the_same_names(tmp_path):
    seen = with_category("mug", ["a", "c"]) + with_category("car", ["a", "b"])
    path = saved(tmp_path / "start.safetensors", seen)
    start = read_start(path, "mug", ["c", "a"], path, CPU)
    assert all(isinstance(value, torch.Tensor) for value in start.weights.values())


def test_a_start_of_another_size_is_refused(tmp_path):
    path = saved(tmp_path / "start.safetensors", "abc", SETTINGS | {"hidden": 16})
    start = read_start(path, "mug", list("abc"), path, CPU)
    with pytest.raises(UserError, match="network to start from has another size"):
        train_network(clock_faces(3), SETTINGS, CPU, 0, start.weights)


def test_a_training_takes_the_features_layers_and_not_their_outputs(tmp_path):
    images = DepthImages(("a", "b"), clock_faces(2))
    trained = train_features([images], ["mug"], {"mug": 90.0}, SETTINGS, CPU, 0)
    path = str(tmp_path / "features.safetensors")
    save_features(path, trained, {})
    start = read_start(path, "mug", ["a"], str(tmp_path / "el15/estimator.safetensors"), CPU)
    assert start.origin["path"] == "../features.safetensors"
    untrained = {"epochs": 1, "learning_rate": 1e-9, "weight_decay": 0.0}
    network = train_network(clock_faces(2), SETTINGS | untrained, CPU, 1, start.weights)
    weights, features = network.state_dict(), trained.network.state_dict()
    for name in ("0.0.weight", "2.weight", "2.bias"):
        torch.testing.assert_close(weights[name], features[name], atol=1e-3, rtol=1e-2)
    assert not torch.allclose(weights["4.weight"], features["4.weight"], atol=1e-2)


def test_a_network_that_starts_from_the_features_has_their_size():
    settings = load_config(ROOT / "config", ["estimator.warm_start=features"])["estimator"]
    made_with = read_features_provenance()["settings"]["estimator"]
    assert [settings[key] for key in ("channels", "hidden")] == [
        made_with["channels"],
        made_with["hidden"],
    ]
    assert {start_of("features", (0, 15), each) for each in (0, 15)} == {FEATURES}
    assert stage_from(FEATURES) == "fine_tuning"
