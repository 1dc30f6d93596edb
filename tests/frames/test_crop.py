"""The crop of a frame is what training would have shown of the same object."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from frame_images import TRAINING, frame, wanted_codes
from nbv.data.camera import Camera, viewpoint_frames
from nbv.data.depth_codes import STEP, ZERO_CODE
from nbv.errors import FrameError
from nbv.frames.crop import BEHIND_SURFACE, crop_frame, pixel_step
from nbv.frames.intrinsics import Intrinsics

DIAGONAL_M = 0.125
FOCAL = Intrinsics(575.0, 575.0)
SIDE = TRAINING.image_side


def cropped(
    depth_m, *, intrinsics=FOCAL, diagonal_m=DIAGONAL_M, mask=None, camera=TRAINING, **more
):
    depth_m = np.asarray(depth_m, dtype=np.float32)
    mask = depth_m > 0 if mask is None else mask
    return crop_frame(depth_m, mask, intrinsics, camera, diagonal_m, **more)


def bowl(rows=60, columns=80, radius=20, row=30, column=40, near=0.6, seed=0):
    """A rough bump in the middle of an otherwise empty frame, metres."""
    down, across = np.mgrid[:rows, :columns]
    apart = np.hypot(down - row, across - column) / radius
    rough = np.random.default_rng(seed).uniform(0, 0.01, (rows, columns))
    return np.where(apart < 1, near + 0.05 * apart**2 + rough, 0).astype(np.float32)


# Against the renderer


def overlap(one, other):
    return np.count_nonzero(one & other) / np.count_nonzero(one | other)


@pytest.mark.parametrize("elevation", [0.0, 20.0])
@pytest.mark.parametrize("azimuth", [0.0, 77.0, 200.0, 270.0])
@pytest.mark.parametrize(
    ("distance", "across", "up"), [(4.0, 0.0, 0.0), (5.0, 0.5, -0.3), (6.0, -0.9, 0.4)]
)
def test_a_frame_gives_the_codes_of_the_training_camera(elevation, azimuth, distance, across, up):
    """From farther away, with four times the focal length, and off the middle of the frame."""
    place = (elevation, azimuth, distance)
    depth = frame(*place, across=across, up=up)
    codes = cropped(depth * DIAGONAL_M).codes
    wanted = wanted_codes(*place, across=across, up=up)
    seen, drawn = codes > 0, wanted > 0
    assert overlap(seen, drawn) > 0.92
    # They differ along the outline alone, by one pixel.
    edge = ndimage.binary_dilation(drawn) & ~ndimage.binary_erosion(drawn)
    assert np.count_nonzero((seen != drawn) & ~edge) <= 2
    inside = ndimage.binary_erosion(seen & drawn)
    apart = np.abs(codes.astype(int) - wanted)[inside]
    assert np.median(apart) <= 1
    assert np.quantile(apart, 0.9) <= 2


@given(
    elevation=st.floats(0, 60),
    azimuth=st.floats(0, 360),
    distance=st.floats(4, 7),
    across=st.floats(-0.5, 0.5),
    up=st.floats(-0.2, 0.2),
)
@settings(max_examples=40, deadline=None)
def test_the_object_is_where_it_was_drawn(elevation, azimuth, distance, across, up):
    depth = frame(elevation, azimuth, distance, across=across, up=up) * DIAGONAL_M
    camera = Intrinsics(575.0, 575.0, 159.5, 119.5)
    drawn = DIAGONAL_M * np.array([across, -up, distance])
    assert np.linalg.norm(cropped(depth, intrinsics=camera).centre_m - drawn) < 0.25 * DIAGONAL_M
    assert cropped(depth).centre_m is None


def seen_from(elevation, azimuth, distance, across, up):
    """Elevation, azimuth and distance of a camera that is directed at the object from there."""
    right, above, forward = (axes[0] for axes in viewpoint_frames(elevation, [azimuth]))
    x, y, z = -distance * forward - across * right - up * above
    away = math.sqrt(x**2 + y**2 + z**2)
    return math.degrees(math.asin(z / away)), math.degrees(math.atan2(y, x)), away


@pytest.mark.parametrize("azimuth", [0.0, 77.0, 200.0, 270.0])
@pytest.mark.parametrize(("across", "up"), [(0.9, 0.0), (-0.9, 0.4), (0.0, -0.6)])
def test_an_object_off_the_axis_is_seen_as_by_a_camera_directed_at_it(azimuth, across, up):
    """Up to 11 degrees off. A level camera stays upright in the shortest rotation to the object."""
    place = (0.0, azimuth, 5.0)
    known = Intrinsics(575.0, 575.0, 159.5, 119.5)
    codes = cropped(frame(*place, across=across, up=up) * DIAGONAL_M, intrinsics=known).codes
    wanted = wanted_codes(*seen_from(*place, across, up))
    assert overlap(codes > 0, wanted > 0) > 0.92
    inside = ndimage.binary_erosion((codes > 0) & (wanted > 0))
    apart = np.abs(codes.astype(int) - wanted)[inside]
    assert np.median(apart) <= 1
    assert np.quantile(apart, 0.9) <= 3
    # Without the principal point it is not.
    aslant = cropped(frame(*place, across=across, up=up) * DIAGONAL_M).codes
    inside = ndimage.binary_erosion((aslant > 0) & (wanted > 0))
    assert np.abs(aslant.astype(int) - wanted)[inside].mean() > 1.5 * apart.mean()


def test_a_rotated_object_does_not_give_the_same_codes():
    """The bounds above would notice a rotation of 20 degrees, or a mirror."""
    codes = cropped(frame(20.0, 0.0, 5.0) * DIAGONAL_M).codes
    rotated = [wanted_codes(20.0, azimuth, 5.0) for azimuth in (-20.0, 20.0, 180.0)]
    for wrong in (*rotated, codes[:, ::-1], codes[::-1]):
        inside = ndimage.binary_erosion((codes > 0) & (wrong > 0))
        apart = np.abs(codes.astype(int) - wrong)[inside]
        assert np.quantile(apart, 0.9) > 2 or overlap(codes > 0, wrong > 0) < 0.92


# Exact identities


def test_every_pixel_is_the_nearest_of_the_frame():
    """By a search over all pixels of the frame, for each pixel of the crop."""
    depth = bowl()
    intrinsics = Intrinsics(150.0, 170.0)
    found = cropped(depth, intrinsics=intrinsics)
    rows, columns = np.flatnonzero(depth.any(axis=1)), np.flatnonzero(depth.any(axis=0))
    middle = (rows[0] + rows[-1]) / 2, (columns[0] + columns[-1]) / 2
    distance = np.median(depth[depth > 0])
    away = distance + BEHIND_SURFACE * DIAGONAL_M
    length = TRAINING.distance / TRAINING.focal_px * DIAGONAL_M
    offsets = (np.arange(SIDE) - (SIDE - 1) / 2) * length / away
    sampled = np.zeros((SIDE, SIDE))
    for i, down in enumerate(offsets):
        row = np.abs(np.arange(depth.shape[0]) - (middle[0] + down * 170.0))
        for j, right in enumerate(offsets):
            column = np.abs(np.arange(depth.shape[1]) - (middle[1] + right * 150.0))
            if row.min() <= 0.5 and column.min() <= 0.5:
                sampled[i, j] = depth[row.argmin(), column.argmin()]
    seen = sampled > 0
    assert np.array_equal(found.codes > 0, seen)
    steps = (np.median(sampled[seen]) - sampled) / DIAGONAL_M / STEP
    assert np.abs(found.codes[seen] - (ZERO_CODE + steps[seen])).max() < 0.51
    assert found.distance_m == pytest.approx(distance)
    width, height = len(columns) * distance / 150.0, len(rows) * distance / 170.0
    assert found.extent_m == pytest.approx(math.hypot(width, height))


@given(power=st.integers(-6, 6), seed=st.integers(0, 10**6))
def test_size_and_unit_scaled_alike_leave_the_codes_alone(power, seed):
    depth, unit = bowl(seed=seed), 2.0**power
    one = cropped(depth, intrinsics=Intrinsics(150.0, 150.0))
    other = cropped(
        depth * np.float32(unit), intrinsics=Intrinsics(150.0, 150.0), diagonal_m=DIAGONAL_M * unit
    )
    assert np.array_equal(one.codes, other.codes)
    assert other.distance_m == pytest.approx(one.distance_m * unit)
    assert other.extent_m == pytest.approx(one.extent_m * unit)


@pytest.mark.parametrize("by", [(2, 2), (4, 4), (1, 2), (4, 1)])
def test_pixels_that_are_divided_leave_the_codes_alone(by):
    depth = bowl()
    one = cropped(depth, intrinsics=Intrinsics(150.0, 150.0))
    finer = np.repeat(np.repeat(depth, by[0], axis=0), by[1], axis=1)
    other = cropped(finer, intrinsics=Intrinsics(150.0 * by[1], 150.0 * by[0]))
    assert np.array_equal(one.codes, other.codes)
    assert other.extent_m == pytest.approx(one.extent_m)


@given(row=st.integers(21, 38), column=st.integers(21, 58))
def test_it_does_not_matter_where_in_the_frame_the_object_lies(row, column):
    wide = Intrinsics(150.0, 150.0)
    one = cropped(bowl(), intrinsics=wide)
    moved = np.roll(bowl(), (row - 30, column - 40), axis=(0, 1))
    other = cropped(moved, intrinsics=wide)
    assert np.array_equal(one.codes, other.codes)
    assert (one.distance_m, one.extent_m) == (other.distance_m, other.extent_m)


@given(offset=st.floats(-0.2, 1.0))
def test_an_offset_along_the_axis_only_changes_the_scale(offset):
    """A focal length that grows with the distance of the object's middle makes up for it."""
    depth = bowl()
    away = float(np.median(depth[depth > 0])) + BEHIND_SURFACE * DIAGONAL_M
    one = cropped(depth, intrinsics=Intrinsics(150.0, 150.0))
    farther = np.where(depth > 0, depth + np.float32(offset), 0)
    focal = 150.0 * (away + offset) / away
    other = cropped(farther, intrinsics=Intrinsics(focal, focal))
    seen = (one.codes > 0) & (other.codes > 0)
    assert np.count_nonzero((one.codes > 0) != (other.codes > 0)) <= 8
    apart = np.abs(one.codes.astype(int) - other.codes)[seen]
    # Places and depths may round the other way.
    assert np.quantile(apart, 0.95) <= 1


