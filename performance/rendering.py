"""Depth images per second: Embree against pyrender, the same views of the same meshes.

pyrender is measured twice: as its documentation uses it, and as the project's own renderer drives
it, which switches multisampling off and draws both sides of every face.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from nbv.data.camera import Camera, object_views
from nbv.data.procedural import CATEGORIES
from nbv.data.render import open_renderer
from nbv.errors import UserError
from performance.figures import Figure, Target
from performance.solids import object_with_faces
from performance.timing import Turns, on_one_core, take_turns

TARGETS = {1_000: Target(3), 10_000: Target(8), 100_000: Target(25)}
CAMERA = Camera()
PLAIN, TUNED, EMBREE = range(3)
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
        return [figure for n_faces in TARGETS for figure in _at(n_faces, quick)]


def _name(n_faces: int) -> str:
    return f"rendering, {n_faces // 1000}k faces: pyrender"


def _at(n_faces: int, quick: bool) -> list[Figure]:
    n_views = 36 if quick else 360
    rounds = []
    for category in list(CATEGORIES)[: 2 if quick else None]:
        mesh = object_with_faces(category, n_faces)
        # Drivers compile on first use: the check is their warming up as well.
        _check_same(mesh)
        rounds.append(take_turns(_works(mesh, n_views), 1, warm_up=False).rounds)
    turns = Turns(np.concatenate(rounds))
    rates = [n_views / turns.typical(column) for column in (PLAIN, TUNED, EMBREE)]
    views = f"{n_views} views, 64×64, one core; median of {len(rounds)} objects, one a category"
    return [
        Figure(
            _name(n_faces),
            turns.ratio(PLAIN, EMBREE),
            TARGETS[n_faces],
            f"Embree {rates[EMBREE]:,.0f}, pyrender {rates[PLAIN]:,.0f} images/s; {views}",
        ),
        Figure(
            f"{_name(n_faces)} as tuned here",
            turns.ratio(TUNED, EMBREE),
            None,
            f"renderer=pyrender of this project: {rates[TUNED]:,.0f} images/s",
        ),
    ]


def _works(mesh: trimesh.Trimesh, n_views: int) -> list[Callable[[], Depths]]:
    embree, tuned = open_renderer("embree"), open_renderer("pyrender")
    azimuths_deg = np.arange(n_views) * (360.0 / n_views)
    scene = mesh.vertices, mesh.faces, 0.0, azimuths_deg, CAMERA
    return [
        lambda: plain_pyrender(mesh, azimuths_deg),
        lambda: tuned.render(*scene),
        lambda: embree.render(*scene),
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
