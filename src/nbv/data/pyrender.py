"""The pyrender renderer: OpenGL on EGL, for GPUs and to verify Embree's images.

It draws the same views as Embree, with three precautions:

- pyrender draws into a multisampled buffer and keeps one sample of each pixel, off its centre. It
  is given a buffer with one sample, at the centre; switching multisampling off is not enough for
  NVIDIA's driver.
- It draws the depth of front faces only. Collected meshes have faces of either winding, so each
  face is drawn both ways.
- Depth passes through a 24-bit buffer, so the near and far planes are close to the object.
"""

from __future__ import annotations

import contextlib
import os
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.data.camera import Views
from nbv.data.render import Renderer
from nbv.errors import UserError

# Between the object and the near and far planes, in object diagonals.
_CLEARANCE = 0.01
_INSTALL = (
    "install EGL (Debian: libegl1 libgl1 libgl1-mesa-dri libxrender1) or take renderer=embree"
)


@cache
def _offscreen() -> Any:
    """Return the only OpenGL context: releasing a second one would terminate the first."""
    # Mesa and Triton, which torch's compiler loads, each include LLVM. Triton crashes the process
    # if it is loaded second.
    with contextlib.suppress(ImportError):
        import_module("triton")

    import pyrender
    from OpenGL import GL

    def single_sample(target: int, _: int, kind: int, width: int, height: int) -> None:
        GL.glRenderbufferStorage(target, kind, width, height)

    pyrender.renderer.glRenderbufferStorageMultisample = single_sample
    return pyrender.OffscreenRenderer(1, 1)


class PyrenderRenderer(Renderer):
    """The renderer that draws with OpenGL.

    Raises
    ------
    UserError
        If pyrender or EGL is missing or does not work.
    """

    def __init__(self) -> None:
        # PyOpenGL reads this when it is first imported.
        platform = os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
        if platform != "egl":
            raise UserError(
                f"renderer=pyrender: PYOPENGL_PLATFORM={platform} is set; unset it or set it to egl"
            )
        # Loaders and drivers may raise any exception.
        try:
            self._offscreen = _offscreen()
        except Exception as error:
            reason = " ".join(str(error).split())[:120] or type(error).__name__
            raise UserError(f"renderer=pyrender cannot start ({reason}): {_INSTALL}") from error

    def draw(self, vertices: ArrayLike, faces: ArrayLike, views: Views) -> NDArray[np.float32]:
        """Return depth images (k, side, side): see `nbv.data.render.Renderer`.

        Depths are accurate to 1e-5 object diagonals (24-bit depth buffer). A GPU samples them up to
        1/256 of a pixel off the centre, a median error of 1e-5.
        """
        import pyrender

        camera = views.camera
        side = camera.image_side
        self._offscreen.viewport_width = self._offscreen.viewport_height = side
        front_faces = np.asarray(faces, dtype=np.uint32)
        triangles = pyrender.Primitive(
            positions=np.asarray(vertices, dtype=np.float32),
            indices=np.concatenate([front_faces, front_faces[:, ::-1]]),
            mode=pyrender.constants.GLTF.TRIANGLES,
        )
        scene = pyrender.Scene()
        scene.add(pyrender.Mesh([triangles]))
        near, far = views.nearest - _CLEARANCE, views.farthest + _CLEARANCE
        lens = pyrender.IntrinsicsCamera(
            *(camera.focal_px, camera.focal_px, side / 2, side / 2),
            znear=max(near, _CLEARANCE),
            zfar=far,
        )
        node = scene.add(lens)
        depth = np.empty((len(views.position), side, side), dtype=np.float32)
        for view, (lens.cx, lens.cy) in enumerate(views.principal_px):
            scene.set_pose(node, _pose(views, view))
            depth[view] = self._offscreen.render(scene, pyrender.RenderFlags.DEPTH_ONLY)
        return depth


def _pose(views: Views, view: int) -> NDArray[np.float64]:
    """Return the matrix from OpenGL's camera frame (x right, y up, looking along -z)."""
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1] = views.right[view], views.up[view]
    pose[:3, 2], pose[:3, 3] = -views.forward[view], views.position[view]
    return pose
