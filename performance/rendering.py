"""Depth images per second: Embree against pyrender, the same views of the same meshes."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from nbv.data.camera import Camera, object_views
from nbv.data.meshes import normalise
from nbv.data.procedural import CATEGORIES, generate
from nbv.data.render import open_renderer
from nbv.errors import UserError
from performance.figures import Figure, Target
from performance.timing import Times, on_one_core, take_turns

# By the number of times that every face of a procedural object is divided in four.
TARGETS = {0: Target(4), 2: Target(20)}
CAMERA = Camera()
PLAIN, EMBREE = range(2)
# pyrender's samples lie off the pixels' centres, which moves outlines by less than a pixel.
_AREAS_WITHIN = 0.1

Depths = NDArray[np.float32]


def run(quick: bool) -> list[Figure]:
    # All draw on one core, as a job of the workflow does: software GL would take every core.
    os.environ.setdefault("LP_NUM_THREADS", "0")
    with on_one_core():
        try:
            open_renderer("embree")
            open_renderer("pyrender")
        except UserError as error:
            return [Figure(_name(n), None, t, f"skipped: {error}") for n, t in TARGETS.items()]
        return [_at(n_divisions, quick) for n_divisions in TARGETS]


def _name(n_divisions: int) -> str:
    faces = f"{4**n_divisions} × the faces" if n_divisions else "objects as they are"
    return f"rendering, {faces}: pyrender"


def _at(n_divisions: int, quick: bool) -> Figure:
    n_views = 36 if quick else 360
    rounds, faces = [], []
    for category in list(CATEGORIES)[: 2 if quick else None]:
        mesh = normalise(generate(category, 0, 0), "+z", "+x", 0.0, "box")
        for _ in range(n_divisions):
            mesh = mesh.subdivide()
        faces.append(len(mesh.faces))
        # Drivers compile on first use: the check is their warming up as well.
        _check_same(mesh)
        rounds.append(take_turns(_works(mesh, n_views), 1, warm_up=False).rounds)
    times = Times(np.concatenate(rounds))
    plain, embree = (n_views / times.typical(column) for column in (PLAIN, EMBREE))
    return Figure(
        _name(n_divisions),
        times.ratio(PLAIN, EMBREE),
        TARGETS[n_divisions],
        f"Embree {embree:,.0f}, pyrender {plain:,.0f} images/s; {n_views} views, 64×64, one core; "
        f"{len(rounds)} objects, one a category, of {min(faces):,} to {max(faces):,} faces",
    )


def _works(mesh: trimesh.Trimesh, n_views: int) -> list[Callable[[], Depths]]:
    embree = open_renderer("embree")
    azimuths_deg = np.arange(n_views) * (360.0 / n_views)
    return [
        lambda: plain_pyrender(mesh, azimuths_deg),
        lambda: embree.render(mesh.vertices, mesh.faces, 0.0, azimuths_deg, CAMERA),
    ]


def _check_same(mesh: trimesh.Trimesh) -> None:
    visible = np.array([(work() > 0).mean() for work in _works(mesh, 9)])
    if np.ptp(visible) > _AREAS_WITHIN * visible.max():
        raise RuntimeError(f"the renderers draw different things: {visible} of all pixels visible")


def plain_pyrender(mesh: trimesh.Trimesh, azimuths_deg: ArrayLike) -> Depths:
    """Return depth images as pyrender's documentation has them drawn, framed like the project's."""
    import pyrender

    from nbv.data.pyrender import _offscreen, _pose  # a process can have one context only

    views = object_views(mesh.vertices, mesh.faces, 0.0, azimuths_deg, CAMERA)
    offscreen = _offscreen()
    offscreen.viewport_width = offscreen.viewport_height = CAMERA.image_side
    middle = CAMERA.image_side / 2
    lens = pyrender.IntrinsicsCamera(
        *(CAMERA.focal_px, CAMERA.focal_px, middle, middle),
        znear=views.nearest - 0.01,
        zfar=views.farthest + 0.01,
    )
    scene = pyrender.Scene()
    scene.add(pyrender.Mesh.from_trimesh(mesh))
    node = scene.add(lens)
    side = CAMERA.image_side
    depth = np.empty((len(views.position), side, side), dtype=np.float32)
    for view, (lens.cx, lens.cy) in enumerate(views.principal_px):
        scene.set_pose(node, _pose(views, view))
        depth[view] = offscreen.render(scene, flags=pyrender.RenderFlags.DEPTH_ONLY)
    return depth
