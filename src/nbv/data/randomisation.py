"""What a real camera does that nobody knows beforehand: drawn anew for each turn and each view.

Once for a turn: elevation, roll, the object's size and distance, and whether the sensor's noise is
there at all. For each view: strips of the table that a mask takes along, an edge that is not where
it seems, thin parts and dark insides without depth, other patches without depth, an occluder, and a
crop that is off its middle.
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
from nbv.data.renderers import Renderer
from nbv.data.sensors import Sensor

Floats = NDArray[np.float64]

HIGHEST_DEG = 85.0

# A turn is drawn on a larger image, because objects of a random size have to fit.
_MARGIN = 1.25
# Of the table's depth from the object's, in diagonals: farther off a mask does not take it along.
_TABLE_REACH = 0.7
# Over how many pixels what moves an edge is smoothed.
_EDGE_SMOOTHNESS = (1.0, 4.0)
# Pixels; of an ellipse without depth.
_PATCH_RADII = (0.7, 4.0)


@dataclass(frozen=True)
class Randomisation:
    """How much each unknown varies; 0 leaves it out.

    Attributes
    ----------
    elevation_deg, roll_deg : float
        Half the range about the unit's elevation, and about 0.
    size : float
        Half the range of the object's size, relative to the usual one.
    nearest, farthest : float or None
        Distance of the camera, in diagonals; None: that of the training camera.
    measured : float
        Share of turns that the sensor measures; the others are free of noise.
    table, thin, inside, occluded : float
        Share of views with a strip of the table, without thin parts, without parts of the far
        inside, and with an occluder.
    patches : float
        Mean number of patches without depth in a view.
    edge_px : float
        Largest standard deviation of the place of an object's edge, in pixels of the crop.
    shift_px : float
        Standard deviation of the crop's middle.
    """

    elevation_deg: float
    roll_deg: float
    size: float
    nearest: float | None
    farthest: float | None
    measured: float
    table: float
    thin: float
    inside: float
    occluded: float
    patches: float
    edge_px: float
    shift_px: float


def randomised_turn(
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
    """Return the encoded images of a turn, (k, side, side) uint8.

    Parameters
    ----------
    mesh : mesh
        Of unit diagonal.
    elevation_deg : float
        About which the turn's elevation is drawn, in [0, `HIGHEST_DEG`].
    azimuths_deg : (k,) float
    camera : Camera
        Its distance and focal length give the size of a pixel on the object, and nothing else.
    renderer : Renderer
    sensor : Sensor or None
    diagonal_m : float
        Metres per object diagonal, for the sensor.
    randomisation : Randomisation
    rng : numpy.random.Generator
        Of this object and elevation alone.

    Raises
    ------
    UserError
        Where an object does not fit the image.
    """
    draw = randomisation
    lowest = max(elevation_deg - draw.elevation_deg, 0.0)
    highest = min(elevation_deg + draw.elevation_deg, max(elevation_deg, HIGHEST_DEG))
    elevation = rng.uniform(lowest, highest)
    scale = 1.0 + rng.uniform(-draw.size, draw.size)
    drawn = _drawn_camera(camera, draw, rng)
    vertices = np.asarray(mesh.vertices) * scale
    depth = renderer.render(vertices, mesh.faces, elevation, azimuths_deg, drawn)
    if draw.table > 0:
        views = object_views(vertices, mesh.faces, elevation, azimuths_deg, drawn)
        add_table(depth, views, float(vertices[:, 2].min()), draw.table, rng)
    if sensor is not None and rng.random() < draw.measured:
        depth = sensor(depth, drawn, diagonal_m, rng)
    for image in depth:
        if draw.edge_px > 0:
            move_edge(image, draw.edge_px, rng)
        lose(image, draw, rng)
    return encode_depth(_cropped(depth, camera.image_side, draw.shift_px, rng), camera)


def _drawn_camera(camera: Camera, draw: Randomisation, rng: np.random.Generator) -> Camera:
    """Return a camera elsewhere, whose pixels are as large on the object as before."""
    near, far = draw.nearest or camera.distance, draw.farthest or camera.distance
    distance = rng.uniform(near, far)
    side = math.ceil(camera.image_side * _MARGIN)
    focal_px = camera.focal_px * distance / camera.distance
    return replace(
        camera,
        distance=distance,
        fov_deg=math.degrees(2 * math.atan(side / 2 / focal_px)),
        image_side=side,
        whole_pixels=True,
        roll_deg=rng.uniform(-draw.roll_deg, draw.roll_deg),
    )


def add_table(
    depth: Depths, views: Views, floor: float, share: float, rng: np.random.Generator
) -> None:
    """Write strips of the plane z = floor at the lower edge of objects into their images."""
    camera, side = views.camera, depth.shape[-1]
    centres = np.arange(side) + 0.5
    for view in np.flatnonzero(rng.random(len(depth)) < share):
        rows, columns = np.nonzero(depth[view])
        if not len(rows):
            continue
        top = max(int(rows.max() - rng.integers(0, 5)), 0)
        end = min(int(rows.max() + rng.integers(1, 7)), side)
        ends = rng.integers(columns.min() - 2, columns.max() + 4, 2).clip(0, side)
        left, right = int(ends.min()), int(ends.max())
        principal_column, principal_row = views.principal_px[view]
        x = (centres[left:right] - principal_column) / camera.focal_px
        y = (principal_row - centres[top:end]) / camera.focal_px
        down = views.forward[view, 2] + x * views.right[view, 2] + y[:, None] * views.up[view, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            table = (floor - views.position[view, 2]) / down
        patch = depth[view, top:end, left:right]
        is_table = (patch == 0) & (np.abs(table - camera.distance) < _TABLE_REACH)
        patch[is_table] = table[is_table]


def move_edge(image: Depths, edge_px: float, rng: np.random.Generator) -> None:
    """Move an object's edge outwards here and inwards there, as masks and depth cameras do.

    What is added has the depth of the nearest pixel. How far the edge moves is a smooth random
    field, whose standard deviation is drawn from 0 to `edge_px`; inwards by a pixel at most, or
    handles would be lost, which is `lose`'s part.
    """
    seen = image > 0
    if not seen.any():
        return
    field = ndimage.gaussian_filter(
        rng.standard_normal(image.shape, dtype=np.float32), rng.uniform(*_EDGE_SMOOTHNESS)
    )
    field *= rng.uniform(0.0, edge_px) / field.std()
    # No edge moves farther out than this.
    near = _bounds(seen, math.ceil(max(float(field.max()), 0.0) + 0.5))
    image, seen, field = image[near], seen[near], np.maximum(field[near], -1.0)
    # The edge is half a pixel from the middles of the pixels along it.
    row, column = np.nonzero(~seen & (field > 0.5))
    nearest = ndimage.distance_transform_edt(~seen, return_distances=False, return_indices=True)
    nearest = nearest[:, row, column]
    is_added = np.hypot(*(nearest - (row, column))) - 0.5 < field[row, column]
    image[row[is_added], column[is_added]] = image[tuple(nearest[:, is_added])]
    image[seen & (0.5 - _to_background_px(seen) >= field)] = 0


def _to_background_px(seen: NDArray[np.bool_]) -> Floats:
    """Return how far each pixel is from one that is not seen: 1, √2, or 2 for all that is more.

    What lies outside the image counts as seen. At 2 no edge is moved inwards (`move_edge`).
    """
    padded = np.pad(seen, 1, constant_values=True)
    above, level, below = padded[:-2], padded[1:-1], padded[2:]
    sides = above[:, 1:-1] & below[:, 1:-1] & level[:, :-2] & level[:, 2:]
    corners = above[:, :-2] & above[:, 2:] & below[:, :-2] & below[:, 2:]
    return np.where(sides, np.where(corners, 2.0, math.sqrt(2.0)), 1.0)


def _bounds(seen: NDArray[np.bool_], margin: int = 0) -> tuple[slice, ...]:
    """Return the smallest window around what is seen, and a margin as far as the image goes."""
    (box,) = ndimage.find_objects(seen.view(np.uint8))
    return tuple(slice(max(side.start - margin, 0), side.stop + margin) for side in box)


def lose(image: Depths, draw: Randomisation, rng: np.random.Generator) -> None:
    """Set pixels of one image to 0 that a camera would not measure."""
    if rng.random() < draw.thin:
        _lose_thin_parts(image, rng)
    if rng.random() < draw.inside:
        _lose_inside(image, rng)
    seen = np.flatnonzero(image)
    if not len(seen):
        return
    rows, columns = np.divmod(seen, image.shape[1])
    across, down = np.arange(image.shape[1]), np.arange(image.shape[0])[:, None]
    reach = math.ceil(_PATCH_RADII[1])
    for _ in range(rng.poisson(draw.patches)):
        middle = rng.integers(len(seen))
        radii, turn = rng.uniform(*_PATCH_RADII, 2), rng.uniform(0.0, math.pi)
        row, column = int(rows[middle]), int(columns[middle])
        of_rows, of_columns = (
            slice(max(place - reach, 0), place + reach + 1) for place in (row, column)
        )
        x, y = across[of_columns] - column, down[of_rows] - row
        along = x * math.cos(turn) + y * math.sin(turn)
        across_it = y * math.cos(turn) - x * math.sin(turn)
        image[of_rows, of_columns][(along / radii[0]) ** 2 + (across_it / radii[1]) ** 2 < 1] = 0
    if rng.random() < draw.occluded:
        turn, share = rng.uniform(0.0, 2 * math.pi), rng.uniform(0.02, 0.25)
        place = across * math.cos(turn) + down * math.sin(turn)
        edge = np.quantile(place[rows, columns], share)
        image[place < edge] = 0


def _lose_thin_parts(image: Depths, rng: np.random.Generator) -> None:
    """Lose all thin parts, or one of them, such as a handle."""
    seen = image > 0
    bulk = ndimage.binary_opening(seen, iterations=int(rng.integers(1, 4)))
    thin = seen & ~bulk
    if np.count_nonzero(bulk) < 0.4 * np.count_nonzero(seen):
        return
    if rng.random() < 0.5:
        parts, n_parts = ndimage.label(thin)
        if n_parts:
            thin = parts == rng.integers(1, n_parts + 1)
    image[thin] = 0


def _lose_inside(image: Depths, rng: np.random.Generator) -> None:
    """Lose some of what lies far behind the front, as dark insides are lost."""
    seen = image > 0
    if not seen.any():
        return
    far = image > np.quantile(image[seen], rng.uniform(0.5, 0.95))
    noise = rng.standard_normal(image.shape, dtype=np.float32)
    noise = ndimage.gaussian_filter(noise, rng.uniform(2.0, 8.0))
    image[far & (noise > np.quantile(noise, rng.uniform(0.0, 0.7)))] = 0


def _cropped(depth: Depths, side: int, shift_px: float, rng: np.random.Generator) -> Depths:
    """Return images of a side with what is measured near the middle; what lies outside is cut."""
    cropped = np.zeros((len(depth), side, side), dtype=depth.dtype)
    for image, out in zip(depth, cropped, strict=True):
        seen = image > 0
        if not seen.any():
            continue
        shift = np.rint(rng.normal(0.0, shift_px, 2)).astype(int) if shift_px else (0, 0)
        measured = image[_bounds(seen)]
        first = [(side - n) // 2 + int(by) for n, by in zip(measured.shape, shift, strict=True)]
        kept = tuple(slice(max(-at, 0), max(side - at, 0)) for at in first)
        part = measured[kept]
        rows, columns = (
            slice(max(at, 0), max(at, 0) + n) for at, n in zip(first, part.shape, strict=True)
        )
        out[rows, columns] = part
    return cropped
