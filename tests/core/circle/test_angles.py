import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.core.circle import angles
from nbv.errors import UserError

degrees = st.floats(-1e4, 1e4, allow_nan=False)
whole = st.integers(-1440, 1440)


def unit(angle_deg: float) -> complex:
    return cmath.rect(1.0, math.radians(angle_deg))


def test_an_angle_is_a_finite_real_number_within_the_limit():
    most = angles.MOST_DEG
    given_deg = [0, -most, most, np.nextafter(most, np.inf), -2 * most, np.nan, np.inf]
    assert angles.is_angle(given_deg).tolist() == [True] * 3 + [False] * 4
    assert angles.is_angle(np.array([[7, 8]], dtype=np.uint8)).tolist() == [[True, True]]
    for other in (["90", "east"], [True, False], [1j, 0j], [None, 1.0]):
        assert angles.is_angle(other).tolist() == [False, False]
        assert angles.is_angle(other).dtype == bool


@given(degrees)
def test_wrapping_keeps_the_direction_and_the_range(angle):
    wrapped = float(angles.wrap_deg(angle))
    assert 0.0 <= wrapped < 360.0
    assert abs(unit(wrapped) - unit(angle)) < 1e-9


@given(st.floats(-1e9, 1e9), st.integers(-3, 3))
def test_wrapping_is_the_remainder_bit_for_bit(angle, n_circles):
    near = np.nextafter(360.0 * n_circles, [-np.inf, np.inf])
    angles_deg = np.array([angle, 360.0 * n_circles, *near])
    remainder = np.mod(angles_deg, 360.0)
    expected = np.where(remainder >= 360.0, 0.0, remainder)
    assert angles.wrap_deg(angles_deg).tobytes() == expected.tobytes()
    one_by_one = np.stack([angles.wrap_deg(float(each)) for each in angles_deg])
    assert one_by_one.tobytes() == expected.tobytes()


@pytest.mark.parametrize("angle", [-1e-17, 360.0, 720.0, -360.0])
def test_wrapping_never_gives_360(angle):
    assert angles.wrap_deg(angle) == 0.0


def test_angles_in_single_precision_are_computed_in_double():
    narrow = np.float32([0.1, 359.9, 725.3])
    np.testing.assert_array_equal(angles.wrap_deg(narrow), np.mod(narrow.astype(np.float64), 360))
    assert angles.wrap_deg(narrow).dtype == np.float64
    wide, other = narrow.astype(np.float64), np.float32([359.7, 0.3, 5.1])
    for function in (angles.signed_difference_deg, angles.midpoint_deg):
        np.testing.assert_array_equal(function(narrow, other), function(wide, other.astype("f8")))


@given(degrees, degrees)
def test_signed_difference_turns_b_into_a_the_shorter_way(a, b):
    difference = float(angles.signed_difference_deg(a, b))
    assert -180.0 <= difference < 180.0
    assert abs(unit(b + difference) - unit(a)) < 1e-9


@given(degrees, degrees)
def test_distance_is_the_angle_between_unit_vectors(a, b):
    distance = float(angles.circular_distance_deg(a, b))
    chord = abs(unit(a) - unit(b))
    assert math.isclose(2 * math.sin(math.radians(distance) / 2), chord, abs_tol=1e-7)
    assert distance == pytest.approx(float(angles.circular_distance_deg(b, a)), abs=1e-9)


@given(whole, whole)
def test_midpoint_is_the_direction_of_the_sum(a, b):
    middle = float(angles.midpoint_deg(a, b))
    total = unit(a) + unit(b)
    if (a - b) % 360 == 180:
        assert middle == a % 360
    else:
        assert abs(total / abs(total) - unit(middle)) < 1e-9


@given(whole, st.sampled_from([36, 120, 360, 720]))
def test_bins_are_centred_and_roll_with_the_angle(k, n_bins):
    width = 360.0 / n_bins
    assert angles.nearest_bin(k * width, n_bins) == k % n_bins
    assert angles.nearest_bin((k - 0.499) * width, n_bins) == k % n_bins
    assert angles.nearest_bin((k + 0.499) * width, n_bins) == k % n_bins


def test_bin_edges_are_half_open():
    assert angles.nearest_bin([359.5, 0.4999, 0.5, 359.4999], 360).tolist() == [0, 0, 1, 359]


def test_travel_goes_the_shorter_way():
    np.testing.assert_array_equal(angles.travel_deg([0, 90, 180, 270, 359]), [0, 90, 180, 90, 1])


@given(st.integers(0, 59), st.sampled_from([12, 24, 60, 360]))
def test_a_mirrored_bin_is_as_far_from_the_plane_on_its_other_side(half_bins, n_bins):
    width = 360.0 / n_bins
    plane_deg = (half_bins * width / 2) % 180
    mirrored = angles.mirrored_bins(n_bins, plane_deg)
    centres = np.arange(n_bins) * width
    offset = angles.signed_difference_deg(centres, plane_deg)
    other = angles.signed_difference_deg(centres[mirrored], plane_deg)
    assert angles.circular_distance_deg(offset, -other).max() < 1e-9
    assert (mirrored[mirrored] == np.arange(n_bins)).all()


def test_a_plane_between_half_bins_is_refused():
    with pytest.raises(UserError, match=r"mirror_plane_deg=10: with 120 bins .* multiple of 1\.5"):
        angles.mirrored_bins(120, 10.0)