@given(seed=st.integers(0, 10**6))
def test_what_lies_outside_the_mask_does_not_matter(seed):
    depth, wide = bowl(), Intrinsics(150.0, 150.0)
    rng = np.random.default_rng(seed)
    clutter = np.where(depth > 0, depth, rng.uniform(0, 3, depth.shape)).astype(np.float32)
    one, other = cropped(depth, intrinsics=wide), cropped(clutter, intrinsics=wide, mask=depth > 0)
    assert np.array_equal(one.codes, other.codes)


@given(quarters=st.integers(0, 3), flip=st.booleans())
def test_a_frame_that_is_held_otherwise_gives_the_crop_held_so(quarters, flip):
    """An even number of rows and columns: with an odd one the middle lies between pixels."""
    depth = bowl(row=29.5, column=39.5)
    wide = Intrinsics(150.0, 150.0)

    def held(image):
        return np.rot90(image[:, ::-1] if flip else image, quarters)

    one, other = cropped(depth, intrinsics=wide), cropped(held(depth), intrinsics=wide)
    assert np.array_equal(held(one.codes), other.codes)


@settings(max_examples=30)
@given(side=st.sampled_from([16, 33, 64, 96]), fov=st.floats(15.0, 40.0))
def test_the_crop_has_the_pixels_of_the_training_camera(side, fov):
    camera = Camera(distance=3.0, fov_deg=fov, image_side=side)
    found = cropped(bowl(), intrinsics=Intrinsics(150.0, 150.0), camera=camera)
    assert found.codes.shape == (side, side)
    assert found.codes.dtype == np.uint8
    assert pixel_step(camera) == pytest.approx(2 * 3.0 * math.tan(math.radians(fov) / 2) / side)
    across_m = np.count_nonzero(found.codes.any(axis=0)) * pixel_step(camera) * DIAGONAL_M
    # The bump is 39 pixels wide at 0.68 m, half a diagonal behind its surface; less where it does
    # not fit.
    wanted = 39 / 150.0 * (found.distance_m + BEHIND_SURFACE * DIAGONAL_M)
    wanted = min(wanted, side * pixel_step(camera) * DIAGONAL_M)
    assert across_m == pytest.approx(wanted, abs=1.1 * pixel_step(camera) * DIAGONAL_M)


