from __future__ import annotations

from itertools import product

import pytest

from nbv.paper.statements import FAILS, HOLDS, NOT_RUN, UNDECIDED, combine


@pytest.mark.parametrize(
    ("count", "verdicts", "expected"),
    [
        (2, [HOLDS, HOLDS, FAILS], HOLDS),
        (2, [HOLDS, FAILS, FAILS], FAILS),
        (2, [HOLDS, UNDECIDED, FAILS], UNDECIDED),
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
