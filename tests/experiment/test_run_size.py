from __future__ import annotations

import pytest

from nbv.experiment.config import load_config
from nbv.experiment.run_size import FEWEST_EPOCHS, FEWEST_OBJECTS, too_small
from projects import ROOT

ENOUGH = {"mug": FEWEST_OBJECTS, "car": FEWEST_OBJECTS}


def of_experiment(name):
    settings = load_config(ROOT / "config", [f"experiment={name}"])
    objects = dict.fromkeys(settings["categories"], settings["n_objects"])
    return too_small(objects, settings["estimator"]["epochs"])


def test_the_quick_experiment_is_too_small_and_the_others_are_not():
    assert len(of_experiment("quick")) == 1
    assert of_experiment("paper") == of_experiment("bundles") == ()


@pytest.mark.parametrize("epochs", [None, FEWEST_EPOCHS, 100])
def test_the_least_is_enough(epochs):
    assert too_small(ENOUGH, epochs) == ()


@pytest.mark.parametrize(
    ("objects", "epochs", "words"),
    [
        (ENOUGH | {"mug": FEWEST_OBJECTS - 1}, 11, "49 objects of mug"),
        ({"mug": 20, "car": 9}, 11, "9 objects of car"),
        (ENOUGH, 1, "1 epoch of training"),
        (ENOUGH, FEWEST_EPOCHS - 1, "3 epochs of training"),
    ],
)
def test_what_is_too_little_is_named(objects, epochs, words):
    (sentence,) = too_small(objects, epochs)
    assert words in sentence


def test_both_reasons_are_given():
    (sentence,) = too_small({"mug": 9}, 2)
    assert "9 objects of mug" in sentence
    assert "2 epochs" in sentence
