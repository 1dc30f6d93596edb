"""examples/ros2_next_view.py with stand-ins for rclpy, message_filters, cv_bridge and messages.

What the stand-ins do is what the documents of ROS 2 Humble and Jazzy say, as far as the node uses
it. So a test finds what changes on our side, and not what changes on theirs.
"""

import json
import runpy
import sys
from dataclasses import asdict
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import nbv

EXAMPLE = Path(__file__).parents[2] / "examples/ros2_next_view.py"
SETTINGS = {"max_travel_deg": 120.0}


class Node:
    def __init__(self, name):
        self.services = {}

    def declare_parameter(self, name, value):
        return SimpleNamespace(value=SETTINGS.get(name, value))

    def create_service(self, kind, name, callback):
        self.services[name] = callback


class Subscriber:
    def __init__(self, node, kind, topic, qos_profile):
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


def image_message(depth_m, encoding):
    pixels = depth_m if encoding == "32FC1" else np.round(1000 * depth_m).astype(np.uint16)
    height, width = depth_m.shape
    return SimpleNamespace(encoding=encoding, height=height, width=width, data=pixels.tobytes())


def info_message(camera):
    return SimpleNamespace(
        k=np.array([camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1.0])
    )


@pytest.fixture
def node(monkeypatch):
    modules = {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {"qos_profile_sensor_data": None},
        "cv_bridge": {"CvBridge": CvBridge},
        "message_filters": {"ApproximateTimeSynchronizer": Synchronizer, "Subscriber": Subscriber},
        "sensor_msgs": {},
        "sensor_msgs.msg": {"CameraInfo": SimpleNamespace, "Image": SimpleNamespace},
        "std_srvs": {},
        "std_srvs.srv": {"Trigger": SimpleNamespace(Request=None, Response=None)},
    }
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    return runpy.run_path(str(EXAMPLE))["NextView"]()


def called(node):
    empty = SimpleNamespace(success=False, message="")
    return node.services["~/recommend"](None, empty)


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
