"""Topics of a result: their names and types, and the message of each."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from data.messages import images, objects
from data.messages.diagnostics import diagnostics
from data.messages.motion import odometry, transforms
from data.messages.points import point_cloud
from perception.detection.vehicles.camera_views import views_of
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


def _detections(modality: Modality | None, min_score: float) -> MessageFunction:
    """Return the function of a modality's detections, or of the fused ones."""

    def message_of(result: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
        del last
        result = views_of(result)[0]
        if modality is not None:
            detections = result.modality_detections.get(modality)
        else:
            detections = None if result.vehicles is None else result.vehicles.fused.detections
        if detections is None or result.frame.calibration is None:
            return None
        rows = detections.scores >= min_score
        return images.annotations(result.frame.stamp_s, detections[rows])

    return message_of


def _map(modality: MapModality) -> MessageFunction:
    def message_of(result: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
        del last
        image = result.map_images.get(modality)
        return None if image is None else images.compressed_image(result.frame.stamp_s, image)

    return message_of


def _vehicles(min_score: float) -> Callable[[Result], Tracks | None]:
    def tracks_of(result: Result) -> Tracks | None:
        vehicles = result.vehicles
        if vehicles is None:
            return None
        return vehicles.as_tracks(np.flatnonzero(vehicles.fused.detections.scores >= min_score))

    return tracks_of


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


def topics(min_score: float) -> tuple[Topic, ...]:
    """Return all topics.

    Args:
        min_score: Score from which detections and vehicles are shown.
    """
    annotations = "foxglove_msgs/msg/ImageAnnotations"
    image = "sensor_msgs/msg/CompressedImage"
    return (
        Topic("/tf", "tf2_msgs/msg/TFMessage", lambda result, _: transforms(result)),
        Topic("/ego/odometry", "nav_msgs/msg/Odometry", odometry),
        Topic(
            "/lidar/points", "sensor_msgs/msg/PointCloud2", lambda result, _: point_cloud(result)
        ),
        *_object_topics("/tracks", lambda result: result.tracks),
        *_object_topics("/vehicles", _vehicles(min_score)),
        Topic("/camera/camera_info", "sensor_msgs/msg/CameraInfo", _camera_info),
        Topic("/camera/image/compressed", image, _image),
        Topic("/camera/detections/fused", annotations, _detections(None, min_score)),
        *(
            Topic(f"/camera/detections/{one}", annotations, _detections(one, min_score))
            for one in MODALITIES
        ),
        *(Topic(f"/maps/{one}/compressed", image, _map(one)) for one in MAP_MODALITIES),
        Topic(
            "/diagnostics",
            "diagnostic_msgs/msg/DiagnosticArray",
            lambda result, _: diagnostics(result),
        ),
    )
