"""Every public name has an example in its docstring, and every example prints what it shows."""

import doctest

import pytest

import nbv

FINDER = doctest.DocTestFinder(exclude_empty=True)


@pytest.mark.parametrize("name", nbv.__all__)
def test_each_public_name_has_an_example_that_runs(name):
    tests = FINDER.find(getattr(nbv, name), name, globs={})
    assert any(test.examples for test in tests)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    for test in tests:
        assert runner.run(test).failed == 0
