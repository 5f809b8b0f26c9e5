"""Topics of a result: their names and types, and the message of each."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from data.messages import images, objects
from data.messages.diagnostics import diagnostics
from data.messages.motion import odometry, transforms
from data.messages.points import point_cloud
from perception.types import MAP_MODALITIES, MODALITIES, MapModality, Modality, Result, Tracks

# Makes a message of a result and the one before; None where the result has no such part.
MessageFunction = Callable[[Result, Result | None], Any]


@dataclass(frozen=True)
class Topic:
    """A topic.

    Attributes:
        name: Name.
        kind: Type of its messages.
        message_of: Function that makes the message of a result.
    """

    name: str
    kind: str
    message_of: MessageFunction


def _image(result: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
    del last
    frame = result.frame
    return None if frame.image is None else images.compressed_image(frame.stamp_s, frame.image)


def _camera_info(result: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
    del last
    frame = result.frame
    calibration = frame.calibration
    if calibration is None:
        return None
    size_px = calibration.image_size_px
    if frame.image is not None:
        size_px = frame.image.shape[1], frame.image.shape[0]
    return None if size_px is None else images.camera_info(frame.stamp_s, calibration, size_px)


def _fused(result: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
    del last
    if result.vehicles is None or result.frame.calibration is None:
        return None
    return images.annotations(result.frame.stamp_s, result.vehicles.fused.detections)


def _detections(modality: Modality) -> MessageFunction:
    def message_of(result: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
        del last
        detections = result.modality_detections.get(modality)
        if detections is None or result.frame.calibration is None:
            return None
        return images.annotations(result.frame.stamp_s, detections)

    return message_of


def _map(modality: MapModality) -> MessageFunction:
    def message_of(result: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
        del last
        image = result.map_images.get(modality)
        return None if image is None else images.compressed_image(result.frame.stamp_s, image)

    return message_of


def _vehicles(result: Result) -> Tracks | None:
    if result.vehicles is None:
        return None
    return result.vehicles.as_tracks(np.arange(len(result.vehicles)))


def _object_topics(name: str, tracks_of: Callable[[Result], Tracks | None]) -> tuple[Topic, ...]:
    """Return the topics of objects: values for programs, drawn by Foxglove, drawn by RViz."""

    def of(make: Callable[[float, Tracks], Any]) -> MessageFunction:
        def message_of(result: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
            del last
            tracks = tracks_of(result)
            return None if tracks is None else make(result.frame.stamp_s, tracks)

        return message_of

    return (
        Topic(name, "vision_msgs/msg/Detection3DArray", of(objects.detection_array)),
        Topic(f"{name}/scene", "foxglove_msgs/msg/SceneUpdate", of(objects.scene)),
        Topic(f"{name}/markers", "visualization_msgs/msg/MarkerArray", of(objects.markers)),
    )


TOPICS: tuple[Topic, ...] = (
    Topic("/tf", "tf2_msgs/msg/TFMessage", lambda result, _: transforms(result)),
    Topic("/ego/odometry", "nav_msgs/msg/Odometry", odometry),
    Topic("/lidar/points", "sensor_msgs/msg/PointCloud2", lambda result, _: point_cloud(result)),
    *_object_topics("/tracks", lambda result: result.tracks),
    *_object_topics("/vehicles", _vehicles),
    Topic("/camera/camera_info", "sensor_msgs/msg/CameraInfo", _camera_info),
    Topic("/camera/image/compressed", "sensor_msgs/msg/CompressedImage", _image),
    Topic("/camera/detections/fused", "foxglove_msgs/msg/ImageAnnotations", _fused),
    *(
        Topic(f"/camera/detections/{one}", "foxglove_msgs/msg/ImageAnnotations", _detections(one))
        for one in MODALITIES
    ),
    *(
        Topic(f"/maps/{one}/compressed", "sensor_msgs/msg/CompressedImage", _map(one))
        for one in MAP_MODALITIES
    ),
    Topic(
        "/diagnostics",
        "diagnostic_msgs/msg/DiagnosticArray",
        lambda result, _: diagnostics(result),
    ),
)
