"""Which pixels are the object's: given, between two distances, or nearest to the camera."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nbv.errors import FrameError, UserError
from nbv.frames.masks import object_mask

ROWS, COLUMNS = 48, 64
REACH = 0.1
# A square of 20 × 20 pixels before a wall.
SQUARE = np.s_[10:30, 12:32]
NEAR, WALL = 0.6, 1.5


def box(*slices) -> np.ndarray:
    mask = np.zeros((ROWS, COLUMNS), dtype=bool)
    for part in slices:
        mask[part] = True
    return mask


def scene(background: float = WALL) -> np.ndarray:
    depth = np.full((ROWS, COLUMNS), background, dtype=np.float32)
    depth[SQUARE] = NEAR
    return depth


def refused(name: str, *arguments, **options) -> str:
    with pytest.raises(FrameError) as error:
        object_mask(*arguments, **options)
    assert error.value.name == name
    return str(error.value)


# A mask that is given


@given(data=st.data())
def test_a_given_mask_keeps_what_was_measured(data):
    depth, given_mask = scene(), box(SQUARE)
    for _ in range(data.draw(st.integers(0, 20))):
        row, column = data.draw(st.integers(10, 29)), data.draw(st.integers(12, 31))
        depth[row, column] = 0
    found = object_mask(depth, REACH, given_mask)
    # Holes leave no part of the square that is cut off from the rest: 20 pixels enclose little.
    assert not found[~given_mask].any()
    assert not found[depth == 0].any()
    assert np.count_nonzero(found) >= np.count_nonzero(given_mask & (depth > 0)) - 8


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.int64, np.float32])
def test_a_given_mask_is_what_is_not_0(dtype):
    found = object_mask(scene(), REACH, 3 * box(SQUARE).astype(dtype))
    assert np.array_equal(found, box(SQUARE))


def test_a_given_mask_may_hold_what_is_far_away():
    """It says what the object is: its reach does not matter."""
    wall = np.s_[35:45, 40:60]
    assert np.array_equal(object_mask(scene(), REACH, box(wall)), box(wall))
    both = box(np.s_[10:30, 12:50])
    assert np.array_equal(object_mask(scene(), REACH, both), both)


def test_a_given_mask_may_be_limited_as_well():
    both = box(np.s_[10:30, 12:50])
    assert np.array_equal(object_mask(scene(), REACH, both, far_m=1.0), box(SQUARE))
    behind = object_mask(scene(), REACH, both, near_m=1.0)
    assert np.array_equal(behind, box(np.s_[10:30, 32:50]))


def test_neither_frame_nor_mask_is_changed():
    depth, mask = scene(), box(SQUARE, np.s_[40:42, 50:52])
    before = depth.copy(), mask.copy()
    object_mask(depth, REACH, mask)
    object_mask(depth, REACH)
    assert np.array_equal(depth, before[0])
    assert np.array_equal(mask, before[1])


def test_a_mask_of_a_few_pixels_is_refused():
    assert "29 pixels" in refused("empty-mask", scene(), REACH, box(np.s_[5:6, 5:34]))
    assert object_mask(scene(), REACH, box(np.s_[5:6, 5:35])).sum() == 30


@pytest.mark.parametrize("measured", [0, 1, 60, 198, 199])
def test_a_mask_with_little_depth_is_refused(measured):
    depth = scene()
    depth[SQUARE] = 0
    rows = np.arange(measured)
    depth[10 + rows // 20, 12 + rows % 20] = NEAR
    message = refused("little-depth", depth, REACH, box(SQUARE))
    assert "need 50 %" in message


def test_half_of_a_mask_is_enough():
    depth = scene()
    depth[SQUARE] = 0
    depth[10:20, 12:32] = NEAR
    assert np.array_equal(object_mask(depth, REACH, box(SQUARE)), box(np.s_[10:20, 12:32]))


@pytest.mark.parametrize("shape", [(COLUMNS, ROWS), (ROWS, COLUMNS - 1)])
def test_a_mask_of_another_size_is_refused(shape):
    with pytest.raises(UserError, match="64 × 48"):
        object_mask(scene(), REACH, np.ones(shape))


@pytest.mark.parametrize("shape", [(ROWS,), (2, 1, ROWS, COLUMNS)])
def test_a_mask_has_rows_and_columns(shape):
    with pytest.raises(
        UserError, match=f"mask: {len(shape)} axes; a mask has two, rows and columns"
    ):
        object_mask(scene(), REACH, np.ones(shape))


@pytest.mark.parametrize("axis", [0, 2])
def test_of_several_masks_one_is_given_unless_all_are_alike(axis):
    square = box(SQUARE)
    for n in (1, 3):
        alike = np.stack([square] * n, axis=axis)
        for given_mask in (alike, alike[None]):
            assert np.array_equal(object_mask(scene(), REACH, given_mask), square)
    instances = np.stack([square, ~square, square], axis=axis)
    with pytest.raises(UserError, match="3 masks of 64 × 48 pixels; which of them"):
        object_mask(scene(), REACH, instances)


@pytest.mark.parametrize("options", [{}, {"far_m": 1.0}, {"mask": np.ones((ROWS, COLUMNS))}])
def test_a_frame_without_any_depth_says_so(options):
    message = refused("empty-mask", np.zeros_like(scene()), REACH, **options)
    assert "the frame has no depth at all" in message


# Between two distances


def test_the_object_lies_between_near_and_far():
    depth = scene()
    depth[35:45, 40:60] = 1.0
    assert np.array_equal(object_mask(depth, REACH, far_m=0.8), box(SQUARE))
    assert np.array_equal(
        object_mask(depth, REACH, near_m=0.8, far_m=1.2), box(np.s_[35:45, 40:60])
    )


def test_the_limits_themselves_are_between_them():
    depth = scene()
    near = float(depth[15, 15])
    assert np.array_equal(object_mask(depth, REACH, near_m=near, far_m=1.0), box(SQUARE))
    assert np.array_equal(object_mask(depth, REACH, near_m=0.1, far_m=near), box(SQUARE))


def test_near_alone_takes_the_nearest_beyond_it():
    depth = scene()
    depth[0:5, 0:20] = 0.2
    assert np.array_equal(object_mask(depth, REACH, near_m=0.3), box(SQUARE))


def test_far_alone_does_not_limit_the_reach():
    depth = scene()
    depth[30:40, 12:32] = NEAR + 5 * REACH
    assert np.array_equal(object_mask(depth, REACH, far_m=1.2), box(np.s_[10:40, 12:32]))


def test_nothing_between_them_is_an_empty_mask():
    assert "0 pixels" in refused("empty-mask", scene(), REACH, near_m=0.7, far_m=1.4)
    refused("empty-mask", scene(), REACH, near_m=2.0)


@pytest.mark.parametrize(
    "limits", [(-0.1, 1.0), (1.0, 1.0), (2.0, 1.0), (float("nan"), 1.0), (0.5, float("nan"))]
)
def test_limits_are_a_range(limits):
    with pytest.raises(UserError, match="near < far"):
        object_mask(scene(), REACH, near_m=limits[0], far_m=limits[1])


# What lies nearest


def test_the_object_is_what_lies_nearest():
    assert np.array_equal(object_mask(scene(), REACH), box(SQUARE))
    assert np.array_equal(object_mask(scene(background=0.0), REACH), box(SQUARE))


@given(slope=st.floats(0.0, 0.9), unit=st.sampled_from([0.25, 1.0, 8.0]))
def test_it_reaches_as_far_as_it_is_said_to(slope, unit):
    depth = scene()
    depth[SQUARE] = NEAR + slope * REACH * np.linspace(0, 1, 20, dtype=np.float32)
    assert np.array_equal(object_mask(depth * np.float32(unit), REACH * unit), box(SQUARE))


@pytest.mark.parametrize("amount", [1, 5, 12])
def test_single_pixels_before_the_object_are_noise(amount):
    depth = scene(background=0.0)
    rng = np.random.default_rng(amount)
    # Fewer than 2 % of what was measured: 400 pixels and the noise.
    places = rng.choice(np.flatnonzero(depth == 0), min(amount, 7), replace=False)
    depth.flat[places] = 0.2
    found = object_mask(depth, REACH)
    assert found[SQUARE].all()


def test_a_few_near_pixels_are_no_object():
    """Thirty pixels have to be the object's own, not those of the wall behind it."""
    depth = np.full((ROWS, COLUMNS), WALL, dtype=np.float32)
    depth[:, 24:] = 0
    depth[4:8, 4:11] = NEAR
    assert "28 pixels" in refused("empty-mask", depth, REACH)
    depth[8, 4:6] = NEAR
    assert object_mask(depth, REACH).sum() == 30


