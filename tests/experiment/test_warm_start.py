from __future__ import annotations

import hashlib

import pytest
import torch

from clock_faces import CPU, SETTINGS, clock_faces, named, untrained
from nbv.errors import UserError
from nbv.experiment.estimation.training import train_estimator, train_network
from nbv.experiment.estimation.weights import read_start, save_estimator, with_category


def test_a_training_starts_from_the_weights_given_and_leaves_them(rng):
    faces = clock_faces(4)
    start = train_network(faces, SETTINGS | {"epochs": 2}, CPU, 0)
    before = {name: values.clone() for name, values in start.state_dict().items()}
    still = {"epochs": 1, "learning_rate": 1e-12, "weight_decay": 0.0}
    warm = train_network(faces, SETTINGS | still, CPU, 1, start)
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
    assert isinstance(start.network, torch.nn.Module)


def test_a_start_of_another_size_is_refused(tmp_path):
    path = saved(tmp_path / "start.safetensors", "abc", SETTINGS | {"hidden": 16})
    start = read_start(path, "mug", list("abc"), path, CPU)
    with pytest.raises(UserError, match="network to start from has another size"):
        train_network(clock_faces(3), SETTINGS, CPU, 0, start.network)
