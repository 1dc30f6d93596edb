"""A ROS 2 node that says how far to turn the camera; for Humble (Python 3.10) and Jazzy (3.12).

No ROS 2 has run it: tests/pages/test_ros2_example.py runs it with stand-ins for rclpy,
message_filters, cv_bridge and their messages. It needs ros-<distribution>-cv-bridge,
ros-<distribution>-message-filters, and nbv with numpy 1, since cv_bridge does not load with 2:

    python3 -m venv --system-site-packages nbv-env && source nbv-env/bin/activate
    pip install --require-hashes --requirement requirements-robot.lock && pip install --no-deps .
    python examples/ros2_next_view.py --ros-args -p far_m:=0.9 \
        -r depth/image:=/camera/depth/image_rect_raw -r depth/info:=/camera/depth/camera_info
    ros2 service call /next_view/recommend std_srvs/srv/Trigger

Call the service while the camera stands still. While the verdict of its decision is "one more
view", turn the camera as the answer says, and call it again: the frame is then taken as one more
view. Start the node again for another object.
"""

import dataclasses
import json

import numpy as np
import rclpy
from cv_bridge import CvBridge
from message_filters import ApproximateTimeSynchronizer, Subscriber
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image
from std_srvs.srv import Trigger

import nbv


class NextView(Node):
    """Keeps the newest frame, and takes it as a view when the service is called."""

    def __init__(self) -> None:
        super().__init__("next_view")
        self.recommender = nbv.Recommender.load(self.declare_parameter("bundle", "mug").value)
        # Metres: whatever is nearer than this is the object.
        self.far_m = self.declare_parameter("far_m", 0.9).value
        # The arm goes no further, so that it can always do what the answer says.
        self.max_travel_deg = self.declare_parameter("max_travel_deg", 180.0).value
        self.newest, self.views, self.rotations_deg = None, [], [0.0]
        self.bridge = CvBridge()
        self.inputs = ApproximateTimeSynchronizer(
            [
                Subscriber(self, kind, topic, qos_profile=qos_profile_sensor_data)
                for kind, topic in ((Image, "depth/image"), (CameraInfo, "depth/info"))
            ],
            queue_size=5,
            slop=0.05,  # seconds
        )
        self.inputs.registerCallback(self.keep)
        self.create_service(Trigger, "~/recommend", self.recommend)

    def keep(self, image: Image, info: CameraInfo) -> None:
        """Keep the newest frame."""
        self.newest = image, info

    def recommend(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Take the newest frame as a view; answer in JSON, or with one line that says why not."""
        if self.newest is None:
            response.message = "no frame yet: are both topics published, and within 0.05 s?"
            return response
        image, info = self.newest
        # 16UC1 is millimetres, 32FC1 metres, for ROS and for nbv.
        views = [*self.views, self.bridge.imgmsg_to_cv2(image, "passthrough")]
        try:
            answer = self.recommender.recommend(
                views,
                rotations_deg=self.rotations_deg,
                intrinsics=np.reshape(info.k, (3, 3)),
                far_m=self.far_m,
                max_travel_deg=self.max_travel_deg,
            )
        except nbv.UserError as error:
            response.message = str(error)
            return response
        # The frame is used up: the next view needs a newer one.
        self.newest, self.views = None, views
        rotation_deg = None if answer.move is None else float(answer.move.rotation_deg)
        self.rotations_deg.append(self.rotations_deg[-1] + (rotation_deg or 0.0))
        response.success = True
        response.message = json.dumps(
            {
                "azimuth_deg": round(answer.azimuth_deg, 1),
                "expected_error_deg": round(answer.expected_error_deg, 1),
                "rotation_deg": rotation_deg,  # counter-clockwise seen from above
                "warnings": answer.warnings,
                "decision": dataclasses.asdict(answer.decision),  # its verdict, and the reason
            }
        )
        return response


def main() -> None:
    """Run the node until it is interrupted."""
    rclpy.init()
    node = NextView()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        node.destroy_node()


if __name__ == "__main__":
    main()
