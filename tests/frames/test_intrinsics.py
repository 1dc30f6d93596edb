"""Intrinsics from numbers and from the camera files that are in use."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from nbv.errors import FrameError, UserError
from nbv.frames.intrinsics import DepthCamera, Intrinsics, as_intrinsics, camera_of

FX, FY, CX, CY = 572.41, 573.57, 325.26, 242.05
K = [FX, 0.0, CX, 0.0, FY, CY, 0.0, 0.0, 1.0]
WANTED = Intrinsics(FX, FY, CX, CY)
SIZED = Intrinsics(FX, FY, CX, CY, 640, 480)

pixels = st.floats(0.1, 1e5)


def as_json(value):
    return json.dumps(value)


ROS_INFO = f"""\
header:
  stamp: {{sec: 1, nanosec: 0}}
  frame_id: camera_depth_optical_frame
height: 480
width: 640
distortion_model: plumb_bob
d: [0.0, 0.0, 0.0, 0.0, 0.0]
k: {K}
r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
p: [1.0, 0.0, 2.0, 0.0, 0.0, 3.0, 4.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
CALIBRATION = {
    "image_width": 640,
    "image_height": 480,
    "camera_name": "head",
    "camera_matrix": {"rows": 3, "cols": 3, "data": K},
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.0] * 5},
}
OPENCV = f"""\
%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: {K}
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
"""
OPEN3D = {
    "height": 480,
    "width": 640,
    "intrinsic_matrix": np.reshape(K, (3, 3)).T.ravel().tolist(),
}
FILES = {
    "opencv.yml": (OPENCV, SIZED),
    "opencv-nested.yaml": (as_json({"camera_matrix": np.reshape(K, (3, 3)).tolist()}), WANTED),
    # BOP: one camera for all images, and one of scene_camera.json.
    "camera.json": (
        as_json({"cx": CX, "cy": CY, "depth_scale": 0.1, "fx": FX, "fy": FY}).replace(
            "}", ', "height": 480, "width": 640}'
        ),
        SIZED,
    ),
    "bop.json": (as_json({"cam_K": K, "depth_scale": 1.0}), WANTED),
    "info.yaml": (ROS_INFO, SIZED),
    # As `ros2 topic echo --once` prints it.
    "echo.yaml": (ROS_INFO + "---\n", SIZED),
    "ros1.yml": (ROS_INFO.replace("\nk:", "\nK:").replace("\nd:", "\nD:"), SIZED),
    "calibration.yaml": (yaml.safe_dump(CALIBRATION), SIZED),
    # Open3D writes a matrix column by column, alone or as the intrinsics of a camera.
    "open3d.json": (as_json(OPEN3D), SIZED),
    "open3d_camera.json": (as_json({"extrinsic": [1.0] * 16, "intrinsic": OPEN3D}), SIZED),
    "nested.json": (as_json({"K": np.reshape(K, (3, 3)).tolist()}), WANTED),
    "numbers.txt": (f"fx: {FX}\nfy: {FY}\ncx: {CX}\ncy: {CY}\n", WANTED),
}


@pytest.mark.parametrize("name", FILES)
def test_every_camera_file_gives_the_same_camera(tmp_path, name):
    text, wanted = FILES[name]
    for encoding in ("utf-8", "utf-8-sig"):
        (tmp_path / name).write_text(text, encoding=encoding)
        assert camera_of(str(tmp_path / name)).intrinsics == wanted


