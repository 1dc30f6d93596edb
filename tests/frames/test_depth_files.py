"""Depth images and masks from files: every form gives the same metres, or one line."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from scipy import ndimage

from nbv.errors import FrameError, UserError
from nbv.frames.depth_files import as_mask, read_depth, read_mask, to_metres, write_depth

MILLIMETRES = np.array([[0, 1, 400], [1234, 10000, 65534]], dtype=np.uint16)
METRES = MILLIMETRES.astype(np.float32) * np.float32(0.001)


def saved(path: Path, values) -> Path:
    np.save(path, values)
    return path


def image(path: Path, values, **options) -> Path:
    Image.fromarray(values).save(path, **options)
    return path


def pgm(path: Path, values, largest: int, comment: str = "") -> Path:
    rows, columns = values.shape
    header = f"P5\n{comment}{columns} {rows}\n{largest}\n"
    path.write_bytes(header.encode() + values.astype(">u2").tobytes())
    return path


# Every form


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, ">f4"])
def test_numbers_with_a_decimal_point_are_metres(tmp_path, dtype):
    values = np.array([[0.5, 1.25], [4.0, 0.0]], dtype=dtype)
    found = read_depth(saved(tmp_path / "a.npy", values))
    assert found.dtype == np.float32
    assert np.array_equal(found, values.astype(np.float32))


def test_what_was_not_measured_is_0(tmp_path):
    values = np.array([[np.nan, np.inf, -np.inf], [-0.5, -0.0, 0.75]])
    found = read_depth(saved(tmp_path / "a.npy", values))
    assert np.array_equal(found, [[0, 0, 0], [0, 0, 0.75]])


@pytest.mark.filterwarnings("error")
def test_numbers_beyond_single_precision_are_no_measurement():
    assert np.array_equal(to_metres(np.array([[1e300, 1.0]])), [[0, 1]])
    assert np.array_equal(to_metres(np.array([[3e38, 1.0]]), depth_scale=10.0), [[0, 10]])


@pytest.mark.parametrize("dtype", [np.uint16, ">u2", np.int32, np.uint32, np.int64])
def test_whole_numbers_are_millimetres(tmp_path, dtype):
    found = read_depth(saved(tmp_path / "a.npy", MILLIMETRES.astype(dtype)))
    assert found.dtype == np.float32
    assert np.array_equal(found, METRES)


@pytest.mark.parametrize("scale", [0.0, -0.001, float("nan"), float("inf"), 1000.0])
def test_a_depth_scale_is_metres_per_unit(scale):
    with pytest.raises(UserError, match=f"`depth_scale`={scale:g}: give metres per unit"):
        to_metres(MILLIMETRES, depth_scale=scale)


def test_negative_whole_numbers_are_no_measurement():
    found = to_metres(np.array([[-5, 5]], dtype=np.int16))
    assert found == pytest.approx(np.array([[0.0, 0.005]]), rel=1e-6)


@pytest.mark.parametrize("name", ["a.png", "a.PNG", "a.tif", "a.tiff"])
def test_images_of_16_bits_are_millimetres(tmp_path, name):
    assert np.array_equal(read_depth(image(tmp_path / name, MILLIMETRES)), METRES)


def test_tiff_images_may_hold_metres(tmp_path):
    metres = np.array([[0.5, np.nan], [2.0, -1.0]], dtype=np.float32)
    assert np.array_equal(read_depth(image(tmp_path / "a.tif", metres)), [[0.5, 0], [2, 0]])


def test_pgm_may_be_text(tmp_path):
    path = tmp_path / "a.pgm"
    path.write_text("P2 # plain\n2 1 # columns, rows\n3000\n1500 3000\n")
    assert read_depth(path) == pytest.approx(np.array([[1.5, 3.0]]))


@given(
    values=arrays(np.uint16, (2, 3), elements=st.integers(0, 300)),
    largest=st.integers(300, 65535),
    comment=st.sampled_from(["", "# CREATOR: a camera of 1999\n"]),
)
def test_every_number_of_a_pgm_comes_back(tmp_path_factory, values, largest, comment):
    path = pgm(tmp_path_factory.mktemp("pgm") / "a.pgm", values, largest, comment)
    assert np.array_equal(np.rint(read_depth(path, depth_scale=1.0)), values)


def test_what_is_written_is_read_again(tmp_path):
    metres = np.array([[0.0, 0.7504], [2.0, 65.534]], dtype=np.float32)
    for name, off in (("a.png", 0.0005), ("A.PNG", 0.0005), ("a.npy", 0.0), ("A.NPY", 0.0)):
        write_depth(tmp_path / name, metres)
        assert np.abs(read_depth(tmp_path / name) - metres).max() <= off + 1e-6
    with pytest.raises(UserError, match=r"b\.png: 65\.6 m is too far for a PNG"):
        write_depth(tmp_path / "b.png", metres + np.float32(0.1))
    assert not (tmp_path / "b.png").exists()


def test_archives_give_the_array_called_depth_or_their_only_one(tmp_path):
    other = np.ones((2, 3), dtype=np.float32)
    np.savez(tmp_path / "a.npz", colour=other, depth=MILLIMETRES)
    np.savez_compressed(tmp_path / "b.npz", whatever=MILLIMETRES)
    assert np.array_equal(read_depth(tmp_path / "a.npz"), METRES)
    assert np.array_equal(read_depth(tmp_path / "b.npz"), METRES)
    np.savez(tmp_path / "c.npz", colour=other, range=MILLIMETRES)
    with pytest.raises(UserError, match="name one of them 'depth'"):
        read_depth(tmp_path / "c.npz")


def test_a_mask_is_the_array_called_mask(tmp_path):
    np.savez(tmp_path / "a.npz", depth=MILLIMETRES, mask=INSIDE)
    assert np.array_equal(read_mask(tmp_path / "a.npz"), INSIDE)
    np.savez(tmp_path / "b.npz", depth=MILLIMETRES, scores=INSIDE)
    with pytest.raises(UserError, match="holds depth, scores: name one of them 'mask'"):
        read_mask(tmp_path / "b.npz")


@pytest.mark.parametrize("axes", [0, 2, (0, 1), (0, 3)])
def test_axes_of_length_1_are_no_colours_and_no_frames(tmp_path, axes):
    found = read_depth(saved(tmp_path / "a.npy", np.expand_dims(MILLIMETRES, axes)))
    assert np.array_equal(found, METRES)


def test_the_scale_is_metres_per_unit(tmp_path):
    # RealSense in tenths of a millimetre, and metres that were kept as centimetres.
    tenths, centimetres = saved(tmp_path / "a.npy", MILLIMETRES), tmp_path / "b.npy"
    assert read_depth(tenths, 1e-4) == pytest.approx(METRES / 10)
    np.save(centimetres, 100 * METRES)
    assert read_depth(centimetres, 0.01) == pytest.approx(METRES)
    # What a camera file says holds for whole numbers alone, where nothing else is said.
    assert read_depth(tenths, unit_m=1e-4) == pytest.approx(METRES / 10)
    assert read_depth(tenths, 1e-4, unit_m=7.0) == pytest.approx(METRES / 10)
    metres = saved(tmp_path / "c.npy", METRES)
    assert np.array_equal(read_depth(metres, unit_m=7.0), METRES)


@given(
    scale=st.floats(1e-5, 10.0), values=arrays(np.uint16, (3, 4), elements=st.integers(0, 65534))
)
def test_whole_numbers_are_multiplied_by_the_scale(scale, values):
    assert to_metres(values, scale) == pytest.approx(values.astype(np.float64) * scale, rel=1e-6)


def test_what_is_given_is_not_changed():
    depth = np.array([[np.nan, -1.0]], dtype=np.float32)
    to_metres(depth)
    assert np.isnan(depth[0, 0])
    assert depth[0, 1] == -1.0


@pytest.mark.parametrize(
    ("dtype", "value"),
    [
        (np.uint16, 65535),
        (np.int16, 32767),
        (np.int32, 65535),
        (np.uint32, 2**32 - 1),
        (np.float32, 1e10),
    ],
)
def test_what_cameras_and_renderers_write_for_nothing_is_no_measurement(dtype, value):
    assert (to_metres(np.array([[value, 1]], dtype=dtype)) > 0).tolist() == [[False, True]]


def ramp(times: int = 1) -> np.ndarray:
    return (np.add.outer(np.arange(64), np.arange(40)) % 30 + 740).astype(np.uint16) * times


def test_the_other_byte_order_is_named(tmp_path):
    right = pgm(tmp_path / "right.pgm", ramp(), 65535)
    assert read_depth(right) == pytest.approx(ramp() * 0.001)
    with pytest.raises(UserError, match=r"wrong\.pgm: .*other byte order"):
        read_depth(pgm(tmp_path / "wrong.pgm", ramp().byteswap(), 65535))


def test_coarse_depth_and_noise_have_no_wrong_byte_order(rng):
    for values in (256 * (ramp() - 700), rng.integers(0, 65535, (64, 40)).astype(np.uint16)):
        assert to_metres(values) == pytest.approx(values * 0.001)


@pytest.mark.parametrize("read", [read_depth, read_mask])
def test_a_flipped_bit_of_a_png_is_found_or_changes_nothing(tmp_path, read, rng):
    content = image(tmp_path / "a.png", ramp()).read_bytes()
    wanted = read(tmp_path / "a.png")
    for bit in rng.integers(8 * len(content), size=200).tolist():
        flipped = bytearray(content)
        flipped[bit // 8] ^= 1 << bit % 8
        (tmp_path / "b.png").write_bytes(flipped)
        try:
            found = read(tmp_path / "b.png")
        except UserError:
            continue
        assert np.array_equal(found, wanted)


# What is refused


def refused(name: str, path: Path) -> str:
    with pytest.raises(FrameError, match=path.name) as error:
        read_depth(path)
    assert error.value.name == name
    assert str(error.value).startswith(f"{name}: ")
    return str(error.value)


@pytest.mark.parametrize("suffix", ["png", "tif", "pgm"])
def test_8_bits_are_too_few(tmp_path, suffix):
    refused("few-levels", image(tmp_path / f"a.{suffix}", MILLIMETRES.astype(np.uint8)))
    refused("few-levels", saved(tmp_path / "a.npy", MILLIMETRES.astype(np.uint8)))


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "LA", "P"])
def test_colour_images_are_refused(tmp_path, mode):
    Image.new("RGB", (4, 3), (10, 20, 30)).convert(mode).save(tmp_path / "a.png")
    refused("colour-image", tmp_path / "a.png")


@pytest.mark.parametrize("shape", [(7,), (2, 3, 3), (2, 6, 8), (2, 2, 2, 2)])
def test_arrays_without_rows_and_columns_alone_are_refused(tmp_path, shape):
    message = refused("colour-image", saved(tmp_path / "a.npy", np.ones(shape)))
    is_colour = shape == (2, 3, 3)
    assert ("a colour image" if is_colour else f"an array of shape {shape}") in message


@pytest.mark.parametrize(
    "values",
    [np.array([["a"]]), np.ones((2, 2), complex), np.ones((2, 2), bool), np.zeros((2, 2), "f4,i4")],
    ids=["text", "complex", "bool", "fields"],
)
def test_what_is_no_number_is_refused(tmp_path, values):
    with pytest.raises(UserError, match=r"a\.npy holds .*; give"):
        read_depth(saved(tmp_path / "a.npy", values))


def damaged_files() -> dict[str, bytes]:
    def stored(write) -> bytes:
        buffer = io.BytesIO()
        write(buffer)
        return buffer.getvalue()

    npy = stored(lambda file: np.save(file, MILLIMETRES))
    npz = stored(lambda file: np.savez(file, depth=MILLIMETRES))
    pickled = stored(lambda file: np.save(file, np.array([[{}]], object)))
    other = stored(lambda file: zipfile.ZipFile(file, "w").writestr("depth.txt", "1 2 3"))
    return {
        "empty.npy": b"",
        "cut.npy": npy[:-3],
        "cut.npz": npz[: len(npz) // 2],
        "text.tif": b"II*\0",
        "objects.npy": pickled,
        "none.npz": stored(lambda file: np.savez(file)),
        "other.npz": other,
        "nothing.npy": stored(lambda file: np.save(file, np.zeros((0, 4)))),
        "huge.npy": npy.replace(b"(2, 3)", b"(9, 9)"),
    }


@pytest.mark.parametrize("name", damaged_files())
@pytest.mark.parametrize("read", [read_depth, read_mask])
def test_a_damaged_file_is_named_in_one_line(tmp_path, name, read):
    path = tmp_path / name
    path.write_bytes(damaged_files()[name])
    with pytest.raises(UserError, match=name) as error:
        read(path)
    assert "\n" not in str(error.value)
    # numpy's own words tell to load what may hold code.
    assert "allow_pickle" not in str(error.value)
    assert ("holds Python objects" in str(error.value)) == (name == "objects.npy")


@pytest.mark.parametrize("read", [read_depth, read_mask])
def test_missing_files_and_other_kinds_are_named(tmp_path, read):
    with pytest.raises(UserError, match=r"no\.npy does not exist"):
        read(tmp_path / "no.npy")
    (tmp_path / "folder.npy").mkdir()
    with pytest.raises(UserError, match=r"folder\.npy is a folder"):
        read(tmp_path / "folder.npy")
    (tmp_path / "a.jpg").write_bytes(b"")
    with pytest.raises(UserError, match=r"a\.jpg: unknown kind of file; give \.npy"):
        read(tmp_path / "a.jpg")
    with pytest.raises(UserError, match="cannot be read"):
        read(tmp_path / ("x" * 300 + ".npy"))
    with pytest.raises(UserError, match="3 is not a file name"):
        read(3)


# Masks

INSIDE = np.array([[0, 1, 0, 1], [1, 0, 0, 1], [0, 0, 0, 1]], dtype=bool)


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.uint16, np.int32, np.float32])
def test_a_mask_is_where_the_file_is_not_0(tmp_path, dtype):
    values = INSIDE.astype(dtype) * (1 if dtype is bool else 7)
    assert np.array_equal(read_mask(saved(tmp_path / "a.npy", values)), INSIDE)
    np.savez(tmp_path / "a.npz", values)
    assert np.array_equal(read_mask(tmp_path / "a.npz"), INSIDE)


def test_what_is_not_a_number_is_not_in_the_mask(tmp_path):
    values = np.where(INSIDE, 1.0, np.nan)
    assert np.array_equal(read_mask(saved(tmp_path / "a.npy", values)), INSIDE)


@pytest.mark.parametrize("mode", ["1", "L", "I;16", "RGB", "RGBA", "LA", "P"])
def test_every_kind_of_image_is_a_mask(tmp_path, mode):
    grey = Image.fromarray(255 * INSIDE.astype(np.uint8))
    made = Image.fromarray(9 * INSIDE.astype(np.uint16)) if mode == "I;16" else grey.convert(mode)
    made.save(tmp_path / "a.png")
    assert np.array_equal(read_mask(tmp_path / "a.png"), INSIDE)


def test_one_colour_is_enough(tmp_path):
    colours = np.zeros((*INSIDE.shape, 3), dtype=np.uint8)
    colours[INSIDE] = (0, 0, 1)
    assert np.array_equal(read_mask(image(tmp_path / "a.png", colours)), INSIDE)


def test_instances_are_no_colours(tmp_path):
    stack = np.stack([INSIDE, ~INSIDE])
    for name, values in (("a.npy", stack), ("b.npy", np.moveaxis(stack, 0, 2))):
        with pytest.raises(UserError, match=rf"{name}: 2 masks of 4 × 3 pixels; which"):
            read_mask(saved(tmp_path / name, values))
    for name, values in (("c.npy", INSIDE[None]), ("d.npy", INSIDE[:, :, None])):
        assert np.array_equal(read_mask(saved(tmp_path / name, values)), INSIDE)


def test_what_is_transparent_is_not_in_the_mask(tmp_path):
    colours = np.full((*INSIDE.shape, 4), 200, dtype=np.uint8)
    colours[..., 3] = 255 * INSIDE
    assert np.array_equal(read_mask(image(tmp_path / "a.png", colours)), INSIDE)


def test_a_transparent_colour_of_a_palette_is_not_in_the_mask(tmp_path):
    palette = Image.fromarray(INSIDE.astype(np.uint8)).convert("P")
    palette.putpalette([255, 255, 255, 200, 200, 200])
    palette.save(tmp_path / "a.png", transparency=0)
    assert np.array_equal(read_mask(tmp_path / "a.png"), INSIDE)


def test_a_mask_has_rows_and_columns(tmp_path):
    with pytest.raises(UserError, match="1 axes; a mask has two"):
        read_mask(saved(tmp_path / "a.npy", np.ones(5)))
    with pytest.raises(UserError, match="give a mask of numbers"):
        read_mask(saved(tmp_path / "b.npy", np.array([["a"]])))
    with pytest.raises(UserError, match="give a mask of numbers"):
        read_mask(saved(tmp_path / "c.npy", np.zeros((2, 2), "f4,i4")))


# Masks of many forms: which object, or a question

MUG, BOX = np.s_[6:30, 8:30], np.s_[10:30, 30:50]


def labelled(mug=1, box=2, background=0, dtype=np.uint8):
    """Two objects that touch."""
    values = np.full((40, 60), background, dtype=dtype)
    values[MUG], values[BOX] = mug, box
    return values


ONE, MANY = labelled(box=0) == 1, labelled()


def ring(width):
    """Pixels around an object that belong to no class, as PASCAL VOC and DAVIS mark them."""
    return ndimage.binary_dilation(ONE, np.ones((3, 3)), width) & ~ONE


@pytest.mark.parametrize(
    "values",
    [
        labelled(1, 2),
        labelled(24001, 26000, dtype=np.uint16),
        labelled(1.0, 3.0, dtype=np.float32),
        labelled(255, 128),
        labelled(7, 9, dtype=np.int64)[None],
        np.moveaxis([labelled()] * 3, 0, 2),
        *(np.where(ring(width), 255, ONE) for width in (1, 2, 4)),
        np.where(ring(2), 255, labelled()),
    ],
    ids=[
        *("uint8", "instances", "float", "grey", "batch", "three channels"),
        *("thin ring", "ring", "wide ring", "ring and labels"),
    ],
)
def test_of_several_labels_one_has_to_be_named(tmp_path, values):
    path, mug = saved(tmp_path / "a.npy", values), float(np.squeeze(values)[10, 10].ravel()[0])
    with pytest.raises(
        UserError, match=rf"a\.npy: which value is the object\? .*{mug:g} \(528 pix"
    ):
        read_mask(path)
    assert np.array_equal(read_mask(path, mug), ONE)
    with pytest.raises(UserError, match=r"`mask_value`=77: no pixel of .*a\.npy has it"):
        read_mask(path, 77)


@pytest.mark.parametrize("kind", ["palette", "colours", "grey RGB", "RGBA"])
def test_a_label_image_may_have_colours(tmp_path, kind):
    made, mug = Image.fromarray(MANY), 1
    if kind == "palette":
        made.putpalette([0, 0, 0, 128, 0, 0, 0, 128, 0])
    elif kind == "colours":
        made, mug = (
            Image.fromarray(np.array([[0, 0, 0], [128, 0, 0], [0, 128, 0]], np.uint8)[MANY]),
            128 << 16,
        )
    else:
        made = made.convert(kind.split()[-1])
    made.save(tmp_path / "a.png")
    with pytest.raises(UserError, match=rf"which value is the object\? .*{mug} \(528 pixels\)"):
        read_mask(tmp_path / "a.png")
    assert np.array_equal(read_mask(tmp_path / "a.png", mug), ONE)


def test_soft_edges_are_no_labels():
    """A blurred, an enlarged and a shaded mask, and masked depth: what is not 0, as it was."""
    sharp = 255.0 * ONE
    for soft in (
        *(ndimage.gaussian_filter(sharp, sigma) for sigma in (0.3, 0.7, 2.0, 5.0)),
        *(ndimage.zoom(sharp, zoom, order=1) for zoom in (2, 4)),
        sharp + np.linspace(-60, 0, 60) * ONE,
    ):
        grey = np.rint(soft).astype(np.uint8)
        assert np.array_equal(as_mask(grey), grey > 0)
    down, across = np.mgrid[:40, :60]
    bowl = 700 + ((across - 19) ** 2 + (down - 18) ** 2) // 9
    assert np.array_equal(as_mask(np.where(ONE, bowl, 0)), ONE)


def test_fractions_are_above_a_half(rng):
    values = rng.random((40, 60))
    assert np.array_equal(as_mask(values.astype(np.float32)[None]), values > 0.5)


@pytest.mark.parametrize("dtype", [np.float32, np.int64, np.int8])
def test_negative_values_are_thresholded_first(dtype):
    values = np.where(ONE, 3, -1).astype(dtype)
    with pytest.raises(UserError, match="mask has negative values, such as -1: threshold it first"):
        as_mask(values)
    assert np.array_equal(as_mask(values, mask_value=3), ONE)


def test_probabilities_of_8_bits_are_thresholded_first():
    soft = ndimage.gaussian_filter(255.0 * ONE, 1).clip(5, 249).astype(np.uint8)
    with pytest.raises(
        UserError, match="from 5 to 249 and no 0: threshold it first, as in mask > 127"
    ):
        as_mask(soft)


@pytest.mark.parametrize("shape", [(0, 4), (0, 40, 60), (40, 60, 0)])
def test_no_mask_at_all_is_one_line(shape):
    with pytest.raises(UserError, match="mask is empty; give an image with pixels"):
        as_mask(np.zeros(shape))


def test_an_alpha_channel_that_varies_is_the_mask(tmp_path, rng):
    """Whatever the colours of the object are, unless they look like a second mask."""
    for name, colour in (
        ("black", np.zeros((40, 60, 3))),
        (
            "dark half",
            np.arange(60)[None, :, None] // 15 * np.array([60, 60, 60]) + np.zeros((40, 1, 1)),
        ),
        ("photo", rng.integers(0, 256, (40, 60, 3))),
        ("white", np.full((40, 60, 3), 255)),
        ("black and white", np.where(MANY[..., None] == 2, 255, 0) + np.zeros(3)),
    ):
        alpha = 255 * (MANY > 0)
        values = np.dstack([colour, alpha]).astype(np.uint8)
        path = image(tmp_path / "a.png", values)
        if name == "black and white":
            with pytest.raises(UserError, match="alpha channel and its colours are two masks"):
                read_mask(path)
        else:
            assert np.array_equal(read_mask(path), MANY > 0), name
    matte = ndimage.gaussian_filter(255.0 * ONE, 2).astype(np.uint8)
    soft = image(tmp_path / "a.png", np.dstack([matte, matte, matte, matte]))
    assert np.array_equal(read_mask(soft), matte > 127)
    opaque = np.dstack([np.repeat(255 * ONE[..., None], 3, axis=2), np.full((40, 60), 255)])
    assert np.array_equal(read_mask(image(tmp_path / "a.png", opaque.astype(np.uint8))), ONE)
