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

    Raises
    ------
    UserError
        Where a depth exceeds 16 bits.
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


def read_mask(path: str | Path) -> NDArray[np.bool_]:
    """Read a mask (rows, columns): true where the file is not 0.

    From several arrays in an ``.npz`` it reads ``mask``. Transparent pixels of an image are false.

    Raises
    ------
    UserError
        Where the file cannot be read, is not an image of numbers, or holds several masks.
    """
    values = _read_array(as_path(path), "mask")
    if values.dtype.kind not in _NUMBERS:
        raise UserError(f"{path} holds {values.dtype}; give a mask of numbers")
    mask = is_in_mask(values)
    if mask.ndim == 3 and as_path(path).suffix.lower() in IMAGES:
        has_opacity = mask.shape[2] in (2, 4)
        colours = mask[:, :, :-1] if has_opacity else mask
        mask = np.asarray(colours.any(axis=2) & (mask[:, :, -1] if has_opacity else True))
    return single_mask(mask, str(path))


def single_mask(mask: NDArray[np.bool_], name: str) -> NDArray[np.bool_]:
    """Return a mask (rows, columns), also from (rows, columns, n) or (n, rows, columns).

    Raises
    ------
    UserError
        Where the array has other axes, or the n masks differ.
    """
    if mask.ndim == 3:
        layers = mask if len(mask) < mask.shape[2] else np.moveaxis(mask, 2, 0)
        if (layers != layers[0]).any():
            raise UserError(
                f"{name}: {len(layers)} masks of {layers.shape[2]} × {layers.shape[1]} pixels; "
                "which of them? give the object's alone, such as masks[0] or masks[:, :, 0]"
            )
        mask = layers[0]
    if mask.ndim != 2:
        raise UserError(f"{name}: {mask.ndim} axes; a mask has two, rows and columns")
    return mask


def is_in_mask(mask: ArrayLike) -> NDArray[np.bool_]:
    """Return where a mask is neither 0 nor NaN nor masked itself."""
    values = np.asarray(np.ma.filled(mask, 0))
    if values.dtype.kind == "f":
        return np.asarray((values != 0) & ~np.isnan(values))
    return values if values.dtype == np.bool_ else np.asarray(values != 0)


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
    values = np.asarray(np.ma.filled(values, 0))
    if values.dtype.kind not in "iuf":
        raise UserError(f"{name} holds {values.dtype}; give numbers")
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[:, :, 0]
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
        values = _read_image(path) if suffix in IMAGES else _read_numpy(path, name)
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


def _read_image(path: Path) -> NDArray[Any]:
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
        colours = "RGBA" if "transparency" in image.info else "RGB"
        values = np.asarray(image.convert(colours) if image.mode == "P" else image)
        if image.format == "PPM" and image.mode == "I":
            return _as_stored(values, path)
        return values


def _as_stored(values: NDArray[Any], path: Path) -> NDArray[Any]:
    """Return the numbers stored in a 16-bit PGM, which Pillow scales to 65535."""
    header = _PGM_HEADER.match(path.read_bytes())
    if header is None:
        raise ValueError("its header lacks the largest value")
    return np.rint(values * (int(header[3]) / 65535)).astype(np.int32)
