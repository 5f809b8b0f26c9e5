"""Faults of the calibration of LiDAR and camera: what a knock, a new mount or a wrong file leave."""

from dataclasses import replace

import numpy as np

from data.faults.moment import FaultMoment
from perception.calibration.offset import offset_SE3
from perception.types import Float64, Frame

_PITCH, _YAW, _RIGHT = 0, 1, 3


def turned_aside(moment: FaultMoment, yaw_deg: float) -> Frame:
    """Turn the camera of the calibration to the side."""
    return _changed(moment.frame, np.radians(yaw_deg) * np.eye(6)[_YAW])


def tilted(moment: FaultMoment, pitch_deg: float) -> Frame:
    """Tilt the camera of the calibration up or down."""
    return _changed(moment.frame, np.radians(pitch_deg) * np.eye(6)[_PITCH])


def shifted(moment: FaultMoment, distance_m: float) -> Frame:
    """Move the camera of the calibration to the right."""
    return _changed(moment.frame, distance_m * np.eye(6)[_RIGHT])


def _changed(frame: Frame, offset: Float64) -> Frame:
    if frame.calibration is None:
        return frame
    cam_SE3_velo = offset_SE3(offset) @ frame.calibration.cam_SE3_velo
    return replace(frame, calibration=replace(frame.calibration, cam_SE3_velo=cam_SE3_velo))
