"""Every public docstring has an example, which runs and prints what it says."""

from __future__ import annotations

import doctest
import functools
import inspect
from collections.abc import Iterator

import pytest

import nbv


def documented() -> Iterator[tuple[str, object]]:
    """Each public name, and each method and property that a public class defines."""
    for name in nbv.__all__:
        public = getattr(nbv, name)
        yield name, public
        if not inspect.isclass(public):
            continue
        for member, value in vars(public).items():
            if isinstance(value, property):
                value = value.fget
            elif isinstance(value, functools.cached_property):
                value = value.func
            elif isinstance(value, classmethod | staticmethod):
                value = value.__func__
            if inspect.isfunction(value) and not member.startswith("_"):
                yield f"{name}.{member}", value


@pytest.mark.parametrize(("name", "public"), list(documented()))
def test_each_public_docstring_has_an_example_that_runs(name, public):
    text = inspect.getdoc(public)
    assert text
    test = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert test.examples
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    assert runner.run(test).failed == 0


def test_methods_and_properties_are_found():
    names = {name for name, _ in documented()}
    assert {"Recommender.load", "Recommendation.moves", "Evidence.moments"} <= names
