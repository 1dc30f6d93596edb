"""From a depth frame of a robot's camera to the pose and the next view."""
