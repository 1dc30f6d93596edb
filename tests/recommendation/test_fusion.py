from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from nbv.angles import circular_distance_deg
from nbv.recommendation import fusion

angle = st.integers(0, 3599).map(lambda tenths: tenths / 10)
turn = st.integers(0, 359)


@given(angle, angle, turn, turn)
def test_averaging_turns_with_the_object(first, second, delta, k):
    before = fusion.average(first, second, delta)
    after = fusion.average(first + k, second + k, delta)
    antipodal = circular_distance_deg(first, second - delta) > 180 - 1e-6
    assert antipodal or circular_distance_deg(before + k, after) < 1e-6


@given(angle, turn)
def test_two_right_answers_give_the_right_pose(pose, delta):
    assert circular_distance_deg(fusion.average(pose, pose + delta, delta), pose) < 1e-9


@given(angle, angle, turn)
def test_the_mean_lies_half_way_between_the_two_the_shorter_way(first, second, delta):
    fused = fusion.average(first, second, delta)
    apart = circular_distance_deg(first, second - delta)
    if apart < 180 - 1e-6:
        assert abs(circular_distance_deg(fused, first) - apart / 2) < 1e-6
        assert abs(circular_distance_deg(fused, second - delta) - apart / 2) < 1e-6


def test_antipodal_answers_fall_back_on_the_first():
    assert fusion.average(10.0, 250.0, 60) == 10.0


def test_second_looks_wrap_round():
    estimate = np.arange(24.0).reshape(2, 12)  # 12 views, 30 degrees apart
    delta = np.array([[330] * 12, [60] * 12])
    seen = fusion.second_look(estimate, delta)
    np.testing.assert_array_equal(seen[0], np.roll(estimate[0], 1))
    np.testing.assert_array_equal(seen[1], np.roll(estimate[1], -2))
