"""The methods of a configuration: a policy and a fusion each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nbv.core.choose import named
from nbv.core.circle.criteria import CRITERIA, FOR_ESTIMATES
from nbv.core.circle.fusion import ESTIMATE_FUSIONS, FUSIONS, OF_DISTRIBUTIONS
from nbv.core.circle.policies import ORACLE, POLICIES, SINGLE, needs_lookup
from nbv.errors import UserError

SELECTED = "selected"
"""As a policy or a fusion: that of the method selected on calibration objects."""

Methods = Mapping[str, Mapping[str, Any]]


def selectable(extensions: Methods) -> list[str]:
    """Return the extensions that can be selected: Opposite or a criterion, fusing estimates."""
    return [
        name
        for name, method in extensions.items()
        if method["policy"] in ("opposite", *CRITERIA) and method["fusion"] in ESTIMATE_FUSIONS
    ]


def check_methods(methods: Methods, extensions: Methods, gives_distributions: bool) -> None:
    """Check a configuration's methods of the paper and its extensions, a policy and a fusion each.

    Raise UserError if a policy or a fusion is unknown or not possible, or an extension's name is
    taken.
    """
    for name, method in methods.items():
        key = f"methods.{name}"
        _check_names(key, method)
        if method["policy"] == ORACLE or method["fusion"] != "average":
            raise UserError(f"{key}: oracles and fusion other than average belong under extensions")
    taken = {*methods, *(method["policy"] for method in methods.values())}
    for name, method in extensions.items():
        key, policy, fusion = f"extensions.{name}", method["policy"], method["fusion"]
        if name in taken:
            raise UserError(f"{key}: the name is taken by a method; choose another")
        _check_names(key, {k: v for k, v in method.items() if v != SELECTED})
        if policy == SINGLE:
            raise UserError(f"{key}.policy={SINGLE}: it takes no second view")
        if SELECTED in (policy, fusion) and not selectable(extensions):
            raise UserError(f"{key}: no extension can be selected")
        if fusion in OF_DISTRIBUTIONS:
            _check_distributions(key, method, gives_distributions)
        elif policy == ORACLE and fusion == "posterior":
            policies = {m["policy"] for m in extensions.values() if m["fusion"] == fusion}
            if policies <= {ORACLE, SELECTED}:
                raise UserError(f"{key}: no other extension fuses by {fusion}")


def _check_names(key: str, method: Mapping[str, Any]) -> None:
    try:
        if "policy" in method:
            needs_lookup(method["policy"])
        named("fusion", method.get("fusion", "average"), FUSIONS)
    except UserError as error:
        raise error.about(key) from error


def _check_distributions(key: str, method: Mapping[str, Any], gives_distributions: bool) -> None:
    policy, fusion = method["policy"], method["fusion"]
    if not gives_distributions:
        raise UserError(
            f"{key}.fusion={fusion}: this estimator gives no distributions of the azimuth; "
            "choose estimator=classifier, which does"
        )
    if policy in (SELECTED, *FOR_ESTIMATES):
        known = [name for name in POLICIES if name not in FOR_ESTIMATES]
        raise UserError(
            f"{key}.policy={policy}: it is not defined for distributions; choose {', '.join(known)}"
        )
