"""The Embree renderer: a ray through each pixel centre, without OpenGL, the same on any CPU.

Embree is called directly. Trimesh's interface shifts and scales vertices, splits rays needlessly,
and silently falls back to a caster a thousand times slower if Embree is missing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.data.camera import Views
from nbv.data.render import Renderer
from nbv.errors import UserError

# Rays in a call of Embree: many to amortise the call, few to stay within the processor's cache.
_RAYS_PER_CALL = 65_536
# Embree's length of a ray without a hit is at least this.
_NOTHING = 1e30


class EmbreeRenderer(Renderer):
    """The default renderer.

    Raises
    ------
    UserError
        If embreex is not installed.
    """

    def __init__(self) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore import EmbreeDevice
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise UserError(
                f"renderer=embree: the library embreex cannot be imported ({error}); install it, "
                "or take renderer=pyrender where it has no wheel (aarch64)"
            ) from error
        self._scene = EmbreeScene
        self._triangles = TriangleMesh
        self._device = EmbreeDevice()

    def draw(self, vertices: ArrayLike, faces: ArrayLike, views: Views) -> NDArray[np.float32]:
        """Return depth images (k, side, side): see `nbv.data.render.Renderer`.

        Depths are good to 1e-5 object diagonals (single precision).
        """
        # robust=True: a ray along an edge between two faces hits one of them.
        scene = self._scene(self._device, robust=True)
        self._triangles(
            scene,
            np.ascontiguousarray(vertices, dtype=np.float32),
            np.ascontiguousarray(faces, dtype=np.int32),
        )
        side = views.camera.image_side
        depth = np.zeros((len(views.position), side, side), dtype=np.float32)
        windows = _pixel_windows(views)
        rays = _RayBuffer(views)
        for view, window in enumerate(windows):
            if rays.is_full_for(window):
                rays.cast(scene, depth)
            rays.add(view, window)
        rays.cast(scene, depth)
        return depth


Window = tuple[int, int, int, int]


def _pixel_windows(views: Views) -> list[Window]:
    """Return the columns (first, end) and rows (first, end) of each view's outline."""
    # Up to a pixel more than the outline on each side, never less due to rounding.
    first = np.floor(views.outline_px[:, 0::2] - 0.5)
    last = np.ceil(views.outline_px[:, 1::2] + 0.5)
    first_last = np.stack([first[:, 0], last[:, 0], first[:, 1], last[:, 1]], axis=1)
    limited = np.clip(first_last, 0, views.camera.image_side).astype(int)
    return [(int(a), int(b), int(c), int(d)) for a, b, c, d in limited]


class _RayBuffer:
    """Rays of several views, cast together.

    A ray's direction has unit length along the optical axis, so that its parameter is the depth.
    """

    def __init__(self, views: Views) -> None:
        camera = views.camera
        capacity = max(_RAYS_PER_CALL, camera.image_side**2)
        self._origins = np.empty((capacity, 3), dtype=np.float32)
        self._directions = np.empty((capacity, 3), dtype=np.float32)
        self._used = 0
        self._pending: list[tuple[int, Window]] = []
        # Origins of a row of pixels: repeated coordinates of the pinhole.
        self._position = np.tile(views.position.astype(np.float32), camera.image_side)
        centres = np.arange(camera.image_side) + 0.5
        column, row = views.principal_px.T[:, :, None]
        # Separable: direction[i, j] = across[:, j] + down[:, i], in double precision until here.
        x = (centres - column) / camera.focal_px
        y = (row - centres) / camera.focal_px
        across = views.forward[..., None] + x[:, None] * views.right[..., None]
        down = y[:, None] * views.up[..., None]
        self._across = across.astype(np.float32)
        self._down = down.astype(np.float32)

    def is_full_for(self, window: Window) -> bool:
        left, right, top, bottom = window
        return self._used + (right - left) * (bottom - top) > len(self._origins)

    def add(self, view: int, window: Window) -> None:
        left, right, top, bottom = window
        columns, rows = right - left, bottom - top
        count = columns * rows
        taken = slice(self._used, self._used + count)
        self._origins[taken].reshape(rows, 3 * columns)[:] = self._position[view, : 3 * columns]
        # Coordinate by coordinate, so that numpy's inner loop is a row of pixels.
        grid = np.moveaxis(self._directions[taken].reshape(rows, columns, 3), 2, 0)
        across = self._across[view, :, None, left:right]
        np.add(across, self._down[view, :, top:bottom, None], out=grid)
        self._pending.append((view, window))
        self._used += count

    def cast(self, scene: object, depth: NDArray[np.float32]) -> None:
        """Write the depths of all rays added since the last call into `depth`."""
        length = scene.run(  # type: ignore[attr-defined]
            self._origins[: self._used], self._directions[: self._used], query="DISTANCE"
        )
        length[length > _NOTHING] = 0.0
        start = 0
        for view, (left, right, top, bottom) in self._pending:
            end = start + (right - left) * (bottom - top)
            patch = length[start:end].reshape(bottom - top, right - left)
            depth[view, top:bottom, left:right] = patch
            start = end
        self._pending.clear()
        self._used = 0
