"""A node for ROS 2: clouds in; points by class, boxes, odometry and transforms out.

source /opt/ros/humble/setup.bash; pip install "trifuse[live]"
python docs/examples/ros2_node.py --ros-args -p cloud:=/velodyne_points -p sensor:=VLP-16

Messages pass through ROS in their binary form, so that all but `main` runs, and is tested, without ROS.
"""

import numpy as np

from data.bags.sweeps import read_point_cloud
from data.messages.definitions import encoded, typestore
from data.messages.motion import odometry, transforms
from data.messages.objects import Object, markers
from data.messages.points import point_cloud
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import LidarModel, load_sensor
from perception.types import Frame, Result

OUTPUTS = ("~/points", "~/boxes", "~/odometry", "/tf")


def frame_of(index: int, data: bytes) -> Frame:
    """Return a frame of a sensor_msgs/PointCloud2 in its binary form: x forward, y left, z up."""
    message = typestore().deserialize_cdr(data, "sensor_msgs/msg/PointCloud2")
    cloud, stamp = read_point_cloud(message, "cloud"), message.header.stamp
    reflectance = np.zeros(len(cloud)) if cloud.intensity is None else cloud.intensity
    full_scale = 255 if reflectance.max(initial=0) > 1 else 1
    points_velo = np.column_stack([cloud.xyz, reflectance / full_scale]).astype(np.float32)
    return Frame(index, stamp.sec + 1e-9 * stamp.nanosec, points_velo)


class Perception:
    """The pipeline, from one binary message to several."""

    def __init__(self, sensor: LidarModel) -> None:
        """Start the pipeline."""
        self.pipeline = Pipeline(sensor, PipelineConfig.for_motion())
        self.frames = 0
        self.last: Result | None = None

    def on_cloud(self, data: bytes) -> list[bytes]:
        """Return the messages of a cloud in the order of `OUTPUTS`."""
        result = self.pipeline.step(frame_of(self.frames, data))
        boxes = markers(result.frame.stamp_s, Object.of(result.tracks))
        found = point_cloud(result), boxes, odometry(result, self.last), transforms(result)
        self.frames, self.last = self.frames + 1, result
        return [encoded(one) for one in found]


def main() -> None:
    """Run the node."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from sensor_msgs.msg import PointCloud2
    from tf2_msgs.msg import TFMessage
    from visualization_msgs.msg import MarkerArray

    rclpy.init()
    node = rclpy.create_node("trifuse")
    topic = node.declare_parameter("cloud", "/velodyne_points").value
    perception = Perception(load_sensor(node.declare_parameter("sensor", "HDL-64E").value))
    kinds = (PointCloud2, MarkerArray, Odometry, TFMessage)
    outputs = [node.create_publisher(*pair, 1) for pair in zip(kinds, OUTPUTS, strict=True)]

    def on_cloud(data: bytes) -> None:
        for output, message in zip(outputs, perception.on_cloud(data), strict=True):
            output.publish(message)

    # The latest cloud counts: of those that come meanwhile, ROS keeps one.
    latest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    node.create_subscription(PointCloud2, topic, on_cloud, latest, raw=True)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
