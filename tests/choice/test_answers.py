"""The decision of an answer: enough, one more view, or no view helps."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.choice.answers import Answer, RankedMove
from nbv.errors import UserError

P = st.floats(0.0, 1.0)
LIMIT = st.none() | st.sampled_from([0.1, 0.5, 0.9, 0.99])


class Stop(Answer[RankedMove]):
    STOP_PROBABILITY, STOP_WITHIN_DEG = 0.9, 15.0


class Turn(RankedMove):
    name = "turn"


def answer(error=4.0, probabilities=(0.2, 0.5, 0.8), helps=True, n_moves=2):
    moves = (Turn(travel_deg=90.0, expected_error_deg=2.0),) * n_moves
    within = dict(zip(("5", "15", "30"), probabilities, strict=True))
    return Stop(expected_error_deg=error, probability_within=within, moves=moves, helps=helps)


@given(
    error=st.floats(0.0, 90.0),
    probabilities=st.lists(P, min_size=3, max_size=3),
    helps=st.sampled_from([True, False, None]),
    n_moves=st.integers(0, 2),
    until_deg=st.none() | st.floats(0.0, 90.0),
    until=LIMIT,
    place=st.integers(0, 2),
)
def test_what_is_enough_comes_first_and_then_whether_a_view_helps(
    error, probabilities, helps, n_moves, until_deg, until, place
):
    within_deg = None if until is None else (5.0, 15.0, 30.0)[place]
    found = answer(error, probabilities, helps, n_moves).decide(until_deg, until, within_deg)
    if until_deg is until is None:
        is_enough = probabilities[1] >= 0.9
    else:
        is_enough = until_deg is None or error <= until_deg
        is_enough &= until is None or probabilities[place] >= until
    others = "one more view" if n_moves and helps is not False else "no view helps"
    assert found.verdict == ("enough" if is_enough else others)
    assert ("expected error" in found.reason) == (
        until_deg is not None if is_enough else found.verdict == "one more view"
    )


def test_the_reason_has_the_numbers_that_decided():
    assert answer().decide(5.0, 0.75, 30.0).reason == "expected error 4.0°, 80% within 30°"
    assert answer(probabilities=(0, 0.999, 1)).decision.reason == ">99% within 15°"
    assert answer().decision.reason == "turn: expected error 4.0° → 2.0°"
    assert answer(n_moves=0).decision.reason != answer(helps=False).decision.reason


def test_without_an_error_there_is_no_decision():
    unknown = answer(math.nan)
    assert unknown.decision.verdict is None
    assert unknown.decision.reason
    for limits in ((5.0,), (None, 0.5)):
        with pytest.raises(UserError, match="no errors"):
            unknown.decide(*limits)


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ((None, 0.9, 10.0), "`within_deg`=10: give 5, 15, 30"),
        ((5.0, None, 5.0), "`within_deg` is for `until_probability`"),
        ((None, 1.0), "`until_probability`=1: give one between 0 and 1"),
        ((None, math.nan), "`until_probability`=nan"),
        ((math.nan,), "`until_deg`=nan: give degrees, 0 or more"),
        ((-5.0,), "`until_deg`=-5.0: give degrees, 0 or more"),
    ],
)
def test_a_limit_that_cannot_be_used_is_named(limits, message):
    with pytest.raises(UserError, match=message):
        answer().decide(*limits)
