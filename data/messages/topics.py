"""Topics of a result: their names and types, and the message of each."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from data.messages import images, objects
from data.messages.definitions import message
from data.messages.geometry import CAMERA, LIDAR, further_camera, header
from data.messages.motion import odometry, transforms
from data.messages.points import point_cloud
from perception.detection.vehicles.camera_views import view_of
from perception.tracking.vehicles.duplicates import distinct_rows
from perception.types import (
    MAP_MODALITIES,
    MODALITIES,
    SENSOR_PARTS,
    Health,
    MapModality,
    Modality,
    Result,
    Tracks,
)

_OK, _WARN = 0, 1  # levels of diagnostic_msgs/DiagnosticStatus, those of HealthLevel
# Makes a message of a result and the one before; None where the result has no such part.
MessageFunction = Callable[[Result, Result | None], Any]


def diagnostics(result: Result) -> Any:  # noqa: ANN401 - a message
    """Return a status of the pipeline with the time of each stage, and one of each sensor, and stage with a finding.

    The pipeline's own status warns where stages were left out or points are invalid.
    """
    values = {
        "latency_ms": f"{1e3 * result.latency_s:.2f}",
        **{f"{stage} [ms]": f"{1e3 * time:.2f}" for stage, time in result.timings_s.items()},
        "skipped": ", ".join(result.skipped),
        "invalid_points": str(result.frame.invalid_points),
    }
    status = message(
        "diagnostic_msgs/DiagnosticStatus",
        level=_WARN if result.skipped or result.frame.invalid_points else _OK,
        name="trifuse: pipeline",
        message=f"left out: {', '.join(result.skipped)}" if result.skipped else "all stages ran",
        values=[
            message("diagnostic_msgs/KeyValue", key=key, value=value)
            for key, value in values.items()
        ],
    )
    return message(
        "diagnostic_msgs/DiagnosticArray",
        header=header(result.frame.stamp_s, LIDAR),
        status=[status, *part_statuses(result.health, SENSOR_PARTS)],
    )


def part_statuses(health: Health, parts: Sequence[str]) -> list[Any]:
    """Return the status of each of some parts, and of each other part that has a finding."""
    return [
        message(
            "diagnostic_msgs/DiagnosticStatus",
            level=int(health.level_of(part)),
            name=f"trifuse: {part}",
            message="; ".join(str(one) for one in health.findings if one.part == part) or "OK",
        )
        for part in dict.fromkeys((*parts, *health.levels))
    ]


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


@dataclass(frozen=True)
class _CameraTopics:
    """Topics of one camera.

    Attributes:
        number: Number of the camera in `Frame.views`.
        frame_id: Its frame of reference, which its topics begin with.
        min_score: Score from which detections are shown.
    """

    number: int
    frame_id: str
    min_score: float

    def topics(self) -> tuple[Topic, ...]:
        """Return calibration, image and detections."""
        annotations = "foxglove_msgs/msg/ImageAnnotations"
        return (
            self._topic("camera_info", "sensor_msgs/msg/CameraInfo", self._camera_info),
            self._topic("image/compressed", "sensor_msgs/msg/CompressedImage", self._image),
            self._topic("detections/fused", annotations, partial(self._detections, None)),
            *(
                self._topic(f"detections/{one}", annotations, partial(self._detections, one))
                for one in MODALITIES
            ),
        )

    def _topic(self, name: str, kind: str, message_of: Callable[[Result], Any]) -> Topic:
        return Topic(f"/{self.frame_id}/{name}", kind, lambda result, _: message_of(result))

    def _image(self, result: Result) -> Any:  # noqa: ANN401 - a message
        frame = result.frame.views[self.number]
        if frame.image is None:
            return None
        return images.compressed_image(frame.stamp_s, frame.image, self.frame_id)

    def _camera_info(self, result: Result) -> Any:  # noqa: ANN401 - a message
        frame = result.frame.views[self.number]
        calibration = frame.calibration
        if calibration is None:
            return None
        size_px = calibration.image_size_px
        if frame.image is not None:
            size_px = frame.image.shape[1], frame.image.shape[0]
        if size_px is None:
            return None
        return images.camera_info(frame.stamp_s, calibration, size_px, self.frame_id)

    def _detections(self, modality: Modality | None, result: Result) -> Any:  # noqa: ANN401 - a message
        """Return the detections of a modality, or the fused ones."""
        result = view_of(result, self.number)
        if modality is not None:
            detections = result.modality_detections.get(modality)
        else:
            detections = None if result.vehicles is None else result.vehicles.fused.detections
        if detections is None or result.frame.calibration is None:
            return None
        rows = detections.scores >= self.min_score
        return images.annotations(result.frame.stamp_s, detections[rows])


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
        return vehicles.as_tracks(distinct_rows(vehicles, min_score))

    return tracks_of


class _Objects:
    """Objects of results; those of the last one are kept, as several topics ask for them."""

    def __init__(self, tracks_of: Callable[[Result], Tracks | None]) -> None:
        self._tracks_of = tracks_of
        self._last: tuple[Result, tuple[objects.Object, ...] | None] | None = None

    def of(self, result: Result) -> tuple[objects.Object, ...] | None:
        if self._last is None or self._last[0] is not result:
            tracks = self._tracks_of(result)
            self._last = result, None if tracks is None else objects.Object.of(tracks)
        return self._last[1]


def _object_topics(name: str, tracks_of: Callable[[Result], Tracks | None]) -> tuple[Topic, ...]:
    """Return the topics of objects: values for programs, drawn by Foxglove, drawn by RViz."""
    known = _Objects(tracks_of)

    def of(make: Callable[[float, Sequence[objects.Object]], Any]) -> MessageFunction:
        def message_of(result: Result, last: Result | None) -> Any:  # noqa: ANN401 - a message
            del last
            found = known.of(result)
            return None if found is None else make(result.frame.stamp_s, found)

        return message_of

    return (
        Topic(name, "vision_msgs/msg/Detection3DArray", of(objects.detection_array)),
        Topic(f"{name}/scene", "foxglove_msgs/msg/SceneUpdate", of(objects.scene)),
        Topic(f"{name}/markers", "visualization_msgs/msg/MarkerArray", of(objects.markers)),
    )


def topics(min_score: float, cameras: Sequence[str] = ()) -> tuple[Topic, ...]:
    """Return all topics.

    Args:
        min_score: Score from which detections and vehicles are shown.
        cameras: Names of the further cameras, in the order of `Frame.further_cameras`.
    """
    frame_ids = (CAMERA, *map(further_camera, cameras))
    image = "sensor_msgs/msg/CompressedImage"
    return (
        Topic("/tf", "tf2_msgs/msg/TFMessage", lambda result, _: transforms(result)),
        Topic("/ego/odometry", "nav_msgs/msg/Odometry", odometry),
        Topic(
            "/lidar/points", "sensor_msgs/msg/PointCloud2", lambda result, _: point_cloud(result)
        ),
        *_object_topics("/tracks", lambda result: result.tracks),
        *_object_topics("/vehicles", _vehicles(min_score)),
        *(
            topic
            for number, frame_id in enumerate(frame_ids)
            for topic in _CameraTopics(number, frame_id, min_score).topics()
        ),
        *(Topic(f"/maps/{one}/compressed", image, _map(one)) for one in MAP_MODALITIES),
        Topic(
            "/diagnostics",
            "diagnostic_msgs/msg/DiagnosticArray",
            lambda result, _: diagnostics(result),
        ),
    )
