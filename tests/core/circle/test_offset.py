"""The constant offset of errors around the circle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.offset import constant_offset_deg, frame_warning

ERRORS = st.lists(st.floats(-1000.0, 1000.0), min_size=1, max_size=12)


def mae(errors, offset):
    return circular_distance_deg(errors, offset).mean()


@given(errors=ERRORS, other=st.floats(-180.0, 180.0))
def test_no_other_offset_leaves_a_smaller_mean_absolute_error(errors, other):
    offset = constant_offset_deg(errors)
    assert -180.0 <= offset < 180.0
    assert mae(errors, offset) <= min(mae(errors, one) for one in (other, *errors)) + 1e-9


@given(errors=st.lists(st.floats(-89.0, 89.0), min_size=1, max_size=12))
def test_within_half_a_turn_it_is_the_median(errors):
    assert constant_offset_deg(errors) == pytest.approx(np.median(errors), abs=1e-9)


@given(errors=st.lists(st.floats(-40.0, 40.0), min_size=1, max_size=12), shift=st.floats(-720, 720))
def test_it_moves_with_all_errors(errors, shift):
    moved = constant_offset_deg(np.array(errors) + shift)
    assert circular_distance_deg(moved, constant_offset_deg(errors) + shift) < 1e-6


@pytest.mark.parametrize(
    ("change", "plane_deg", "cause"),
    [
        (lambda azimuth: azimuth, 90.0, None),
        (lambda azimuth: 180 - azimuth, 90.0, "(frames mirrored?)"),
        (lambda azimuth: 20 - azimuth, 90.0, "(sign flipped?)"),
        (lambda azimuth: 90 - azimuth, 90.0, "(sign flipped, or frames mirrored?)"),
        (lambda azimuth: 180 - azimuth, None, "(sign flipped, or frames mirrored?)"),
        # About a plane at 0 a mirrored image is that of the opposite sign.
        (lambda azimuth: -azimuth, 180.0, "(sign flipped, or frames mirrored?)"),
    ],
)
def test_mirrored_frames_and_a_wrong_sign_differ_where_the_origin_is_known(
    change, plane_deg, cause
):
    azimuth_deg = np.arange(0.0, 360.0, 15.0)
    warning = frame_warning(azimuth_deg, change(azimuth_deg), plane_deg)
    assert cause in warning if cause else not warning
