"""The examples in the docstrings of the public API run, and print what they say."""

from __future__ import annotations

import doctest
import inspect

import pytest

import nbv

# Shown with the function that makes or reads them, or that raises them.
SHOWN_ELSEWHERE = {"Conditionals", "Evidence", "LookupTable", "UserError", "save_lookup"}


@pytest.mark.parametrize("name", nbv.__all__)
def test_examples_of_the_public_api_run(name):
    public = getattr(nbv, name)
    found = doctest.DocTestFinder().find(public, name, module=False)
    examples = [one for one in found if one.examples]
    assert examples or name in SHOWN_ELSEWHERE
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    for one in examples:
        assert runner.run(one).failed == 0


@pytest.mark.parametrize("name", nbv.__all__)
def test_each_public_name_says_what_it_is(name):
    assert inspect.getdoc(getattr(nbv, name))