# Refusals


def refused(name: str, *arguments, **options) -> str:
    with pytest.raises(FrameError) as error:
        cropped(*arguments, **options)
    assert error.value.name == name
    assert "\n" not in str(error.value)
    return str(error.value)


def factors_of(message: str) -> list[str]:
    return message.partition("depths ")[2].partition(" times as large")[0].split(" or ")


WIDE, NARROW = Intrinsics(150.0, 150.0), Intrinsics(200.0, 200.0)


def test_a_mask_without_a_pixel_is_called_empty():
    nothing = np.zeros((60, 80), dtype=bool)
    with pytest.raises(FrameError, match="no pixel") as error:
        crop_frame(np.ones((60, 80), np.float32), nothing, WIDE, TRAINING, DIAGONAL_M)
    assert error.value.name == "empty-mask"


@pytest.mark.parametrize(
    ("row", "column", "border"),
    [(19, 40, "top"), (40, 40, "bottom"), (30, 19, "left"), (30, 60, "right")],
)
def test_an_object_that_is_cut_off_is_refused(row, column, border):
    depth = bowl(row=row, column=column)
    message = refused("mask-at-border", depth, intrinsics=WIDE)
    assert f"touches the {border} border" in message
    inward = np.roll(depth, {"top": 1, "bottom": -1}.get(border, 0), axis=0)
    inward = np.roll(inward, {"left": 1, "right": -1}.get(border, 0), axis=1)
    cropped(inward, intrinsics=WIDE)


