"""OpenGL's depths, compared with Embree's: two independent ways to the same image."""

import subprocess
import sys

import numpy as np
import pytest
from scipy import ndimage

from nbv.data.camera import Camera
from nbv.data.render import open_renderer
from nbv.errors import UserError
from rendering_shapes import procedural

CATEGORIES = ("airplane", "car", "chair", "mug", "toilet")


@pytest.fixture(scope="module")
def pyrender():
    try:
        return open_renderer("pyrender")
    except UserError as error:
        pytest.skip(str(error))


def smooth(depth, step=0.05):
    """Pixels whose neighbourhood lies on one surface, or wholly on the background; its depth range.

    Elsewhere an edge may pass within rounding of a pixel's centre, and one renderer sees the
    surface before it while the other sees the one behind.
    """
    high = ndimage.maximum_filter(depth, (0, 3, 3))
    low = ndimage.minimum_filter(depth, (0, 3, 3))
    return ((low > 0) & (high - low < step)) | (high == 0), high - low


@pytest.mark.parametrize("framing", ["silhouette", "axis"])
@pytest.mark.parametrize("category", CATEGORIES)
def test_both_renderers_make_the_same_images(embree, pyrender, category, framing):
    shape = procedural(category)
    camera = Camera(framing=framing)
    azimuths = np.arange(0, 360, 30)
    for elevation in (0.0, 45.0):
        ours = embree.render(*shape, elevation, azimuths, camera)
        theirs = pyrender.render(*shape, elevation, azimuths, camera)
        inside, within = smooth(ours)
        assert np.array_equal((ours > 0)[inside], (theirs > 0)[inside])
        visible = inside & (ours > 0)
        assert visible.sum() > 100
        apart = np.abs(ours - theirs)
        # Ridges lower than the step of `smooth` remain inside it: one pixel in a thousand at most.
        assert (apart > 1e-4)[visible].mean() < 1e-3
        # A GPU rounds the corners of faces to 1/256 of a pixel; `within` is of two pixels or more.
        assert (apart > 1e-4 + within / 256)[~inside].mean() < 0.01


def test_depth_is_sampled_at_the_pixels_centre(embree, pyrender):
    """A plane that slopes across the image tells each sample's column, one that slopes down it
    the row: off by a hundredth of a pixel, depth would be off by a hundredth of its slope.
    """
    camera = Camera(framing="axis", image_side=16)
    square = np.array([[0.0, -0.2, -0.2], [0.0, 0.2, -0.2], [0.0, 0.2, 0.2], [0.0, -0.2, 0.2]])
    faces = [[0, 1, 2], [0, 2, 3]]
    for coordinate, image_axis in ((1, 1), (2, 0)):
        tilted = square.copy()
        tilted[:, 0] = square[:, coordinate]
        ours, theirs = (r.render(tilted, faces, 0.0, [0.0], camera)[0] for r in (embree, pyrender))
        middle = (slice(6, 10), slice(6, 10))
        slope = np.abs(np.diff(ours[middle], axis=image_axis)).min()
        assert slope > 0.01
        assert np.abs(ours - theirs)[middle].max() < 0.01 * slope


def test_faces_the_wrong_way_round_are_seen(embree, pyrender):
    vertices, faces = procedural("mug")
    azimuths = [0.0, 100.0]
    there = pyrender.render(vertices, faces, 20.0, azimuths, Camera())
    back = pyrender.render(vertices, faces[:, ::-1], 20.0, azimuths, Camera())
    assert (np.abs(there - back) > 1e-6).mean() < 1e-3


def test_one_renderer_serves_several_sizes_and_objects(pyrender):
    for side in (64, 32, 96):
        for category in ("car", "mug"):
            image = pyrender.render(*procedural(category), 0.0, [10.0], Camera(image_side=side))
            assert image.shape == (1, side, side)
            assert 2.0 < image[image > 0].min() < 2.5


@pytest.mark.slow
@pytest.mark.slow
def test_torchs_compiler_can_be_loaded_after_opengl(pyrender):
    code = (
        "from nbv.data.render import open_renderer; open_renderer('pyrender'); import torch._dynamo"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def run_without_egl(code, **environment):
    program = (
        "import os, sys\n"
        f"os.environ.update({environment!r})\n"
        f"{code}\n"
        "from nbv.errors import UserError\n"
        "from nbv.data.render import open_renderer\n"
        "try:\n"
        "    open_renderer('pyrender')\n"
        "except UserError as error:\n"
        "    print('UserError', error)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("UserError renderer=pyrender")
    return lines[0]


@pytest.mark.parametrize(
    ("code", "environment"),
    [
        ("import ctypes.util; ctypes.util.find_library = lambda name: None", {}),
        ("sys.modules['pyrender'] = None", {}),
        ("", {"EGL_DEVICE_ID": "99"}),
    ],
    ids=["no libEGL", "no pyrender", "no device"],
)
def test_missing_egl_is_one_line_that_says_what_to_do(code, environment):
    line = run_without_egl(code, **environment)
    assert "libegl1" in line
    assert "renderer=embree" in line


def test_another_platform_of_pyopengl_is_named():
    assert "PYOPENGL_PLATFORM=osmesa" in run_without_egl("", PYOPENGL_PLATFORM="osmesa")