# Parts


def test_two_objects_are_refused():
    depth = scene()
    depth[15:25, 40:60] = NEAR
    message = refused("two-objects", depth, REACH)
    assert "400 and 200 pixels" in message
    refused("two-objects", scene(), REACH, box(SQUARE, np.s_[15:25, 40:60]))
    assert object_mask(depth, REACH, box(SQUARE)).sum() == 400


def test_a_part_that_is_smaller_is_of_the_object():
    """A handle that the sensor cuts off from the cup."""
    handle = np.s_[15:25, 40:59]
    assert np.array_equal(object_mask(scene(), REACH, box(SQUARE, handle)), box(SQUARE, handle))


@pytest.mark.parametrize(("width", "kept"), [(7, False), (8, True), (30, True)])
def test_islands_are_dropped(width, kept):
    island = np.s_[40:41, 20 : 20 + width]
    found = object_mask(scene(), REACH, box(SQUARE, island))
    assert np.array_equal(found, box(SQUARE, island) if kept else box(SQUARE))


def test_pixels_that_touch_at_a_corner_are_one_part():
    corner = np.s_[30:50, 32:52]
    mask = box(SQUARE, corner)
    assert np.array_equal(object_mask(scene(), REACH, mask), mask)


@given(quarters=st.integers(0, 3), flip=st.booleans(), seed=st.integers(0, 10**6))
def test_it_does_not_matter_how_the_frame_is_held(quarters, flip, seed):
    rng = np.random.default_rng(seed)
    depth = scene()
    depth[rng.random(depth.shape) < 0.1] = 0
    depth[40:42, 3:6] = NEAR

    def held(image):
        return np.rot90(image[:, ::-1] if flip else image, quarters)

    assert np.array_equal(object_mask(held(depth), REACH), held(object_mask(depth, REACH)))
