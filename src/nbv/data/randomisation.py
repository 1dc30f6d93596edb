"""Domain randomisation of depth images, for the unknown properties of real cameras.

Drawn for each sweep: elevation, roll, the object's size and distance, the focal length, and
whether there is sensor noise. Drawn for each view: strips of the table within the mask, or the
table in all of its lower part; displaced edges; thin parts, their middles and dark insides without
depth; a hole in the body, other patches without depth, an occluder, and an off-centre crop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from nbv.data.camera import Camera, Views, object_views
from nbv.data.depth_codes import Depths, encode_depth
from nbv.data.depth_images import Codes
from nbv.data.meshes import Surface
from nbv.data.render import Renderer
from nbv.data.sensors import Sensor

Floats = NDArray[np.float64]

HIGHEST_DEG = 85.0
"""The highest random elevation."""


@dataclass(frozen=True)
class Randomisation:
    """Ranges of the randomisation; 0 disables an effect.

    Attributes
    ----------
    elevation_deg, roll_deg : float
        Half the range around the unit's elevation, and around 0.
    size : float
        Half the range of the object's relative size.
    nearest, farthest : float or None
        Range of the camera's distance, in diagonals; None is the training camera's distance.
    focal : float
        Half the range of the relative error of the assumed focal length: objects are wider or
        narrower than their depth says.
    measured : float
        Fraction of sweeps with sensor noise.
    table, cutout, thin, split, inside, hole, occluded : float
        Fractions of views with a strip of the table, with the table in the lower part of the mask,
        without thin parts, without the middle of a thin part, without parts of the far inside, with
        a hole in the middle of the body, and with an occluder.
    patches : float
        Mean number of patches without depth in a view.
    edge_px : float
        Largest standard deviation of the position of an object's edge, in pixels of the crop.
    shift_px : float
        Standard deviation of the crop's centre, in pixels.
    """

    elevation_deg: float
    roll_deg: float
    size: float
    nearest: float | None
    farthest: float | None
    focal: float
    measured: float
    table: float
    cutout: float
    thin: float
    split: float
    inside: float
    hole: float
    occluded: float
    patches: float
    edge_px: float
    shift_px: float


# Objects of a random size need a larger image.
_MARGIN = 1.25


def randomised_sweep(
    mesh: Surface,
    elevation_deg: float,
    azimuths_deg: Floats,
    camera: Camera,
    renderer: Renderer,
    sensor: Sensor | None,
    diagonal_m: float,
    randomisation: Randomisation,
    rng: np.random.Generator,
) -> Codes:
    """Return the depth codes of a random sweep, (k, side, side) uint8.

    Parameters
    ----------
    mesh : mesh
        A mesh of unit diagonal.
    elevation_deg : float
        Centre of the random elevation, in [0, `HIGHEST_DEG`].
    camera : Camera
        Its distance and focal length define the size of a pixel on the object.
    diagonal_m : float
        Metres per object diagonal, for the sensor.
    rng : numpy.random.Generator
        A generator for this object and elevation alone.

    Raises
    ------
    UserError
        If the object does not fit the image.
    """
    draw = randomisation
    lowest = max(elevation_deg - draw.elevation_deg, 0.0)
    highest = min(elevation_deg + draw.elevation_deg, max(elevation_deg, HIGHEST_DEG))
    elevation = rng.uniform(lowest, highest)
    scale = 1.0 + rng.uniform(-draw.size, draw.size)
    drawn = _drawn_camera(camera, draw, rng)
    vertices = np.asarray(mesh.vertices) * scale
    depth = renderer.render(vertices, mesh.faces, elevation, azimuths_deg, drawn)
    if draw.table > 0 or draw.cutout > 0:
        views = object_views(vertices, mesh.faces, elevation, azimuths_deg, drawn)
        add_table(depth, views, float(vertices[:, 2].min()), draw, rng)
    if sensor is not None and rng.random() < draw.measured:
        depth = sensor(depth, drawn, diagonal_m, rng)
    for image in depth:
        if draw.edge_px > 0:
            move_edge(image, draw.edge_px, rng)
        lose(image, draw, rng)
    return encode_depth(_cropped(depth, camera.image_side, draw.shift_px, rng), camera)


def _drawn_camera(camera: Camera, draw: Randomisation, rng: np.random.Generator) -> Camera:
    """Return a camera at a random distance and roll, with the same pixel size on the object."""
    near, far = draw.nearest or camera.distance, draw.farthest or camera.distance
    distance = rng.uniform(near, far)
    side = math.ceil(camera.image_side * _MARGIN)
    focal_px = camera.focal_px * distance / camera.distance
    if draw.focal > 0:
        focal_px *= 1.0 + rng.uniform(-draw.focal, draw.focal)
    return replace(
        camera,
        distance=distance,
        fov_deg=math.degrees(2 * math.atan(side / 2 / focal_px)),
        image_side=side,
        whole_pixels=True,
        roll_deg=rng.uniform(-draw.roll_deg, draw.roll_deg),
    )


# Largest difference in depth between the object and the table within its mask, in diagonals.
_TABLE_REACH = 0.7


def add_table(
    depth: Depths, views: Views, floor: float, draw: Randomisation, rng: np.random.Generator
) -> None:
    """Add the plane z = floor to images: a strip at the lower edge, or all of the lower part."""
    side = depth.shape[-1]
    chance = rng.random(len(depth))
    for view in np.flatnonzero(chance < draw.table + draw.cutout):
        rows, columns = np.nonzero(depth[view])
        if not len(rows):
            continue
        if chance[view] < draw.table:
            top = max(int(rows.max() - rng.integers(0, 5)), 0)
            end = min(int(rows.max() + rng.integers(1, 7)), side)
            ends = rng.integers(columns.min() - 2, columns.max() + 4, 2).clip(0, side)
            left, right = int(ends.min()), int(ends.max())
        else:
            top = int(rng.integers(rows.min(), rows.max() + 1))
            end = min(int(rows.max() + rng.integers(1, 9)), side)
            left = max(int(columns.min() - rng.integers(0, 9)), 0)
            right = min(int(columns.max() + rng.integers(1, 10)), side)
        table = _table_depth(views, view, floor, slice(top, end), slice(left, right))
        patch = depth[view, top:end, left:right]
        is_table = (patch == 0) & (np.abs(table - views.camera.distance) < _TABLE_REACH)
        patch[is_table] = table[is_table]


def _table_depth(views: Views, view: np.intp, floor: float, rows: slice, columns: slice) -> Floats:
    """Return the depth of the plane z = floor in a part of an image."""
    camera = views.camera
    principal_column, principal_row = views.principal_px[view]
    x = (np.arange(columns.start, columns.stop) + 0.5 - principal_column) / camera.focal_px
    y = (principal_row - np.arange(rows.start, rows.stop) - 0.5) / camera.focal_px
    down = views.forward[view, 2] + x * views.right[view, 2] + y[:, None] * views.up[view, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((floor - views.position[view, 2]) / down)


# Range of the smoothing of edge displacements, in pixels.
_EDGE_SMOOTHNESS = (1.0, 4.0)


def move_edge(image: Depths, edge_px: float, rng: np.random.Generator) -> None:
    """Displace an object's edge by a smooth random field, as masks and depth cameras do.

    The field's standard deviation is drawn from 0 to `edge_px`. Added pixels have the depth of the
    nearest pixel. The edge moves inwards by at most a pixel, to keep handles.
    """
    seen = image > 0
    if not seen.any():
        return
    field = ndimage.gaussian_filter(
        rng.standard_normal(image.shape, dtype=np.float32), rng.uniform(*_EDGE_SMOOTHNESS)
    )
    field *= rng.uniform(0.0, edge_px) / field.std()
    # The edge stays within this window.
    near = _bounds(seen, math.ceil(max(float(field.max()), 0.0) + 0.5))
    image, seen, field = image[near], seen[near], np.maximum(field[near], -1.0)
    # The edge is half a pixel from the centres of the pixels along it.
    row, column = np.nonzero(~seen & (field > 0.5))
    nearest = ndimage.distance_transform_edt(~seen, return_distances=False, return_indices=True)
    nearest = nearest[:, row, column]
    is_added = np.hypot(*(nearest - (row, column))) - 0.5 < field[row, column]
    image[row[is_added], column[is_added]] = image[tuple(nearest[:, is_added])]
    image[seen & (0.5 - _to_background_px(seen) >= field)] = 0


def _to_background_px(seen: NDArray[np.bool_]) -> Floats:
    """Return the distance of each pixel from the background: 1, √2, or 2 for all larger ones.

    The outside of the image does not count as background. At 2, `move_edge` has no effect.
    """
    padded = np.pad(seen, 1, constant_values=True)
    above, level, below = padded[:-2], padded[1:-1], padded[2:]
    sides = above[:, 1:-1] & below[:, 1:-1] & level[:, :-2] & level[:, 2:]
    corners = above[:, :-2] & above[:, 2:] & below[:, :-2] & below[:, 2:]
    return np.where(sides, np.where(corners, 2.0, math.sqrt(2.0)), 1.0)


def _bounds(seen: NDArray[np.bool_], margin: int = 0) -> tuple[slice, ...]:
    """Return the bounding box of a mask, with a margin within the image."""
    (box,) = ndimage.find_objects(seen.view(np.uint8))
    return tuple(slice(max(side.start - margin, 0), side.stop + margin) for side in box)


# Range of the radii of patches without depth, in pixels.
_PATCH_RADII = (0.7, 4.0)


def lose(image: Depths, draw: Randomisation, rng: np.random.Generator) -> None:
    """Set pixels of an image to 0 that a camera would not measure."""
    if rng.random() < draw.thin:
        _lose_thin_parts(image, rng)
    if draw.split > 0 and rng.random() < draw.split:
        _split_thin_part(image, rng)
    if rng.random() < draw.inside:
        _lose_inside(image, rng)
    if draw.hole > 0 and rng.random() < draw.hole:
        _lose_middle(image, rng)
    seen = np.flatnonzero(image)
    if not len(seen):
        return
    rows, columns = np.divmod(seen, image.shape[1])
    across, down = np.arange(image.shape[1]), np.arange(image.shape[0])[:, None]
    reach = math.ceil(_PATCH_RADII[1])
    for _ in range(rng.poisson(draw.patches)):
        middle = rng.integers(len(seen))
        radii, angle = rng.uniform(*_PATCH_RADII, 2), rng.uniform(0.0, math.pi)
        row, column = int(rows[middle]), int(columns[middle])
        row_slice, column_slice = (slice(max(i - reach, 0), i + reach + 1) for i in (row, column))
        x, y = across[column_slice] - column, down[row_slice] - row
        major = x * math.cos(angle) + y * math.sin(angle)
        minor = y * math.cos(angle) - x * math.sin(angle)
        image[row_slice, column_slice][(major / radii[0]) ** 2 + (minor / radii[1]) ** 2 < 1] = 0
    if rng.random() < draw.occluded:
        angle, share = rng.uniform(0.0, 2 * math.pi), rng.uniform(0.02, 0.25)
        distance = across * math.cos(angle) + down * math.sin(angle)
        edge = np.quantile(distance[rows, columns], share)
        image[distance < edge] = 0


def _thin_parts(image: Depths, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return the pixels of thin parts, such as a handle; none where there is little else."""
    seen = image > 0
    bulk = ndimage.binary_opening(seen, iterations=int(rng.integers(1, 4)))
    return seen & ~bulk & (np.count_nonzero(bulk) >= 0.4 * np.count_nonzero(seen))


