"""examples/ros2_next_view.py with stand-ins for rclpy, tf2_ros, message_filters and messages.

What the stand-ins do is what the documents of ROS 2 Humble and Jazzy say, as far as the node uses
it. So a test finds what changes on our side, and not what changes on theirs.
"""

import json
import runpy
import sys
import time
from dataclasses import asdict
from pathlib import Path
from threading import Timer
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import nbv

EXAMPLE = Path(__file__).parents[2] / "examples/ros2_next_view.py"
SETTINGS = {"max_travel_deg": 120.0, "timeout_s": 0.2}
OBJECT_M = np.array([0.5, -0.2, 0.1])


class Node:
    def __init__(self, name):
        self.services, self.published = {}, []

    def declare_parameter(self, name, value):
        return SimpleNamespace(value=SETTINGS.get(name, value))

    def create_service(self, kind, name, callback):
        self.services[name] = callback

    def create_publisher(self, kind, name, qos):
        return SimpleNamespace(publish=self.published.append)

    def get_clock(self):
        return SimpleNamespace(now=time.monotonic)


class Subscriber:
    def __init__(self, node, kind, topic, qos_profile, callback_group):
        self.topic = topic


class Synchronizer:
    """Passes on one message of each topic; a test gives those of the same time."""

    def __init__(self, subscribers, queue_size, slop):
        self.topics = [one.topic for one in subscribers]

    def registerCallback(self, callback):  # noqa: N802
        self.callback = callback

    def publish(self, **messages):
        self.callback(*(messages[topic.removeprefix("depth/")] for topic in self.topics))


class CvBridge:
    def imgmsg_to_cv2(self, image, desired_encoding):
        assert desired_encoding == "passthrough"
        kind = {"16UC1": np.uint16, "32FC1": np.float32}[image.encoding]
        return np.frombuffer(image.data, kind).reshape(image.height, image.width)


class Buffer:
    """Holds the camera's pose in the base frame by the stamp of the image."""

    def __init__(self):
        self.poses = {}

    def lookup_transform(self, target, source, stamp, timeout):
        assert (target, source) == ("base", "camera_optical")
        if stamp not in self.poses:
            raise LookupError("no transform")
        pose = self.poses[stamp]
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        rotation = SimpleNamespace(x=x, y=y, z=z, w=w)
        x, y, z = pose[:3, 3]
        translation = SimpleNamespace(x=x, y=y, z=z)
        return SimpleNamespace(
            transform=SimpleNamespace(rotation=rotation, translation=translation)
        )


class Time:
    @staticmethod
    def from_msg(stamp):
        return stamp


class PoseStamped:
    def __init__(self):
        self.header, self.pose = SimpleNamespace(), SimpleNamespace()


def image_message(depth_m, encoding):
    pixels = depth_m if encoding == "32FC1" else np.round(1000 * depth_m).astype(np.uint16)
    height, width = depth_m.shape
    header = SimpleNamespace(stamp=time.monotonic(), frame_id="camera_optical")
    return SimpleNamespace(
        header=header, encoding=encoding, height=height, width=width, data=pixels.tobytes()
    )


def info_message(camera, **more):
    k = [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1.0]
    roi = {"x_offset": 0, "y_offset": 0, "width": 0, "height": 0}
    shape = {"width": 640, "height": 480, "binning_x": 0, "binning_y": 0, "roi": roi}
    return {"k": k, "d": [0.0] * 5} | shape | more


