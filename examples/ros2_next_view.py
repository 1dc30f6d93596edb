"""A ROS 2 node that says where the camera goes next; for Humble (Python 3.10) and Jazzy (3.12).

No ROS 2 has run it: tests/pages/test_ros2_example.py runs it with stand-ins for rclpy, tf2_ros,
message_filters, cv_bridge and their messages. It needs ros-<distribution>-cv-bridge,
ros-<distribution>-message-filters, ros-<distribution>-tf2-ros, and nbv with numpy 1, since
cv_bridge does not load with 2:

    python3 -m venv --system-site-packages nbv-env && source nbv-env/bin/activate
    pip install --require-hashes --requirement requirements-robot.lock && pip install --no-deps .
    python examples/ros2_next_view.py --ros-args -p far_m:=0.9 -p base_frame:=base_link \
        -r depth/image:=/camera/camera/depth/image_rect_raw \
        -r depth/info:=/camera/camera/depth/camera_info
    ros2 service call /next_view/recommend std_srvs/srv/Trigger

The topics are those of realsense2_camera; of other drivers, as they name them by default:

    orbbec_camera     /camera/depth/image_raw                /camera/depth/camera_info
    zed_wrapper       /zed/zed_node/depth/depth_registered   /zed/zed_node/depth/camera_info
    depthai_ros       /oak/stereo/image_raw                  /oak/stereo/camera_info

Call the service while the camera stands still. While the verdict of its decision is "one more
view", move the camera to the pose on /next_view/next_pose (or turn it as the answer says), and call
it again: it waits for a frame that was taken after its last answer, and takes it as one more view.
Call /next_view/reset for another object.

With base_frame, tf says where the camera is: the next pose is known, and the rotation between views
is measured. Without it, the camera has to do exactly what the answer says.
"""

import json
import math
from dataclasses import asdict
from threading import Condition

import numpy as np
import rclpy
from cv_bridge import CvBridge
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from message_filters import ApproximateTimeSynchronizer, Subscriber
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.time import Time
from rosidl_runtime_py import message_to_ordereddict
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import CameraInfo, Image
from std_srvs.srv import Trigger
from tf2_ros import Buffer, TransformException, TransformListener

import nbv
from nbv.frames.intrinsics import camera_of_values

UP = (0.0, 0.0, 1.0)  # the object's axis in the base frame