def test_a_mask_that_covers_the_frame_is_not_told_to_give_far():
    depth = np.full((60, 80), 0.6, dtype=np.float32)
    message = refused("mask-at-border", depth, intrinsics=WIDE, is_given=True)
    assert "the mask touches the top and bottom and left and right border" in message
    assert "covers 100 % of it: mask only the object" in message
    assert "far_m" not in message


def test_a_size_that_is_not_plausible_doubts_a_given_mask_before_the_unit():
    depth = frame(20.0, 200.0, 4.5) * DIAGONAL_M * 4
    for is_given in (False, True):
        message = refused("implausible-size", depth, extent_m=EXTENT_M, is_given=is_given)
        assert ("does the mask hold the object alone?" in message) == is_given
        assert "0.25" in factors_of(message)


def test_every_border_that_cuts_the_object_is_named():
    depth = np.full((60, 80), 0.6, dtype=np.float32)
    message = refused("mask-at-border", depth, intrinsics=WIDE)
    assert "top and bottom and left and right" in message


def test_a_narrow_frame_was_cropped_already():
    """Its object may touch the border, as in the crops of many data sets."""
    depth = bowl(row=19, column=40)
    assert math.degrees(2 * math.atan(40 / 200.0)) < 25 < math.degrees(2 * math.atan(40 / 150.0))
    assert cropped(depth, intrinsics=NARROW).codes.any()
    assert not any("border" in doubt for doubt in cropped(depth, intrinsics=NARROW).doubts)
    full = cropped(np.full((60, 80), 0.6, dtype=np.float32), intrinsics=NARROW)
    assert full.codes.any()
    assert any("up to its border" in doubt for doubt in full.doubts)
    # What is high and narrow is no narrow frame.
    tall = Intrinsics(200.0, 100.0)
    refused("mask-at-border", depth, intrinsics=tall)


