"""Read and write depth images and masks.

Floating-point depth is in metres, NaN or 0 where nothing was measured; integer depth is in
millimetres or in a scale's units, 0 where nothing was measured (ROS REP 118: 32FC1 and 16UC1).
The largest integer of 16 bits or of the type, and 1e9 or more, are no measurement either.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from nbv.errors import FrameError, UserError, reason_of
from nbv.files import as_path, missing, replacing

DepthImage = NDArray[np.float32]

MILLIMETRE = 0.001
ARRAYS, IMAGES = (".npy", ".npz"), (".png", ".tif", ".tiff", ".pgm")

_MOST_PIXELS = 10**8
# Metres per unit: enough for depth that is scaled from 0 to 1.
_LARGEST_SCALE = 10.0
_MOST_CHANNELS = 4
_NUMBERS = "biuf"
_LARGEST_16_BIT = 65535
# Renderers write 1e10 where there is no surface.
_NO_DEPTH = 1e9
# A label fills a square of this side, pixels, and labels this share of the mask. Soft edges are
# narrower, and take less. Labels may have a thin ring of one value, with this share of the mask.
_REGION = 5
_LABELLED = 0.75
_RING = 0.01
# Kind, columns, rows and the largest value, possibly with comments between them.
_PGM_HEADER = re.compile(rb"P[25]" + 3 * rb"(?:\s|#[^\n]*\n)+(\d+)")


def read_depth(
    path: str | Path, depth_scale: float | None = None, unit_m: float = MILLIMETRE
) -> DepthImage:
    """Read one depth image.

    Parameters
    ----------
    path : path
        ``.npy``, ``.npz`` (a single array, or the array ``depth``), or a 16-bit image:
        ``.png``, ``.tif``, ``.pgm``.
    depth_scale : float, optional
        Metres per unit. (BOP's ``depth_scale`` is in millimetres: divide it by 1000.)
    unit_m : float
        Metres per unit of integer depth without `depth_scale`.

    Returns
    -------
    (rows, columns) float32
        Metres; 0 where nothing was measured.

    Raises
    ------
    FrameError
        ``colour-image`` or ``few-levels`` where the file is not a depth image.
    UserError
        Where the file cannot be read, or its integers are in the other byte order.

    Examples
    --------
    >>> import tempfile, numpy as np, nbv
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/depth.npy", np.array([[730, 0]], dtype=np.uint16))
    ...     nbv.read_depth(f"{folder}/depth.npy").round(3).tolist()
    [[0.7300000190734863, 0.0]]
    """
    return to_metres(_read_array(as_path(path), "depth"), depth_scale, str(path), unit_m)


def write_depth(path: Path, depth_m: DepthImage) -> None:
    """Write a depth image: ``.png`` of 16 bits in millimetres, or ``.npy`` in metres.

    Raise UserError where a depth exceeds 16 bits.
    """
    if path.suffix.lower() != ".png":
        # An open file, because numpy appends .npy to a name in capitals.
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.save(file, depth_m)
        return
    from PIL import Image

    millimetres = np.rint(depth_m / MILLIMETRE)
    if millimetres.max() > np.iinfo(np.uint16).max:
        raise UserError(f"{path}: {depth_m.max():.3g} m is too far for a PNG; write a .npy file")
    with replacing(path) as temporary:
        Image.fromarray(millimetres.astype(np.uint16)).save(temporary)


def read_mask(path: str | Path, mask_value: float | None = None) -> NDArray[np.bool_]:
    """Read the mask (rows, columns) of one object; see `as_mask` for `mask_value` and errors.

    From several arrays in an ``.npz`` it reads ``mask``. An alpha channel that varies is the mask
    above half its maximum. A value of a palette is an index, and a colour is 65536 R + 256 G + B.
    """
    values = _read_array(as_path(path), "mask")
    if values.ndim == 3 and as_path(path).suffix.lower() in IMAGES:
        values = _labels_of_colours(values, str(path), mask_value)
    return as_mask(values, str(path), mask_value)


def as_mask(
    mask: ArrayLike, name: str = "mask", mask_value: float | None = None
) -> NDArray[np.bool_]:
    """Return the mask (rows, columns) of one object.

    Raise UserError where values are negative or no numbers, masks differ, values are labels or soft
    without a 0, or none is `mask_value`.

    Parameters
    ----------
    mask : (rows, columns), (n, rows, columns) or (rows, columns, n)
        Not 0, or above a half where all are fractions, at the object's pixels; there neither NaN
        nor masked itself. The n masks are alike.
    name : str
        Used in messages.
    mask_value : float, optional
        The object's value in an image of labels.
    """
    values = without_single_axes(np.asarray(np.ma.filled(mask, 0)))
    if values.dtype.kind not in _NUMBERS:
        raise UserError(f"{name} holds {values.dtype}; give a mask of numbers")
    if values.ndim not in (2, 3):
        raise UserError(f"{name}: {values.ndim} axes; a mask has two, rows and columns")
    if values.dtype.kind == "f":
        values = np.where(np.isnan(values), 0, values)
    if not values.size:
        raise UserError(f"{name} is empty; give an image with pixels")
    layers = values[None] if values.ndim == 2 else values
    if values.ndim == 3 and len(values) >= values.shape[2]:
        layers = np.moveaxis(values, 2, 0)
    least, most = layers.min(initial=0), layers.max(initial=0)
    is_fraction = layers.dtype.kind == "f" and most <= 1
    inside = layers > 0.5 if is_fraction else layers != 0
    if mask_value is not None:
        inside = layers == mask_value
    elif least < 0:
        raise UserError(
            f"{name} has negative values, such as {least:g}: threshold it first, as in mask > 0"
        )
    if (inside != inside[0]).any():
        raise UserError(
            f"{name}: {len(layers)} masks of {layers.shape[2]} × {layers.shape[1]} pixels; which "
            "of them? give the object's alone, such as masks[0] or masks[:, :, 0]"
        )
    if mask_value is None and most > 1:
        _check_one_label(layers[0], inside[0], name)
    elif mask_value is not None and not inside.any():
        raise UserError(
            f"`mask_value`={mask_value:.9g}: no pixel of {name} has it; it has {least:.9g} to "
            f"{most:.9g}"
        )
    return np.asarray(inside[0])


def without_single_axes(values: NDArray[Any]) -> NDArray[Any]:
    """Return an image without the axes of length 1 of its batch and its channel."""
    while values.ndim > 2 and values.shape[0] == 1:
        values = values[0]
    return values[..., 0] if values.ndim == 3 and values.shape[2] == 1 else values


def _check_one_label(values: NDArray[Any], inside: NDArray[np.bool_], name: str) -> None:
    """Raise UserError unless values but one are soft edges: many, and none fills a region."""
    shown = values[inside]
    if not shown.size or shown.min() == shown.max():
        return
    is_even = ndimage.minimum_filter(values, _REGION) == ndimage.maximum_filter(values, _REGION)
    labels = np.unique(values[inside & is_even])
    labelled, others = np.isin(shown, labels).mean(), np.setdiff1d(shown, labels)
    has_ring = len(labels) > 0 and len(others) == 1 and labelled <= 1 - _RING
    if not has_ring and (len(labels) < 2 or labelled < _LABELLED):
        return
    if inside.all() and len(others) > 1:
        raise UserError(
            f"{name} has values from {shown.min():.9g} to {shown.max():.9g} and no 0: threshold it "
            f"first, as in mask > {np.mean(labels[[0, -1]]):.0f}"
        )
    labels = np.append(labels, others) if has_ring else labels
    listed = [f"{label:.9g} ({np.count_nonzero(shown == label)} pixels)" for label in labels[:4]]
    raise UserError(
        f"{name}: which value is the object? {', '.join(listed)}{' …' * (len(labels) > 4)}: give "
        f"the object's alone (mask == {labels[0]:.9g}), or `mask_value`"
    )


def _labels_of_colours(
    values: NDArray[Any], name: str, mask_value: float | None
) -> NDArray[np.integer[Any]]:
    """Return labels (rows, columns) of an image with 2 to 4 channels, 0 where it is transparent."""
    has_opacity = values.shape[2] in (2, 4)
    opacity = values[..., -1] if has_opacity else np.ones(values.shape[:2])
    colours = (values[..., :-1] if has_opacity else values).astype(np.int32)
    is_grey = (colours == colours[..., :1]).all()
    labels = np.where(opacity > 0, colours[..., 0] if is_grey else colours @ (65536, 256, 1), 0)
    if mask_value is not None or np.ptp(opacity) == 0:
        return labels
    if np.unique(labels[opacity > 0]).tolist() in ([0, 1], [0, 255]):
        raise UserError(
            f"{name}: its alpha channel and its colours are two masks: which is the object's? save "
            "that one as a grey image"
        )
    return np.asarray(opacity > opacity.max() / 2, dtype=np.int32)


def to_metres(
    values: NDArray[Any],
    depth_scale: float | None = None,
    name: str = "depth",
    unit_m: float = MILLIMETRE,
) -> DepthImage:
    """Return a depth image in metres, 0 where nothing was measured.

    Masked pixels of a masked array were not measured. An image in metres is returned unchanged.
    Same parameters and errors as `read_depth`; `name` is used in messages.
    """
    values = without_single_axes(np.asarray(np.ma.filled(values, 0)))
    if values.dtype.kind not in "iuf":
        raise UserError(f"{name} holds {values.dtype}; give numbers")
    if values.ndim != 2:
        is_colour = values.ndim == 3 and values.shape[2] <= _MOST_CHANNELS
        what = "a colour image" if is_colour else f"an array of shape {values.shape}"
        raise FrameError(
            "colour-image", f"{name} is {what}; give one depth image of rows and columns"
        )
    if depth_scale is not None and not 0 < depth_scale <= _LARGEST_SCALE:
        raise UserError(
            f"`depth_scale`={depth_scale:g}: give metres per unit, above 0 and at most "
            f"{_LARGEST_SCALE:g}; 0.001 for millimetres"
        )
    if values.dtype.kind == "f":
        scale = 1.0 if depth_scale is None else depth_scale
    else:
        if values.dtype.itemsize == 1:
            raise FrameError("few-levels", f"{name} has 8 bits per pixel; give 16")
        scale = unit_m if depth_scale is None else depth_scale
        largest = np.iinfo(values.dtype).max
        values = np.where((values == _LARGEST_16_BIT) | (values == largest), 0, values)
        _check_byte_order(values[::8], name)  # all rows would take ten times as long
    # Overflow is treated like no surface: nothing was measured.
    with np.errstate(invalid="ignore", over="ignore"):
        metres = values.astype(np.float32, copy=False)
        if scale != 1.0:
            metres = metres * np.float32(scale)
        if metres.min(initial=0.0) >= 0 and metres.max(initial=0.0) < _NO_DEPTH:
            return metres
        return np.where((metres >= 0) & (metres < _NO_DEPTH), metres, np.float32(0))


def _check_byte_order(values: NDArray[Any], name: str) -> None:
    """Raise UserError if neighbouring integers of 16 bits are far closer with swapped bytes."""
    is_measured = (values[:, 1:] > 0) & (values[:, :-1] > 0)
    given, swapped = (
        np.abs(np.diff(values.astype("<u2").view(order).astype(int), axis=1)[is_measured])
        for order in ("<u2", ">u2")
    )
    # Depth is up to 256 times as smooth in the right order. Multiples of 256 are smooth in both.
    is_enough = given.size > 100 and values.max() <= _LARGEST_16_BIT and (values & 255).any()
    if is_enough and given.sum() > 8 * swapped.sum():
        raise UserError(
            f"{name}: its integers look like the other byte order (16-bit PGM is big-endian, "
            "libfreenect's record writes little-endian); swap the two bytes of each pixel"
        )


def _read_array(path: Path, name: str) -> NDArray[Any]:
    """Return the numbers of a file; `name` selects one of several arrays."""
    suffix = path.suffix.lower()
    if suffix not in ARRAYS + IMAGES:
        raise UserError(f"{path}: unknown kind of file; give {', '.join(ARRAYS + IMAGES)}")
    try:
        if not path.is_file():
            raise UserError(f"{path} {missing(path)}")
        values = _read_image(path, name) if suffix in IMAGES else _read_numpy(path, name)
    except UserError:
        raise
    # A reader may raise any exception on arbitrary bytes.
    except Exception as error:
        raise UserError(f"{path} cannot be read ({reason_of(error)})") from error
    if not values.size:
        raise UserError(f"{path} is empty; give an image with pixels")
    return values


def _read_numpy(path: Path, name: str) -> NDArray[Any]:
    stored = np.load(path, mmap_mode="r", allow_pickle=False)
    if isinstance(stored, np.ndarray):
        return np.array(stored)
    with stored:
        if not stored.files:
            raise UserError(f"{path} is empty; give a file with an array")
        if name not in stored.files and len(stored.files) > 1:
            raise UserError(f"{path} holds {', '.join(stored.files)}: name one of them {name!r}")
        return np.asarray(stored[name if name in stored.files else stored.files[0]])


def _read_image(path: Path, name: str) -> NDArray[Any]:
    from PIL import Image  # here, because reading an array does not need it

    with Image.open(path) as image:
        # Otherwise Pillow does not compare the checksums of a PNG's pixels.
        image.verify()
    with Image.open(path) as image:
        if image.width * image.height > _MOST_PIXELS:
            raise UserError(
                f"{path}: {image.width} × {image.height} pixels; give at most {_MOST_PIXELS}"
            )
        # The numbers of a palette image are indices of colours, one of which may be transparent.
        if image.mode == "P":
            values = np.asarray(image.convert("RGBA" if "transparency" in image.info else "RGB"))
            index, is_shown = np.asarray(image), np.asarray(values[..., :3].any(axis=2))
            if name != "mask" or values.shape[2] == 4 or is_shown[index == 0].any():
                return values
            return np.where(is_shown, index, 0)
        values = np.asarray(image)
        if image.format == "PPM" and image.mode == "I":
            return _as_stored(values, path)
        return values


def _as_stored(values: NDArray[Any], path: Path) -> NDArray[Any]:
    """Return the numbers stored in a 16-bit PGM, which Pillow scales to 65535."""
    header = _PGM_HEADER.match(path.read_bytes())
    if header is None:
        raise ValueError("its header lacks the largest value")
    return np.rint(values * (int(header[3]) / 65535)).astype(np.int32)
