"""Camera image, its calibration, the maps, and the detected boxes in the image."""

from typing import Any

import cv2
import numpy as np

from data.messages.definitions import message
from data.messages.geometry import CAMERA, color, header, time
from perception.render.palette import class_color
from perception.types import Calibration, Detections, UInt8

_QUALITY = 85
_LINE_LOOP = 2  # of foxglove_msgs/PointsAnnotation
_TEXT_PX = 14.0


def compressed_image(stamp_s: float, image: UInt8, frame_id: str = CAMERA) -> Any:  # noqa: ANN401 - a message
    """Return an (H, W, 3) RGB image or an (H, W) grey one as JPEG.

    Args:
        stamp_s: Time of the frame.
        image: Image.
        frame_id: Frame of reference of the camera.
    """
    bgr = image[:, :, ::-1] if image.ndim == 3 else image
    _, data = cv2.imencode(".jpg", bgr, (cv2.IMWRITE_JPEG_QUALITY, _QUALITY))
    return message(
        "sensor_msgs/CompressedImage",
        header=header(stamp_s, frame_id),
        format="jpeg",
        data=data.ravel(),
    )


def camera_info(
    stamp_s: float, calibration: Calibration, size_px: tuple[int, int], frame_id: str = CAMERA
) -> Any:  # noqa: ANN401 - a message
    """Return the calibration of a rectified camera.

    Args:
        stamp_s: Time of the frame.
        calibration: Calibration of the camera.
        size_px: Width and height of its image.
        frame_id: Frame of reference of the camera.
    """
    intrinsics = calibration.image_P_cam[:, :3]
    return message(
        "sensor_msgs/CameraInfo",
        header=header(stamp_s, frame_id),
        height=size_px[1],
        width=size_px[0],
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=intrinsics.ravel(),
        r=np.eye(3).ravel(),
        p=np.column_stack([intrinsics, np.zeros(3)]).ravel(),
    )


def annotations(stamp_s: float, detections: Detections) -> Any:  # noqa: ANN401 - a message
    """Return detected boxes with class and score as annotations of the image."""
    rows = zip(detections.boxes_px, detections.scores, detections.types, strict=True)
    boxes, texts = [], []
    for box_px, score, name in rows:
        rgb = color("foxglove_msgs/Color", class_color(str(name)))
        clear = color("foxglove_msgs/Color", (0, 0, 0), opacity=0.0)
        x1, y1, x2, y2 = map(float, box_px)
        corners = [
            message("foxglove_msgs/Point2", x=x, y=y)
            for x, y in ((x1, y1), (x2, y1), (x2, y2), (x1, y2))
        ]
        boxes.append(
            message(
                "foxglove_msgs/PointsAnnotation",
                timestamp=time(stamp_s),
                type=_LINE_LOOP,
                points=corners,
                outline_color=rgb,
                fill_color=clear,
                thickness=2.0,
            )
        )
        texts.append(
            message(
                "foxglove_msgs/TextAnnotation",
                timestamp=time(stamp_s),
                position=corners[0],
                text=f"{name} {score:.2f}",
                font_size=_TEXT_PX,
                text_color=rgb,
                background_color=clear,
            )
        )
    return message("foxglove_msgs/ImageAnnotations", points=boxes, texts=texts)
