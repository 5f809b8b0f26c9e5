"""A node for ROS 2: a cloud in; points by class, boxes, odometry and transforms out.

source /opt/ros/humble/setup.bash; pip install "trifuse[live]"
python docs/examples/ros2_node.py --ros-args -p cloud:=/velodyne_points -p sensor:=VLP-16

Messages go through ROS in their binary form, so that all but `main` runs, and is tested, without ROS.
"""

from typing import Any

import numpy as np

from data.messages.definitions import encoded, typestore
from data.messages.motion import odometry, transforms
from data.messages.objects import markers
from data.messages.points import point_cloud
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import LidarModel, load_sensor
from perception.types import Float32, Frame, Result

OUTPUTS = {"points": "PointCloud2", "boxes": "MarkerArray", "odometry": "Odometry", "/tf": "TFMessage"}


def frame_of(index: int, data: bytes) -> Frame:
    """Return a frame of a sensor_msgs/PointCloud2 in its binary form: x forward, y left, z up."""
    cloud = typestore().deserialize_cdr(data, "sensor_msgs/msg/PointCloud2")
    rows = cloud.data.reshape(-1, cloud.point_step)
    offsets = {field.name: field.offset for field in cloud.fields if field.datatype == 7}  # float32

    def column(name: str) -> Float32:
        return np.ascontiguousarray(rows[:, offsets[name] : offsets[name] + 4]).view("<f4")[:, 0]

    reflectance = column("intensity") if "intensity" in offsets else np.zeros(len(rows), "<f4")
    scale = 255 if reflectance.max(initial=0) > 1 else 1
    points_velo = np.stack([column("x"), column("y"), column("z"), reflectance / scale], axis=1)
    stamp = cloud.header.stamp
    return Frame(index, stamp.sec + 1e-9 * stamp.nanosec, np.asarray(points_velo, np.float32))


class Perception:
    """The pipeline from binary message to binary messages."""

    def __init__(self, sensor: LidarModel) -> None:
        self.pipeline = Pipeline(sensor, PipelineConfig.for_motion())
        self.frames, self.last = 0, None

    def on_cloud(self, data: bytes) -> dict[str, bytes]:
        """Return the messages of a cloud by the names of `OUTPUTS`."""
        result = self.pipeline.step(frame_of(self.frames, data))
        boxes = markers(result.frame.stamp_s, result.tracks)
        found = point_cloud(result), boxes, odometry(result, self.last), transforms(result)
        self.frames, self.last = self.frames + 1, result
        return {name: encoded(one) for name, one in zip(OUTPUTS, found, strict=True)}


def main() -> None:
    """Spin."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from sensor_msgs.msg import PointCloud2
    from tf2_msgs.msg import TFMessage
    from visualization_msgs.msg import MarkerArray

    rclpy.init()
    node = rclpy.create_node("trifuse")
    cloud, sensor = (
        node.declare_parameter(name, value).value
        for name, value in (("cloud", "/velodyne_points"), ("sensor", "HDL-64E"))
    )
    perception = Perception(load_sensor(sensor))
    kinds = (PointCloud2, MarkerArray, Odometry, TFMessage)
    publishers = [node.create_publisher(kind, name, 1) for name, kind in zip(OUTPUTS, kinds, strict=True)]

    def on_cloud(data: bytes) -> None:
        for publisher, message in zip(publishers, perception.on_cloud(data).values(), strict=True):
            publisher.publish(message)

    # The latest cloud counts: of those that come meanwhile, ROS keeps one.
    latest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    node.create_subscription(PointCloud2, cloud, on_cloud, latest, raw=True)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
