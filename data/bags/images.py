"""Image and CompressedImage: (H, W, 3) RGB of any usual encoding."""

import re
from typing import Any

import cv2
import numpy as np

from data.image_decoder import decode_image
from perception.errors import CalibrationError, ImageError
from perception.geometry.undistortion import Lens
from perception.types import UInt8

_RECTIFIED = {
    "rect",
    "rectified",
}  # words in the names of topics whose images image_proc has rectified
# OpenCV's conversion to RGB and the number of bytes a pixel of the encodings of 8 bits.
_COLOUR = {
    "rgb8": (None, 3),
    "8uc3": (cv2.COLOR_BGR2RGB, 3),
    "bgr8": (cv2.COLOR_BGR2RGB, 3),
    "rgba8": (cv2.COLOR_RGBA2RGB, 4),
    "bgra8": (cv2.COLOR_BGRA2RGB, 4),
    "8uc4": (cv2.COLOR_BGRA2RGB, 4),
    "mono8": (cv2.COLOR_GRAY2RGB, 1),
    "8uc1": (cv2.COLOR_GRAY2RGB, 1),
    "bayer_rggb8": (cv2.COLOR_BayerRGGB2RGB, 1),
    "bayer_bggr8": (cv2.COLOR_BayerBGGR2RGB, 1),
    "bayer_gbrg8": (cv2.COLOR_BayerGBRG2RGB, 1),
    "bayer_grbg8": (cv2.COLOR_BayerGRBG2RGB, 1),
    "yuv422": (cv2.COLOR_YUV2RGB_UYVY, 2),
    "uyvy": (cv2.COLOR_YUV2RGB_UYVY, 2),
    "yuv422_yuy2": (cv2.COLOR_YUV2RGB_YUY2, 2),
    "yuyv": (cv2.COLOR_YUV2RGB_YUY2, 2),
}
# Encodings of 16 bits a channel: the upper byte is kept.
_DEEP = {f"{name[:-1]}16": name for name in _COLOUR if name.endswith("8")} | {"16uc1": "mono8"}
ENCODINGS = (*_COLOUR, *_DEEP)


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


def read_image_message(message: Any, source: str) -> UInt8:  # noqa: ANN401 - see Bag.decode
    """Return the (H, W, 3) image of a sensor_msgs/Image or CompressedImage message.

    Args:
        message: Decoded message.
        source: Place of the message, for errors.

    Raises:
        ImageError: The encoding is unknown, or the bytes are not those of an image.
    """
    if not hasattr(message, "encoding"):
        data = np.asarray(message.data, np.uint8).tobytes()
        return decode_image(data, source, stated_format=message.format)
    asked = message.encoding.lower()
    name = _DEEP.get(asked, asked)
    if name not in _COLOUR:
        raise ImageError(
            source, expected=f"an encoding of {', '.join(ENCODINGS)}", found=message.encoding
        )
    conversion, channels = _COLOUR[name]
    deep = 2 if asked in _DEEP else 1
    height, width, row_bytes = message.height, message.width, message.width * channels * deep
    step = message.step or row_bytes
    if min(height, width) < 1 or step < row_bytes or len(message.data) < step * height:
        raise ImageError(
            source,
            expected=f"{height} rows of {width} pixels, {row_bytes} bytes each",
            found=f"{len(message.data)} bytes, a row every {step}",
        )
    rows = np.asarray(message.data, np.uint8)[: step * height].reshape(height, step)[:, :row_bytes]
    if deep == 2:
        rows = np.ascontiguousarray(rows)[:, 0 if message.is_bigendian else 1 :: 2]
    pixels = np.ascontiguousarray(rows).reshape(height, width, channels)
    if conversion is None:
        return pixels
    return np.asarray(cv2.cvtColor(pixels, conversion))