@pytest.mark.parametrize(("name", "form"), [("cam_K.txt", "%.18e"), ("K.txt", "%g"), ("K", "%.2f")])
def test_a_matrix_alone_may_be_a_file(tmp_path, name, form):
    np.savetxt(tmp_path / name, np.reshape(K, (3, 3)), form)
    np.save(tmp_path / "K.npy", np.reshape(K, (3, 3)))
    assert camera_of(str(tmp_path / name)) == camera_of(str(tmp_path / "K.npy"))
    assert camera_of(str(tmp_path / name)).intrinsics == WANTED


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("d", [0.1, 0, 0, 0, 0]),
        ("D", [0, 0, 0, 0, -0.2]),
        ("dist_coeff", [[0.0, 0.1]]),
        ("dist_coeffs", [0.1]),
        ("distortion_coefficients", {"rows": 1, "cols": 2, "data": [0.1, 0]}),
        ("k1", 0.1),
        ("k2", 0.0),
        ("distortion_model", "plumb_bob"),
    ],
)
def test_distortion_that_is_not_0_is_told(tmp_path, name, value):
    (tmp_path / "a.yaml").write_text(yaml.safe_dump({"K": K, name: value}))
    found = camera_of(str(tmp_path / "a.yaml"))
    assert found.intrinsics == WANTED
    is_told = name not in ("k2", "distortion_model")
    assert [f"({name})" in warning for warning in found.warnings] == [True] * is_told


@given(f=pixels)
def test_one_number_is_both_focal_lengths(f):
    assert as_intrinsics(f) == as_intrinsics([f]) == Intrinsics(f, f)
    assert camera_of(repr(f)) == DepthCamera(Intrinsics(f, f))


@given(fx=pixels, fy=pixels, cx=pixels, cy=pixels)
def test_numbers_a_matrix_and_a_text_say_the_same(fx, fy, cx, cy):
    wanted = Intrinsics(fx, fy, cx, cy)
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    assert as_intrinsics((fx, fy, cx, cy)) == wanted
    assert as_intrinsics(matrix) == as_intrinsics(matrix.ravel().tolist()) == wanted
    assert camera_of(f"{fx!r}, {fy!r},{cx!r} ,{cy!r}").intrinsics == wanted
    assert camera_of(f"{fx!r} {fy!r}  {cx!r} {cy!r}").intrinsics == wanted
    assert camera_of(",".join(map(repr, matrix.ravel().tolist()))).intrinsics == wanted
    assert as_intrinsics(wanted) is wanted


@pytest.mark.parametrize(
    "matrix",
    [np.reshape(K, (3, 3)).T, np.reshape(K, (3, 3)) / 2],
    ids=["transposed", "scaled"],
)
def test_what_is_no_camera_matrix_is_refused(matrix):
    with pytest.raises(UserError, match="0 0 1"):
        as_intrinsics(matrix)