def _lose_thin_parts(image: Depths, rng: np.random.Generator) -> None:
    """Remove all thin parts, or one of them, such as a handle."""
    thin = _thin_parts(image, rng)
    if not thin.any():
        return
    if rng.random() < 0.5:
        parts, n_parts = ndimage.label(thin)
        if n_parts:
            thin = parts == rng.integers(1, n_parts + 1)
    image[thin] = 0


def _split_thin_part(image: Depths, rng: np.random.Generator) -> None:
    """Remove the middle of the largest thin part, and leave its ends."""
    parts, n_parts = ndimage.label(_thin_parts(image, rng))
    if not n_parts:
        return
    largest = 1 + int(np.bincount(parts.ravel())[1:].argmax())
    rows, columns = np.nonzero(parts == largest)
    # Along the image's vertical, as a handle's ends are one above the other.
    middle, half = (rows.min() + rows.max()) / 2, (np.ptp(rows) + 1) / 2
    is_lost = np.abs(rows - middle) < rng.uniform(0.3, 0.8) * half
    image[rows[is_lost], columns[is_lost]] = 0


# Ranges of a hole's radii, relative to those of the object in the image, and of the depth of its
# rim against the surface, in diagonals.
_HOLE_RADII, _RIM_DEPTH = (0.15, 0.5), 0.1


