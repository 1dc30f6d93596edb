"""The Python of docs/drivers.md, run with stand-ins for the programs of a robot.

What the stand-ins do is what the documents of librealsense, libfreenect, tf2 and MoveIt say. So a
test finds what changes on our side, and not what changes on theirs.
"""

import re
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import nbv
from nbv.frames.synthetic import Frame

PAGE = Path(__file__).parents[2] / "docs/drivers.md"
SNIPPETS = re.findall(r"^```python\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)
MILLIMETRE = 0.001

# Of the camera in the robot's base: it faces along x, and down by 20 degrees.
POSE = np.eye(4)
POSE[:3, :3] = Rotation.from_euler("y", 20, degrees=True).as_matrix() @ np.array(
    [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
)
POSE[:3, 3] = 0.1, 0.2, 0.5


@pytest.fixture(scope="module")
def frame() -> Frame:
    return nbv.example_frame(azimuth_deg=70.0, elevation_deg=20.0)


@pytest.fixture(scope="module")
def mug() -> nbv.Recommender:
    return nbv.Recommender.load("mug")


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A function that runs a snippet after `given` names, and returns the names that it leaves."""

    def of(snippet: str, modules, **given):
        (code,) = (one for one in SNIPPETS if snippet in one)
        for name, module in modules.items():
            monkeypatch.setitem(sys.modules, name, module)
        (tmp_path / "snippet.py").write_text(code, "utf-8")
        return runpy.run_path(str(tmp_path / "snippet.py"), given)

    return of


def whole_millimetres(frame: Frame) -> np.ndarray:
    return np.round(frame.depth_m / MILLIMETRE).astype(np.uint16)


def on_a_table(frame: Frame) -> np.ndarray:
    """The depth of a frame whose object stands on a table, with half a millimetre of noise."""
    camera, elevation = frame.intrinsics, np.radians(frame.elevation_deg)
    up = np.array([0, -np.cos(elevation), -np.sin(elevation)])
    v, u = np.indices(frame.depth_m.shape)
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1 + 0 * u], axis=-1)
    below = np.percentile((rays * frame.depth_m[..., None])[frame.mask] @ up, 0.5)
    table = below / np.minimum(rays @ up, -1e-6)
    table += np.random.default_rng(0).normal(0, 0.0005, table.shape)
    return np.where(frame.mask, frame.depth_m, np.where(table < 3, table, 0.0))


def test_plane_removal(frame, mug, run) -> None:
    """What is left of an object on a table is the object, but for what touches the table."""
    camera = frame.intrinsics
    given = {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")}
    names = run("off_plane", {}, depth_m=on_a_table(frame), **given)
    assert not (names["mask"] & ~frame.mask).any()
    assert names["mask"].sum() > 0.85 * frame.mask.sum()
    wanted = mug.recommend(frame.depth_m, mask=frame.mask, intrinsics=camera)
    assert names["answer"].azimuth_deg == pytest.approx(wanted.azimuth_deg, abs=10)


def test_segment_anything(frame, mug, run) -> None:
    """The mask with the highest score is the one that is taken."""
    masks = np.stack([frame.mask & False, frame.mask, ~frame.mask])
    predictor = MagicMock()
    predictor.predict.return_value = masks, np.array([0.2, 0.9, 0.5]), None
    module = ModuleType("segment_anything")
    module.SamPredictor = lambda model: predictor
    camera = frame.intrinsics
    given = {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")}
    given |= {"depth_m": frame.depth_m, "model": None, "colour": None, "u": 320, "v": 240}
    names = run("segment_anything", {"segment_anything": module}, **given)
    wanted = mug.recommend(frame.depth_m, mask=frame.mask, intrinsics=camera)
    assert names["answer"].azimuth_deg == pytest.approx(wanted.azimuth_deg)


def test_realsense(frame, mug, run) -> None:
    """Frames in units of the device, intrinsics of the depth stream."""
    depth_mm, camera = whole_millimetres(frame), frame.intrinsics
    realsense = ModuleType("pyrealsense2")
    seen = SimpleNamespace(fx=camera.fx, fy=camera.fy, ppx=camera.cx, ppy=camera.cy)
    profile = SimpleNamespace(as_video_stream_profile=lambda: SimpleNamespace(intrinsics=seen))
    depth = SimpleNamespace(get_data=lambda: depth_mm, profile=profile)
    sensor = SimpleNamespace(get_depth_scale=lambda: MILLIMETRE)
    device = SimpleNamespace(first_depth_sensor=lambda: sensor)
    realsense.pipeline = lambda: SimpleNamespace(
        start=lambda: SimpleNamespace(get_device=lambda: device),
        wait_for_frames=lambda: SimpleNamespace(get_depth_frame=lambda: depth),
    )
    answer = run("pyrealsense2", {"pyrealsense2": realsense})["answer"]
    wanted = mug.recommend(depth_mm, intrinsics=camera, far_m=0.9)
    assert answer.azimuth_deg == pytest.approx(wanted.azimuth_deg)
    assert answer.move == wanted.move


def test_kinect(frame, mug, run) -> None:
    depth_mm = whole_millimetres(frame)
    freenect = ModuleType("freenect")
    freenect.DEPTH_MM = 5
    freenect.sync_get_depth = lambda **given: {5: (depth_mm, 0)}[given["format"]]
    answer = run("freenect", {"freenect": freenect})["answer"]
    wanted = mug.recommend(depth_mm, intrinsics=frame.intrinsics, far_m=0.9)
    assert answer.azimuth_deg == pytest.approx(wanted.azimuth_deg)
    assert answer.move == wanted.move


def test_moveit(frame, run) -> None:
    """The camera goes to a place about the object, and faces it; the second plan succeeds."""
    messages = ModuleType("geometry_msgs.msg")
    messages.Point = messages.Quaternion = SimpleNamespace
    messages.PoseStamped = lambda: SimpleNamespace(header=SimpleNamespace(), pose=SimpleNamespace())
    goals, done = [], []
    arm = SimpleNamespace(
        set_start_state_to_current_state=lambda: None,
        set_goal_state=lambda pose_stamped_msg, pose_link: goals.append(
            (pose_stamped_msg, pose_link)
        ),
        plan=lambda: SimpleNamespace(trajectory="path") if len(goals) == 2 else None,
    )
    planning = ModuleType("moveit.planning")
    planning.MoveItPy = lambda node_name: SimpleNamespace(
        get_planning_component=lambda name: arm,
        execute=lambda trajectory, controllers: done.append(trajectory),
    )
    x, y, z, w = Rotation.from_matrix(POSE[:3, :3]).as_quat()
    found = SimpleNamespace(
        rotation=SimpleNamespace(x=x, y=y, z=z, w=w),
        translation=SimpleNamespace(**dict(zip("xyz", POSE[:3, 3], strict=True))),
    )
    buffer = MagicMock()
    buffer.lookup_transform.return_value = SimpleNamespace(transform=found)
    camera = frame.intrinsics
    modules = {
        **{name: ModuleType(name) for name in ("geometry_msgs", "moveit")},
        **{module.__name__: module for module in (messages, planning)},
    }
    names = run(
        *("moveit", modules),
        buffer=buffer,
        stamp=None,
        depth_m=frame.depth_m,
        mask=frame.mask,
        intrinsics=(camera.fx, camera.fy, camera.cx, camera.cy),
    )
    buffer.lookup_transform.assert_called_once_with("base_link", "camera_depth_optical_frame", None)
    assert done == ["path"]
    assert names["camera_pose"] == pytest.approx(POSE)
    point, moves = names["point"], names["answer"].moves
    # The example's mug stands in the middle of the image, at the distance that it was drawn.
    ahead = np.linalg.inv(POSE) @ [*point, 1.0]
    assert ahead[:2] == pytest.approx([0, 0], abs=0.02)
    for (goal, link), move in zip(goals, moves, strict=False):
        assert (goal.header.frame_id, link) == ("base_link", "camera_depth_optical_frame")
        q, place = goal.pose.orientation, goal.pose.position
        about = Rotation.from_euler("z", move.rotation_deg, degrees=True).as_matrix()
        assert [place.x, place.y, place.z] == pytest.approx(point + about @ (POSE[:3, 3] - point))
        reached = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
        assert reached == pytest.approx(about @ POSE[:3, :3])