def camera_at(azimuth_deg, elevation_deg=15.0, distance_m=0.8):
    """Pose of a camera that points at the object, z forward and y down."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    away = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(-away, right), -away], axis=1)
    pose[:3, 3] = OBJECT_M + distance_m * away
    return pose


@pytest.fixture
def node(monkeypatch):
    stand_in = SimpleNamespace
    modules = {
        "rclpy": {},
        "rclpy.callback_groups": {"ReentrantCallbackGroup": stand_in},
        "rclpy.duration": {"Duration": stand_in},
        "rclpy.executors": {"MultiThreadedExecutor": stand_in},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {
            "qos_profile_sensor_data": None,
            "QoSProfile": stand_in,
            "DurabilityPolicy": stand_in(TRANSIENT_LOCAL=None),
        },
        "rclpy.time": {"Time": Time},
        "rosidl_runtime_py": {"message_to_ordereddict": dict},
        "cv_bridge": {"CvBridge": CvBridge},
        "geometry_msgs": {},
        "geometry_msgs.msg": {
            "Point": stand_in,
            "PoseStamped": PoseStamped,
            "Quaternion": stand_in,
        },
        "message_filters": {"ApproximateTimeSynchronizer": Synchronizer, "Subscriber": Subscriber},
        "sensor_msgs": {},
        "sensor_msgs.msg": {"CameraInfo": stand_in, "Image": stand_in},
        "std_srvs": {},
        "std_srvs.srv": {"Trigger": stand_in(Request=None, Response=None)},
        "tf2_ros": {
            "Buffer": Buffer,
            "TransformException": LookupError,
            "TransformListener": lambda buffer, node: None,
        },
    }
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    return runpy.run_path(str(EXAMPLE))["NextView"]()


def called(node, service="~/recommend"):
    empty = SimpleNamespace(success=False, message="")
    return node.services[service](None, empty)


@pytest.mark.parametrize("encoding", ["16UC1", "32FC1"])
def test_the_camera_goes_where_the_answer_says_and_the_second_view_is_fused(node, encoding):
    start_deg = 75.0
    frames = [nbv.example_frame(start_deg)]
    node.inputs.publish(
        image=image_message(frames[0].depth_m, encoding), info=info_message(frames[0].intrinsics)
    )
    first = json.loads(called(node).message)
    assert abs(first["rotation_deg"]) <= SETTINGS["max_travel_deg"]
    assert not called(node).success  # that frame is used up
    frames.append(nbv.example_frame(start_deg + first["rotation_deg"]))
    node.inputs.publish(
        image=image_message(frames[1].depth_m, encoding), info=info_message(frames[1].intrinsics)
    )
    second = json.loads(called(node).message)
    wanted = nbv.Recommender.load("mug").recommend(
        [np.round(frame.depth_m, 3) if encoding == "16UC1" else frame.depth_m for frame in frames],
        rotations_deg=[0.0, first["rotation_deg"]],
        intrinsics=frames[0].intrinsics,
        far_m=0.9,
        max_travel_deg=SETTINGS["max_travel_deg"],
    )
    assert second["azimuth_deg"] == round(wanted.azimuth_deg, 1)
    assert second["rotation_deg"] == wanted.move.rotation_deg
    assert first["decision"]["verdict"] == "one more view"
    assert second["decision"] == asdict(wanted.decision)
    assert abs(second["azimuth_deg"] - frames[1].azimuth_deg) < 10


def test_a_frame_that_cannot_be_used_is_named_and_the_next_one_taken(node):
    frame = nbv.example_frame()
    info = info_message(frame.intrinsics)
    node.inputs.publish(image=image_message(0 * frame.depth_m, "16UC1"), info=info)
    refused = called(node)
    assert not refused.success
    assert refused.message.startswith("empty-mask")
    node.inputs.publish(image=image_message(frame.depth_m, "16UC1"), info=info)
    assert called(node).success


def published(node, azimuth_deg, pose=None, **info):
    frame = nbv.example_frame(azimuth_deg)
    image = image_message(frame.depth_m, "32FC1")
    if pose is not None:
        node.buffer.poses[image.header.stamp] = pose
    node.inputs.publish(image=image, info=info_message(frame.intrinsics, **info))


def test_the_move_that_was_made_is_measured_and_the_next_pose_is_published(node):
    """The camera stops 20° early; the next pose is that of a rotation about the object."""
    node.base_frame = "base"
    published(node, 75.0, camera_at(75.0))
    first = json.loads(called(node).message)
    assert next(iter(first)) == "decision"
    (target,) = node.published
    wanted = camera_at(75.0 + first["rotation_deg"])
    assert np.array(first["target_camera_pose"]) == pytest.approx(wanted, abs=0.02)
    position = [getattr(target.pose.position, axis) for axis in "xyz"]
    assert position == pytest.approx(np.array(first["target_camera_pose"])[:3, 3])
    assert target.header.frame_id == "base"
    made = first["rotation_deg"] - np.copysign(20.0, first["rotation_deg"])
    published(node, 75.0 + made, camera_at(75.0 + made))
    second = json.loads(called(node).message)
    apart = (second["rotations_deg"][1] - made + 180) % 360 - 180
    assert abs(apart) < 2
    assert abs(second["azimuth_deg"] - (75.0 + made) % 360) < 10


def test_a_frame_of_before_the_answer_is_no_further_view(node):
    """It may have waited while the answer was computed; one that comes later is taken."""
    old = nbv.example_frame(75.0)
    late = image_message(old.depth_m, "32FC1")
    published(node, 75.0)
    assert called(node).success
    node.inputs.publish(image=late, info=info_message(old.intrinsics))
    assert called(node).message.startswith("no new frame within 0.2 s")
    node.timeout_s = 30.0
    later = Timer(0.2, published, (node, 171.0))
    later.start()
    assert called(node).success
    later.join()


def test_another_object_starts_with_a_new_frame(node):
    published(node, 75.0)
    first = called(node)
    assert called(node, "~/reset").success
    assert not called(node).success
    published(node, 75.0)
    again = json.loads(called(node).message)
    assert again == json.loads(first.message)


def test_what_is_wrong_is_one_line_or_a_warning(node):
    published(node, 75.0, d=[0.1, 0.0, 0.0, 0.0, 0.0])
    assert any("distortion" in line for line in json.loads(called(node).message)["warnings"])
    node.base_frame = "base"
    published(node, 75.0)
    assert called(node).message == "no transform"