def _lose_middle(image: Depths, rng: np.random.Generator) -> None:
    """Remove the middle of the body, as from white glaze; the rim is nearer or farther."""
    seen = image > 0
    if not seen.any():
        return
    rows, columns = _bounds(seen)
    height, width = rows.stop - rows.start, columns.stop - columns.start
    row = rows.start + height * rng.uniform(0.3, 0.7)
    column = columns.start + width * rng.uniform(0.3, 0.7)
    radii = rng.uniform(*_HOLE_RADII, 2) * (height, width) / 2
    down, across = np.ogrid[: image.shape[0], : image.shape[1]]
    is_hole = np.hypot((down - row) / radii[0], (across - column) / radii[1]) < 1.0
    is_rim = ndimage.binary_dilation(is_hole, iterations=int(rng.integers(1, 4))) & ~is_hole
    image[seen & is_rim] += rng.uniform(-_RIM_DEPTH, _RIM_DEPTH)
    image[is_hole] = 0


def _lose_inside(image: Depths, rng: np.random.Generator) -> None:
    """Remove patches far behind the front, like dark insides."""
    seen = image > 0
    if not seen.any():
        return
    far = image > np.quantile(image[seen], rng.uniform(0.5, 0.95))
    noise = rng.standard_normal(image.shape, dtype=np.float32)
    noise = ndimage.gaussian_filter(noise, rng.uniform(2.0, 8.0))
    image[far & (noise > np.quantile(noise, rng.uniform(0.0, 0.7)))] = 0


def _cropped(depth: Depths, side: int, shift_px: float, rng: np.random.Generator) -> Depths:
    """Crop images to a side, with the measured pixels near the middle."""
    cropped = np.zeros((len(depth), side, side), dtype=depth.dtype)
    for image, out in zip(depth, cropped, strict=True):
        seen = image > 0
        if not seen.any():
            continue
        shift = np.rint(rng.normal(0.0, shift_px, 2)).astype(int) if shift_px else (0, 0)
        measured = image[_bounds(seen)]
        first = [(side - n) // 2 + int(by) for n, by in zip(measured.shape, shift, strict=True)]
        kept = tuple(slice(max(-i, 0), max(side - i, 0)) for i in first)
        part = measured[kept]
        rows, columns = (
            slice(max(i, 0), max(i, 0) + n) for i, n in zip(first, part.shape, strict=True)
        )
        out[rows, columns] = part
    return cropped
