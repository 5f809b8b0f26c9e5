"""Where the vehicle and its sensors are: transforms, and odometry."""

from typing import Any

import numpy as np

from data.messages.definitions import message
from data.messages.geometry import (
    CAMERA,
    LIDAR,
    WORLD,
    further_camera,
    header,
    point,
    quaternion,
    vector,
)
from perception.geometry.se3 import from_rotation_translation, inverse, rotation_vector
from perception.types import Calibration, Float64, Result


def camera_SE3_velo(calibration: Calibration) -> Float64:
    """Return (4, 4) LiDAR to the colour camera, whose projection has no fourth column.

    KITTI's projections are of the reference camera; their fourth column is the way to the colour camera.
    """
    projection = calibration.image_P_cam
    offset_m = np.linalg.solve(projection[:, :3], projection[:, 3])
    return from_rotation_translation(np.eye(3), offset_m) @ calibration.cam_SE3_velo


def transforms(result: Result) -> Any:  # noqa: ANN401 - a message
    """Return the pose of the LiDAR in the world, and of each camera on the vehicle."""
    stamp_s = result.frame.stamp_s
    tree = [transform(stamp_s, WORLD, LIDAR, result.world_SE3_velo)]
    for number, view in enumerate(result.frame.views):
        if view.calibration is not None:
            name = further_camera(view.camera) if number else CAMERA
            velo_SE3_camera = inverse(camera_SE3_velo(view.calibration))
            tree.append(transform(stamp_s, LIDAR, name, velo_SE3_camera))
    return message("tf2_msgs/TFMessage", transforms=tree)


def odometry(result: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
    """Return pose and velocity of the LiDAR; the velocity is that since the last frame, 0 without one.

    Args:
        result: Result of the frame.
        last: Result of the frame before.
    """
    world_SE3_velo = result.world_SE3_velo
    pose = message(
        "geometry_msgs/Pose",
        position=point(world_SE3_velo[:3, 3]),
        orientation=quaternion(world_SE3_velo[:3, :3]),
    )
    linear_m_s, angular_rad_s = _velocity(result, last)
    twist = message("geometry_msgs/Twist", linear=vector(linear_m_s), angular=vector(angular_rad_s))
    unknown = np.zeros(36)  # as REP 105's tools write a covariance that is not known
    covariance = result.pose_covariance.ravel()
    covariance = covariance if np.isfinite(covariance).all() else unknown
    return message(
        "nav_msgs/Odometry",
        header=header(result.frame.stamp_s, WORLD),
        child_frame_id=LIDAR,
        pose=message("geometry_msgs/PoseWithCovariance", pose=pose, covariance=covariance),
        twist=message("geometry_msgs/TwistWithCovariance", twist=twist, covariance=unknown),
    )


def _velocity(result: Result, last: Result | None) -> tuple[Float64, Float64]:
    """Return velocity and turn rate in the LiDAR frame."""
    if last is None or result.frame.index <= last.frame.index:  # a drive that begins again
        return np.zeros(3), np.zeros(3)
    duration_s = result.frame.stamp_s - last.frame.stamp_s
    if duration_s <= 0:
        return np.zeros(3), np.zeros(3)
    last_SE3_velo = inverse(last.world_SE3_velo) @ result.world_SE3_velo
    linear_last_m_s = last_SE3_velo[:3, 3] / duration_s
    rotation = last_SE3_velo[:3, :3]
    return rotation.T @ linear_last_m_s, rotation_vector(rotation) / duration_s


def transform(stamp_s: float, parent: str, child: str, parent_SE3_child: Float64) -> Any:  # noqa: ANN401
    """Return the (4, 4) pose of a frame in another as a transform."""
    return message(
        "geometry_msgs/TransformStamped",
        header=header(stamp_s, parent),
        child_frame_id=child,
        transform=message(
            "geometry_msgs/Transform",
            translation=vector(parent_SE3_child[:3, 3]),
            rotation=quaternion(parent_SE3_child[:3, :3]),
        ),
    )
