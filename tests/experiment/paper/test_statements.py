from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.experiment.paper.claims import CLAIMS
from nbv.experiment.paper.statements import (
    FAILS,
    HOLDS,
    NOT_RUN,
    UNDECIDED,
    AtLeast,
    Better,
    Comparable,
    Term,
    combine,
    combine_statement,
    deciding,
    in_favour,
    interval_verdict,
    leaves,
)

TERMS = [Term(method, (("mug", 0),)) for method in ("proposed", "opposite")]


@pytest.mark.parametrize(
    ("count", "verdicts", "expected"),
    [
        (2, [HOLDS, HOLDS, NOT_RUN], HOLDS),
        (2, [NOT_RUN, FAILS, FAILS], FAILS),
        (2, [HOLDS, NOT_RUN, FAILS], NOT_RUN),
        (3, [NOT_RUN, UNDECIDED, HOLDS], NOT_RUN),
    ],
)
def test_compounds_are_decided_only_where_open_parts_cannot_matter(count, verdicts, expected):
    assert combine(count, verdicts) == expected


def test_combining_agrees_with_trying_out_every_open_part():
    for verdicts in product([HOLDS, FAILS, UNDECIDED], repeat=4):
        for count in range(1, 5):
            options = [(True, False) if v == UNDECIDED else ((v == HOLDS),) for v in verdicts]
            outcomes = {sum(choice) >= count for choice in product(*options)}
            expected = {frozenset({True}): HOLDS, frozenset({False}): FAILS}.get(
                frozenset(outcomes), UNDECIDED
            )
            assert combine(count, list(verdicts)) == expected


@given(st.data())
def test_the_deciding_comparison_has_the_verdict_of_the_claim(data):
    """Every claim of the paper, with any verdicts of its comparisons."""
    claim = data.draw(st.sampled_from(CLAIMS))
    parts = list(dict.fromkeys(leaves(claim.statement)))
    drawn = st.lists(
        st.sampled_from([HOLDS, FAILS, UNDECIDED]), min_size=len(parts), max_size=len(parts)
    )
    verdicts = dict(zip(parts, data.draw(drawn), strict=True))
    sizes = st.lists(st.floats(-9, 9), min_size=len(parts), max_size=len(parts))
    favours = dict(zip(parts, data.draw(sizes), strict=True))
    part = deciding(claim.statement, verdicts, favours)
    assert verdicts[part] == combine_statement(claim.statement, verdicts)


def test_among_equal_verdicts_the_kth_most_favoured_decides():
    parts = tuple(Better("mae", TERMS[0], Term("single", ((name, 0),))) for name in "abcd")
    favours = dict(zip(parts, (4.0, 1.0, 3.0, 2.0), strict=True))
    verdicts = dict.fromkeys(parts, HOLDS)
    for count, place in ((1, 0), (2, 2), (3, 3), (4, 1)):
        assert deciding(AtLeast(count, parts), verdicts, favours) == parts[place]


@given(st.tuples(*[st.floats(-5, 5)] * 3).map(sorted), st.sampled_from(["mae", "pauc"]))
def test_a_comparison_is_decided_where_what_favours_it_excludes_zero(ends, statistic):
    low, value, high = ends
    is_better, is_worse = (high < 0, low > 0) if statistic == "mae" else (low > 0, high < 0)
    is_inside, is_outside = low > -1 and high < 1, low > 1 or high < -1
    for part, holds, fails in (
        (Better(statistic, *TERMS), is_better, is_worse),
        (Comparable(statistic, *TERMS, 1.0), is_inside, is_outside),
    ):
        favour, least, most = in_favour(part, value, low, high)
        assert least <= favour <= most
        expected = HOLDS if holds else FAILS if fails else UNDECIDED
        assert interval_verdict(part, low, high) == expected


@given(st.tuples(*[st.floats(-5, 5)] * 2).map(sorted))
def test_the_least_and_most_that_favour_comparable_are_those_over_the_interval(ends):
    _, least, most = in_favour(Comparable("mae", *TERMS, 1.0), ends[0], *ends)
    inside = 1.0 - np.abs(np.linspace(*ends, 2001))
    assert least == pytest.approx(inside.min())
    assert most == pytest.approx(inside.max(), abs=0.003)