def test_beyond_a_narrow_frame_there_is_nothing():
    """Its border is not repeated to fill the crop."""
    full = np.full((20, 30), 0.6, dtype=np.float32)
    found = cropped(full, intrinsics=NARROW)
    away = 0.6 + BEHIND_SURFACE * DIAGONAL_M
    per_metre = 1 / (pixel_step(TRAINING) * DIAGONAL_M)
    rows, columns = (np.count_nonzero((found.codes > 0).any(axis=axis)) for axis in (1, 0))
    assert rows == pytest.approx(20 / 200.0 * away * per_metre, abs=1)
    assert columns == pytest.approx(30 / 200.0 * away * per_metre, abs=1)
    assert columns < SIDE


# What a mug is to the training: 5 diagonals away, and 0.8 to 1.1 across.
EXTENT_M = (0.5 * DIAGONAL_M, 1.5 * DIAGONAL_M)


@pytest.mark.parametrize(
    "unit",
    [1000.0, 10_000.0, 5000.0, 4000.0, 100.0, 10.0, 8.0, 5.0, 0.1, 0.01, 0.001, 0.00025, 0.0001],
)
def test_a_wrong_unit_is_named(unit):
    """Depths in another unit than metres: the message says what to multiply them by."""
    depth = frame(20.0, 200.0, 5.0) * DIAGONAL_M
    cropped(depth, extent_m=EXTENT_M)
    message = refused("implausible-distance", depth * unit, extent_m=EXTENT_M)
    assert f"{1 / unit:g}" in factors_of(message)


@pytest.mark.parametrize(("times", "is_told"), [(0.5, True), (0.8, False), (1, False), (2, True)])
def test_a_size_near_its_limits_is_doubted(times, is_told):
    """Half or twice the true unit gives a size that is plausible but unusual."""
    depth = frame(20.0, 200.0, 5.0) * DIAGONAL_M
    extent = cropped(depth).extent_m
    found = cropped(depth * times, extent_m=(0.45 * extent, 2.2 * extent))
    assert len(found.doubts) == is_told


def test_quarters_of_a_millimetre_may_be_at_a_plausible_distance():
    """Four times as far is not too far, but then the object is too large."""
    depth = frame(20.0, 200.0, 4.5) * DIAGONAL_M
    message = refused("implausible-size", depth * 4, extent_m=EXTENT_M)
    assert "0.25" in factors_of(message)


@pytest.mark.parametrize(
    ("distance", "plausible"), [(1.4, False), (1.6, True), (19.5, True), (21, False)]
)
def test_distances_are_plausible_in_diagonals(distance, plausible):
    depth = np.zeros((60, 80), dtype=np.float32)
    depth[20:40, 30:50] = distance * DIAGONAL_M
    if plausible:
        assert cropped(depth, intrinsics=WIDE).distance_m == pytest.approx(distance * DIAGONAL_M)
    else:
        message = refused("implausible-distance", depth, intrinsics=WIDE)
        assert "m are plausible" in message


def test_an_object_of_another_size_is_refused():
    depth = frame(20.0, 200.0, 5.0) * DIAGONAL_M
    for extent_m in ((1.3 * DIAGONAL_M, 2 * DIAGONAL_M), (0.1 * DIAGONAL_M, 0.5 * DIAGONAL_M)):
        message = refused("implausible-size", depth, extent_m=extent_m)
        assert "mask only the object" in message
        assert "`depth_scale`" not in message


def test_intrinsics_of_another_resolution_are_refused():
    depth = bowl()
    cropped(depth, intrinsics=Intrinsics(150.0, 150.0, width=80, height=60))
    refused("other-resolution", depth, intrinsics=Intrinsics(150.0, 150.0, width=160, height=120))
    refused("other-resolution", depth, intrinsics=Intrinsics(150.0, 150.0, 320.0, 240.0))
