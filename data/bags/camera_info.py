"""CameraInfo: the lens of a camera, as ROS describes it."""

import re
from typing import Any

import numpy as np

from perception.errors import CalibrationError
from perception.geometry.undistortion import Lens

_RECTIFIED = {
    "rect",
    "rectified",
}  # words in the names of topics whose images image_proc has rectified


def read_lens(message: Any, image_topic: str, source: str) -> Lens:  # noqa: ANN401 - see Bag.decode
    """Return the lens of a sensor_msgs/CameraInfo message.

    Images whose topic says that they are rectified are pinhole images by the projection P; others are distorted, and
    are turned into these.

    Args:
        message: Decoded message.
        image_topic: Topic of the images.
        source: Place of the message, for errors.

    Raises:
        CalibrationError: It is not filled in, or its distortion model is unknown.
    """
    # ROS 1 names the matrices by capital letters.
    matrix, coefficients, turn, projection = (
        np.asarray(getattr(message, name if hasattr(message, name) else name.upper()), np.float64)
        for name in "kdrp"
    )
    if not matrix.any():
        raise CalibrationError(
            source,
            expected="a camera matrix K",
            found="zeros, as of a camera that is not calibrated",
        )
    camera_matrix, target = matrix.reshape(3, 3), projection.reshape(3, 4)[:, :3]
    size_px = int(message.width), int(message.height)
    if _RECTIFIED & set(re.split(r"[^a-z]+", image_topic.lower())) and target.any():
        return Lens(target, np.zeros(0), size_px, source=source)
    return Lens(
        camera_matrix,
        coefficients,
        size_px,
        model=message.distortion_model,
        rectification=turn.reshape(3, 3) if turn.any() else None,
        target_matrix=target if target.any() else None,
        source=source,
    )