class NextView(Node):
    """Keeps the newest frame, and takes it as a view when the service is called."""

    def __init__(self) -> None:
        super().__init__("next_view")
        self.recommender = nbv.Recommender.load(self.declare_parameter("bundle", "mug").value)
        # Metres: whatever is nearer than this is the object.
        self.far_m = self.declare_parameter("far_m", 0.9).value
        # The arm goes no further, so that it can always do what the answer says.
        self.max_travel_deg = self.declare_parameter("max_travel_deg", 180.0).value
        # Frames of tf; the camera's optical frame is by default that of the image.
        self.base_frame = self.declare_parameter("base_frame", "").value
        self.camera_frame = self.declare_parameter("camera_frame", "").value
        # How long to wait for a frame and for tf.
        self.timeout_s = self.declare_parameter("timeout_s", 5.0).value
        self.newest, self.arrived, self.bridge = None, Condition(), CvBridge()
        self.forget(since=None)
        self.buffer = Buffer()
        self.listener = TransformListener(self.buffer, self)
        # A group of their own: in the service's, frames would wait for the service to return,
        # which waits for a frame.
        group = ReentrantCallbackGroup()
        options = {"qos_profile": qos_profile_sensor_data, "callback_group": group}
        self.inputs = ApproximateTimeSynchronizer(
            [
                Subscriber(self, kind, topic, **options)
                for kind, topic in ((Image, "depth/image"), (CameraInfo, "depth/info"))
            ],
            queue_size=5,
            slop=0.05,  # seconds
        )
        self.inputs.registerCallback(self.keep)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.next_pose = self.create_publisher(PoseStamped, "~/next_pose", latched)
        self.create_service(Trigger, "~/recommend", self.recommend)
        self.create_service(Trigger, "~/reset", self.reset)

    def forget(self, since: Time | None) -> None:
        """Forget the object: the first view of another one is a frame taken after a time."""
        self.views, self.rotations_deg, self.object_m, self.since = [], [0.0], None, since
        self.first_deg = 0.0

    def reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Forget the views, for another object."""
        self.forget(since=self.get_clock().now())
        response.success, response.message = True, "the next frame is the first of an object"
        return response

    def keep(self, image: Image, info: CameraInfo) -> None:
        """Keep the newest frame."""
        with self.arrived:
            self.newest = image, info
            self.arrived.notify_all()

    def is_new(self) -> bool:
        """Whether the newest frame was taken after the last move was asked for."""
        if self.newest is None:
            return False
        return self.since is None or Time.from_msg(self.newest[0].header.stamp) > self.since

    def camera_pose(self, image: Image) -> np.ndarray:
        """Return the pose (4, 4) of the camera in the base frame when an image was taken."""
        found = self.buffer.lookup_transform(
            self.base_frame,
            self.camera_frame or image.header.frame_id,
            Time.from_msg(image.header.stamp),
            Duration(seconds=self.timeout_s),
        ).transform
        pose, q, t = np.eye(4), found.rotation, found.translation
        pose[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
        pose[:3, 3] = t.x, t.y, t.z
        return pose

    def around_deg(self, pose: np.ndarray) -> float:
        """Return where a camera is around the object's axis, degrees in the base frame."""
        x, y, _ = pose[:3, 3] - self.object_m
        return math.degrees(math.atan2(y, x))

    def publish(self, target: np.ndarray, image: Image) -> None:
        """Publish a pose (4, 4) of the camera in the base frame."""
        message = PoseStamped()
        message.header.frame_id, message.header.stamp = self.base_frame, image.header.stamp
        x, y, z, w = Rotation.from_matrix(target[:3, :3]).as_quat()
        message.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
        x, y, z = target[:3, 3]
        message.pose.position = Point(x=x, y=y, z=z)
        self.next_pose.publish(message)

    def recommend(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Take a new frame as a view; answer in JSON, or with one line that says why not."""
        with self.arrived:
            if not self.arrived.wait_for(self.is_new, self.timeout_s):
                response.message = (
                    f"no new frame within {self.timeout_s:g} s: are both topics published, within "
                    "0.05 s, and stamped by this node's clock (use_sim_time with a bag)?"
                )
                return response
            image, info = self.newest
        try:
            self.answer(image, info, response)
        except (nbv.UserError, TransformException) as error:
            response.message = str(error)
        return response

    def answer(self, image: Image, info: CameraInfo, response: Trigger.Response) -> None:
        """Take a frame as a view, and fill in the response."""
        camera = camera_of_values(message_to_ordereddict(info), "depth/info")
        pose = self.camera_pose(image) if self.base_frame else None
        rotations_deg = list(self.rotations_deg)
        if pose is not None and self.views:
            rotations_deg[-1] = self.around_deg(pose) - self.first_deg
        # 16UC1 is millimetres, 32FC1 metres, for ROS and for nbv.
        views = [*self.views, self.bridge.imgmsg_to_cv2(image, "passthrough")]
        answer = self.recommender.recommend(
            views,
            rotations_deg=rotations_deg,
            intrinsics=camera.intrinsics,
            far_m=self.far_m,
            max_travel_deg=self.max_travel_deg,
        )
        warnings = [*answer.warnings, *camera.warnings]
        rotation_deg = None if answer.move is None else float(answer.move.rotation_deg)
        target = None
        if pose is not None:
            object_m = (pose @ [*answer.object_position_m, 1.0])[:3]
            warnings += nbv.check_axis(pose, object_m, UP)
            if not self.views:
                self.object_m = object_m
                self.first_deg = self.around_deg(pose)
            if rotation_deg is not None:
                target = nbv.moved_camera(pose, self.object_m, UP, rotation_deg)
                self.publish(target, image)
        self.views, self.since = views, self.get_clock().now()
        self.rotations_deg = [*rotations_deg, rotations_deg[-1] + (rotation_deg or 0.0)]
        response.success = True
        response.message = json.dumps(
            {
                "decision": asdict(answer.decision),  # its verdict, and the reason
                "rotation_deg": rotation_deg,  # counter-clockwise seen from above
                "target_camera_pose": None if target is None else target.tolist(),
                "azimuth_deg": round(answer.azimuth_deg, 1),
                "expected_error_deg": round(answer.expected_error_deg, 1),
                "rotations_deg": rotations_deg,  # of the views so far, measured or as asked for
                "warnings": warnings,
            }
        )


def main() -> None:
    """Run the node until it is interrupted."""
    rclpy.init()
    node = NextView()
    try:
        # More than one thread: a service that waits in the only one waits for ever.
        rclpy.spin(node, MultiThreadedExecutor())
    except KeyboardInterrupt:
        node.destroy_node()


if __name__ == "__main__":
    main()
