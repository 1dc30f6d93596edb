"""Which methods a configuration may name."""

import pytest

from made_estimates import EXTENSIONS
from nbv.errors import UserError
from nbv.experiment.methods import check_methods

METHODS = {
    "single": {"policy": "none", "fusion": "average"},
    "opposite": {"policy": "opposite", "fusion": "average"},
    "proposed": {"policy": "pose_ambiguity", "fusion": "average"},
}


@pytest.mark.parametrize(
    ("name", "policy", "fusion", "message"),
    [
        ("x", "oposite", "average", "did you mean 'opposite'"),
        ("single", "fixed", "average", "name is taken"),
        ("x", "selected", "selected", "no extension can be selected"),
        ("x", "oracle", "posterior", "no other extension fuses by posterior"),
        ("x", "opposite", "product", "choose estimator=classifier"),
    ],
)
def test_an_extension_that_cannot_be(name, policy, fusion, message):
    with pytest.raises(UserError, match=message):
        check_methods(METHODS, {name: {"policy": policy, "fusion": fusion}}, False)


@pytest.mark.parametrize("policy", ["bayes_error", "selected"])
def test_policies_that_need_estimates_are_refused_for_distributions(policy):
    extension = {"x": {"policy": policy, "fusion": "product"}} | EXTENSIONS
    with pytest.raises(UserError, match=r"extensions\.x\.policy=.* not defined for distributions"):
        check_methods(METHODS, extension, True)


@pytest.mark.parametrize(
    ("policy", "fusion", "message"),
    [
        ("oracle", "average", "belong under extensions"),
        ("none", "averge", r"methods\.x: fusion 'averge' is unknown: did you mean"),
    ],
)
def test_a_method_of_the_paper_that_cannot_be(policy, fusion, message):
    with pytest.raises(UserError, match=message):
        check_methods({"x": {"policy": policy, "fusion": fusion}}, {}, False)


def test_an_extension_may_have_its_criterions_name_unless_a_method_has_that_table():
    named = {"fixed": {"policy": "fixed", "fusion": "posterior"}}
    check_methods(METHODS, named, False)
    with pytest.raises(UserError, match="name is taken"):
        check_methods({"mine": {"policy": "fixed", "fusion": "average"}}, named, False)