@pytest.mark.parametrize(
    "value",
    [[], [1, 2], [1, 2, 3], [1] * 5, np.eye(4), "abc", ["a"] * 4, None, {"fx": 1}, [[1], [2, 3]]],
    ids=repr,
)
def test_rubbish_is_one_line(value):
    with pytest.raises(UserError, match="intrinsics") as error:
        as_intrinsics(value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("bad", [0.0, -575.0, float("nan"), float("inf")])
def test_focal_lengths_are_above_0(bad):
    for numbers in ([bad], [bad, FY, CX, CY], [FX, bad, CX, CY]):
        with pytest.raises(UserError, match="must be above 0"):
            as_intrinsics(numbers)


@pytest.mark.parametrize(("known", "missing"), [("cx", "cy"), ("cy", "cx")])
def test_half_a_principal_point_is_none(known, missing):
    with pytest.raises(UserError, match=f"{known} without {missing}"):
        Intrinsics(FX, FY, **{known: 320.0})


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_the_principal_point_is_finite(bad):
    with pytest.raises(UserError, match="cx="):
        as_intrinsics([FX, FY, bad, CY])
    with pytest.raises(UserError, match="cy="):
        as_intrinsics([FX, FY, CX, bad])


SCENE = {
    "3": {"cam_K": K, "depth_scale": 0.1, "cam_R_w2c": [1, 0, 0, 0, 1, 0, 0, 0, 1]},
    "12": {"cam_K": [2 * value for value in K[:8]] + [1], "depth_scale": 1.0},
}


def test_a_scene_has_a_camera_for_each_image(tmp_path):
    path = tmp_path / "scene_camera.json"
    path.write_text(json.dumps(SCENE))
    for frame in ("000003.png", "depth/3.png", Path("scene/depth_0003.tif")):
        found = camera_of(str(path), frame)
        assert found.intrinsics == WANTED
        assert found.unit_m == pytest.approx(1e-4)
    other = camera_of(str(path), "000012.png")
    assert other.intrinsics == Intrinsics(2 * FX, 2 * FY, 2 * CX, 2 * CY)
    assert other.unit_m == 0.001
    for frame in ("000004.png", "depth.png", "12_depth.png", ""):
        with pytest.raises(UserError, match="cameras for images 3 to 12 but not for"):
            camera_of(str(path), frame)


def test_where_all_images_have_one_camera_the_name_does_not_matter(tmp_path):
    path = tmp_path / "scene_camera.json"
    path.write_text(json.dumps({str(image): SCENE["3"] for image in range(5)}))
    assert camera_of(str(path), "frame.png") == camera_of(str(path), "000004.png")
    assert camera_of(str(path), "frame.png").intrinsics == WANTED


def test_a_camera_file_says_what_whole_numbers_count(tmp_path):
    path = tmp_path / "camera.json"
    for scale in (0.1, 1.0, 2, 0.25):
        path.write_text(json.dumps({"cam_K": K, "depth_scale": scale}))
        assert camera_of(str(path)).unit_m == pytest.approx(scale / 1000)
    for scale in ("0.1", 0, -1, True, float("nan"), [1]):
        path.write_text(json.dumps({"cam_K": K, "depth_scale": scale}))
        with pytest.raises(UserError, match=r"camera\.json: depth_scale="):
            camera_of(str(path))


def test_nothing_is_known_of_a_camera_that_is_not_given():
    assert camera_of(None, "frame.png") == DepthCamera(None, 0.001)


@pytest.mark.parametrize("text", ["no.json", "no/camera", "camera.yaml"])
def test_a_missing_camera_file_is_said_to_be_missing(tmp_path, monkeypatch, text):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=f"`intrinsics`={text}: the file does not exist"):
        camera_of(text)


