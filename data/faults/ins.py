"""Faults of the INS."""

from dataclasses import replace

import numpy as np

from data.faults.moment import FaultMoment
from perception.geometry.se3 import from_rotation_vector
from perception.types import Float64, Frame


def absent(moment: FaultMoment, size: float) -> Frame:
    """Take the pose away."""
    del size
    return replace(moment.frame, world_SE3_velo=None)


def frozen(moment: FaultMoment, size: float) -> Frame:
    """Repeat the last pose before the fault."""
    del size
    return replace(moment.frame, world_SE3_velo=moment.start.world_SE3_velo)


def jumping(moment: FaultMoment, distance_m: float) -> Frame:
    """Displace the pose by a distance, to one side and back again from frame to frame."""
    direction_rad = moment.lasting.uniform(-np.pi, np.pi)
    if moment.count % 2:
        return moment.frame
    return _displaced(moment.frame, distance_m * _direction(direction_rad))


def drifting(moment: FaultMoment, speed_m_s: float) -> Frame:
    """Let the position drift in one direction."""
    direction_rad = moment.lasting.uniform(-np.pi, np.pi)
    return _displaced(moment.frame, speed_m_s * moment.elapsed_s * _direction(direction_rad))


def turning(moment: FaultMoment, rate_deg_s: float) -> Frame:
    """Let the heading drift to one side."""
    pose = moment.frame.world_SE3_velo
    if pose is None:
        return moment.frame
    side = 1 if moment.lasting.random() < 0.5 else -1
    turned = pose.copy()
    angle_rad = side * np.radians(rate_deg_s) * moment.elapsed_s
    turned[:3, :3] = from_rotation_vector(np.array([0, 0, angle_rad])) @ pose[:3, :3]
    return replace(moment.frame, world_SE3_velo=turned)


def _direction(angle_rad: float) -> Float64:
    return np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])


def _displaced(frame: Frame, by_m: Float64) -> Frame:
    if frame.world_SE3_velo is None:
        return frame
    pose = frame.world_SE3_velo.copy()
    pose[:3, 3] += by_m
    return replace(frame, world_SE3_velo=pose)