BAD_FILES = {
    "scene.json": '{"0": [1, 2], "1": {}}',
    "empty.json": "",
    "number.yaml": "575",
    "other.json": '{"camera": "head"}',
    "half.json": '{"fx": 1, "fy": 1, "cx": 1}',
    "text.json": '{"cam_K": "wide"}',
    "infinite.json": as_json({"cam_K": K}).replace("}", ', "width": Infinity, "height": 480}'),
    "nodata.yaml": "camera_matrix: {rows: 3}",
    "code.yaml": "!!python/object/apply:os.getcwd []",
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_file_without_a_camera_is_one_line(tmp_path, name):
    (tmp_path / name).write_text(BAD_FILES[name])
    with pytest.raises(UserError, match=name) as error:
        camera_of(str(tmp_path / name))
    assert "\n" not in str(error.value)


def test_a_camera_that_is_not_calibrated_is_said_to_be_so(tmp_path):
    (tmp_path / "info.yaml").write_text(f"width: 640\nheight: 480\nk: {[0.0] * 9}\n")
    with pytest.raises(UserError, match=r"info\.yaml: .* the camera is not calibrated"):
        camera_of(str(tmp_path / "info.yaml"))
    with pytest.raises(UserError, match="the camera is not calibrated"):
        as_intrinsics(np.zeros((3, 3)))


@pytest.mark.parametrize("name", ["fx", "fy", "cx", "cy", "width", "height"])
def test_every_parameter_is_a_number(name):
    given_ = {"fx": 575.0, "fy": 575.0, "cx": 320.0, "cy": 240.0} | {name: "575"}
    with pytest.raises(UserError, match=f"intrinsics: {name}: '575' is not a number"):
        Intrinsics(**given_)


@pytest.mark.parametrize("side", ["width", "height"])
@pytest.mark.parametrize("value", [0, -480])
def test_an_image_has_a_size(tmp_path, side, value):
    message = f"intrinsics: {side}={value} must be above 0 \\(pixels\\)"
    sides = {"width": 640, "height": 480} | {side: value}
    with pytest.raises(UserError, match=message):
        Intrinsics(575.0, 575.0, **sides)
    for name, values in (("a.json", {"cam_K": K}), ("a.yaml", {"k": K})):
        (tmp_path / name).write_text(as_json(values | sides))
        with pytest.raises(UserError, match=f"{name}: {message}"):
            camera_of(str(tmp_path / name))


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.json", '{"fx": 585,\n "fy": }', "line 2, column 8 is not JSON; correct it there"),
        ("a.json", "[" * 100_000, "it is nested too deeply"),
        ("a.yaml", "fx: 585\nfy: [585\n", "line 3, column 1 is not YAML; correct it there"),
        ("a.yaml", "fx: 585\0", "it is not YAML"),
    ],
)
def test_where_a_camera_file_is_broken_is_said(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(UserError) as error:
        camera_of(str(tmp_path / name))
    assert str(error.value) == f"{tmp_path / name} cannot be read ({message})"


def test_intrinsics_of_another_resolution_are_refused():
    SIZED.check_resolution(480, 640)
    for rows, columns in ((240, 320), (640, 480), (480, 641)):
        with pytest.raises(FrameError, match="640 × 480 pixels") as error:
            SIZED.check_resolution(rows, columns)
        assert error.value.name == "other-resolution"


def test_a_principal_point_far_outside_is_of_another_resolution():
    WANTED.check_resolution(480, 640)
    # A crop of an image keeps its intrinsics, so that its own middle may lie off the frame a bit.
    WANTED.check_resolution(200, 300)
    for rows, columns in ((480, 200), (120, 640)):
        with pytest.raises(FrameError, match="this resolution") as error:
            WANTED.check_resolution(rows, columns)
        assert error.value.name == "other-resolution"


@given(rows=st.integers(1, 5000), columns=st.integers(1, 5000))
def test_focal_lengths_alone_serve_every_resolution(rows, columns):
    Intrinsics(575.0, 575.0).check_resolution(rows, columns)
    Intrinsics(575.0, 575.0, columns / 2, rows / 2, columns, rows).check_resolution(rows, columns)


@given(factor=st.floats(0.3, 2.9), off=st.floats(-8, 8))
def test_a_principal_point_in_the_middle_of_another_image_is_refused(factor, off):
    """Binned, cut in half or doubled: a camera's own tolerance is neither refused nor doubted."""
    camera = Intrinsics(FX * factor, FY * factor, (320 + off) * factor, (240 + off) * factor)
    if abs(factor - 1) < 0.1:
        camera.check_resolution(480, 640)
        assert not camera.doubts(480, 640)
    elif abs(factor - 1) > 0.25:
        with pytest.raises(FrameError, match="640 × 480") as error:
            camera.check_resolution(480, 640)
        assert error.value.name == "other-resolution"


def test_a_principal_point_off_the_middle_is_doubted():
    assert not WANTED.doubts(480, 640)
    assert not Intrinsics(575.0, 575.0).doubts(480, 640)
    for place in ((500.0, 240.0), (320.0, 100.0), (520.0, 100.0)):
        camera = Intrinsics(FX, FY, *place)
        camera.check_resolution(480, 640)
        (doubt,) = camera.doubts(480, 640)
        assert "640 × 480" in doubt
        assert "cut out" in doubt


@pytest.mark.parametrize("order", [(0, 2, 1, 3), (2, 3, 0, 1), (0, 1, 3, 2)])
@given(
    f=st.floats(200, 1500),
    off=st.floats(-0.05, 0.05),
    size=st.sampled_from([(480, 640), (720, 1280)]),
)
def test_numbers_in_another_order_are_named(order, f, off, size):
    """Both orders are named; numbers that fit as they are stay what they are."""
    rows, columns = size
    right = (f, f * 1.02, (0.5 + off) * columns, (0.5 - off) * rows)
    as_intrinsics(right).check_resolution(rows, columns)
    wrong = [right[i] for i in order]
    names = ",".join(["fx", "fy", "cx", "cy"][i] for i in order)
    if abs(wrong[2] / columns - 0.5) < 0.1 and abs(wrong[3] / rows - 0.5) < 0.1:
        return
    with pytest.raises(FrameError, match=f"as fx,fy,cx,cy .* as {names} they do: give") as error:
        as_intrinsics(wrong).check_resolution(rows, columns)
    given_ = [float(number) for number in str(error.value).rpartition("give ")[2].split(",")]
    assert given_ == pytest.approx(right, rel=1e-4)


@pytest.mark.parametrize("scale", [0.25, 1 / 3, 0.5, 2 / 3, 1.5, 2.0])
@given(x=st.floats(-0.09, 0.09), y=st.floats(-0.09, 0.09))
def test_a_principal_point_near_the_centre_of_a_usual_scale_is_refused(scale, x, y):
    camera = Intrinsics(600.0, 600.0, scale * (1 + x) * 320 - 0.5, scale * (1 + y) * 240 - 0.5)
    with pytest.raises(FrameError, match="the centre of an image") as error:
        camera.check_resolution(480, 640)
    assert error.value.name == "other-resolution"


@pytest.mark.parametrize(
    ("cx", "cy"),
    [
        *((644.2, 361.4), (638, 367), (424.3, 238.7), (212.1, 119.4), (322, 181), (255.5, 191.5)),
        *((0, 0), (0, 239.5), (-319.5, 239.5), (319.5, -1)),
    ],
)
def test_a_principal_point_of_another_shape_or_not_above_0_is_refused(cx, cy):
    """1280 × 720, 848 × 480, 424 × 240, 640 × 360 and 512 × 384 pixels; their own size is right."""
    with pytest.raises(FrameError, match=r"the principal point .* its own width and height"):
        Intrinsics(600.0, 600.0, cx, cy).check_resolution(480, 640)
    Intrinsics(600.0, 600.0, cx, cy, 640, 480).check_resolution(480, 640)


INFO = {"width": 640, "height": 480, "k": K}
ROI = {"x_offset": 100, "y_offset": 40, "width": 400, "height": 300, "do_rectify": False}


@pytest.mark.parametrize(
    ("more", "size", "scale", "offset"),
    [
        ({}, (480, 640), 1, (0, 0)),
        ({"binning_x": 0, "binning_y": 1, "roi": dict.fromkeys(ROI, 0)}, (480, 640), 1, (0, 0)),
        ({"binning_x": 2, "binning_y": 2}, (240, 320), 2, (0, 0)),
        ({"binning_x": 2, "binning_y": 2}, (480, 640), 1, (0, 0)),
        ({"roi": ROI}, (300, 400), 1, (100, 40)),
        ({"roi": ROI}, (480, 640), 1, (0, 0)),
        ({"roi": ROI, "binning_x": 2, "binning_y": 2}, (150, 200), 2, (100, 40)),
    ],
)
def test_binning_and_roi_count_for_frames_of_their_size(tmp_path, more, size, scale, offset):
    """A point of the scene is where it was, in pixels that are larger or counted from elsewhere."""
    (tmp_path / "info.yaml").write_text(as_json(INFO | more))
    found = camera_of(str(tmp_path / "info.yaml")).intrinsics.of_size(*size)
    found.check_resolution(*size)
    x, y = 0.1, -0.05
    column, row = FX * x + CX - offset[0], FY * y + CY - offset[1]
    wanted = (column + 0.5) / scale - 0.5, (row + 0.5) / scale - 0.5
    assert (found.fx * x + found.cx, found.fy * y + found.cy) == pytest.approx(wanted)


def test_a_frame_of_neither_size_is_refused(tmp_path):
    (tmp_path / "info.yaml").write_text(as_json(INFO | {"binning_x": 2, "binning_y": 2}))
    camera = camera_of(str(tmp_path / "info.yaml")).intrinsics
    with pytest.raises(FrameError, match="are for 640 × 480 pixels, the frame has 160 × 120"):
        camera.of_size(120, 160).check_resolution(120, 160)
