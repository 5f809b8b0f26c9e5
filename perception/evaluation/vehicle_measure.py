"""Metrics of detected vehicles as objects: tracks in the image, positions on the road, ids shared with moving objects."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from perception.errors import PerceptionError
from perception.evaluation.config import KittiTrackingConfig
from perception.evaluation.multi_object.kitti_protocol import kitti_frames
from perception.evaluation.multi_object.mot_metrics import MotMetrics, evaluate_tracks, mot_table
from perception.evaluation.multi_object.sequence import TrackedFrame
from perception.evaluation.report import Column, Report, Table
from perception.evaluation.vehicle_location import LocationErrors, location_errors
from perception.geometry.box_overlap import iou_bev
from perception.types import ArrayTable, Float64, Int, Labels, PointTruth, Result, Tracks, Vehicles

# KITTI's moderate: visible or partly occluded, truncated by less than a third.
_MAX_OCCLUSION, _MAX_TRUNCATION = 1, 0.3
_SAME_PLACE_IOU = 0.15
_RANGES_M = ((0.0, 25.0), (25.0, 50.0), (50.0, np.inf))

PROTOCOL_WORDS = {
    "tracking": "KITTI tracking benchmark, class car, boxes in the image; vehicles that have an id",
    "location": (
        "true cars that are visible or partly occluded and truncated by at most 0.3, each with the "
        "detection of the greatest overlap of at least 0.5 in the image"
    ),
    "same id": (
        "moving objects that overlap a confirmed vehicle of the same frame on the ground by 0.15 or more, "
        "and those of them that have its id"
    ),
}


@dataclass(frozen=True)
class _ImageBoxes(ArrayTable):
    """Labelled or predicted boxes of one frame, as KITTI's tracking protocol reads them."""

    frames: Int
    ids: Int
    types: np.ndarray
    truncation: Float64
    occlusion: Float64
    boxes_px: Annotated[Float64, 4]


@dataclass(frozen=True)
class VehicleReport(Report):
    """Metrics of the vehicles of one drive.

    Attributes:
        frames: Number of evaluated frames.
        tracking: Metrics of the tracks in the image.
        errors: Errors of the positions on the road.
        colocated: Number of moving objects at the position of a confirmed vehicle, summed over frames.
        same_id: Number of these objects that have the vehicle's id.
    """

    frames: int
    tracking: MotMetrics
    errors: LocationErrors
    colocated: int
    same_id: int

    def tables(self) -> list[Table[Any]]:
        """Return the tracks, and the errors by range with the number of shared ids below."""
        ids = f"moving objects at the position of a vehicle: {self.colocated}, with its id: {self.same_id}"
        return [
            mot_table("car: KITTI 2D boxes, ratios in percent", {"vehicles": self.tracking}),
            self._location_table((ids,)),
        ]

    def _location_table(self, notes: Sequence[str] = ()) -> Table[LocationErrors]:
        range_m = self.errors.range_m
        rows = {
            f"{low:g} to {high:g} m" if np.isfinite(high) else f"from {low:g} m": self.errors[
                (range_m >= low) & (range_m < high)
            ]
            for low, high in _RANGES_M
        }
        title = "detected cars on the road: median and 90 % quantile of the errors"
        return Table(title, _LOCATION_COLUMNS, rows, notes=("", *notes))

    def to_json(self) -> dict[str, Any]:
        """Return the metrics of the tracks, the errors by range, and the number of shared ids."""
        return {
            "tracking": self.tracking.to_json(),
            "location": self._location_table().to_json(),
            "ids": {"colocated": self.colocated, "same_id": self.same_id},
        }


class VehicleMeasure:
    """Accumulates the metrics of detected vehicles over the frames of a drive."""

    def __init__(self, display_score: float, config: KittiTrackingConfig | None = None) -> None:
        """Start without a frame.

        Args:
            display_score: Score of a vehicle from which on it counts, 0 to 1.
            config: Thresholds of KITTI's tracking benchmark.
        """
        self._display_score, self._config = display_score, config or KittiTrackingConfig()
        self._frames: list[TrackedFrame] = []
        self._errors: list[LocationErrors] = []
        self._colocated, self._same_id = 0, 0

    def update(self, result: Result, labels: Labels | None, truth: PointTruth | None) -> None:
        """Add one frame; a frame without a camera, in which nothing can be detected, is left out."""
        vehicles = result.vehicles
        if vehicles is None or labels is None:
            return
        predicted = _predicted_boxes(vehicles, self._display_score)
        self._frames += kitti_frames(_labelled_boxes(labels), predicted, "car", 1, self._config)
        is_moderate = (labels.occlusion <= _MAX_OCCLUSION) & (labels.truncation <= _MAX_TRUNCATION)
        true = labels[is_moderate & (labels.types == "Car")]
        points = result.frame.points_velo
        self._errors.append(location_errors(vehicles, true.boxes_px, true.boxes_velo, points))
        colocated, same_id = _shared_positions(vehicles, result.tracks)
        self._colocated, self._same_id = self._colocated + colocated, self._same_id + same_id

    def compute(self) -> VehicleReport:
        """Return the metrics of all frames so far.

        Raises:
            PerceptionError: no frame had a camera.
        """
        if not self._frames:
            raise PerceptionError(
                "vehicles", expected="frames with a camera to detect in", found="none"
            )
        return VehicleReport(
            frames=len(self._frames),
            tracking=evaluate_tracks(self._frames, self._config.min_iou),
            errors=LocationErrors.concatenate(self._errors),
            colocated=self._colocated,
            same_id=self._same_id,
        )


def _labelled_boxes(labels: Labels) -> _ImageBoxes:
    regions = len(labels.dont_care_px)
    return _ImageBoxes(
        frames=np.zeros(len(labels) + regions, np.int64),
        ids=np.append(labels.track_ids, np.full(regions, -1)),
        types=np.append(labels.types.astype(np.str_), np.full(regions, "DontCare")),
        truncation=np.append(labels.truncation, np.full(regions, -1.0)),
        occlusion=np.append(labels.occlusion, np.full(regions, -1.0)),
        boxes_px=np.concatenate([labels.boxes_px, labels.dont_care_px]),
    )


def _predicted_boxes(vehicles: Vehicles, display_score: float) -> _ImageBoxes:
    detections, unknown = vehicles.fused.detections, np.full(len(vehicles), -1.0)
    frames = np.zeros(len(vehicles), np.int64)
    boxes = _ImageBoxes(
        frames, vehicles.ids, detections.types, unknown, unknown, detections.boxes_px
    )
    return boxes[(vehicles.ids >= 0) & (detections.scores >= display_score)]


def _shared_positions(vehicles: Vehicles, tracks: Tracks) -> tuple[int, int]:
    """Return how many moving objects are at the position of a confirmed vehicle, and how many have its id."""
    rows = np.flatnonzero((vehicles.ids >= 0) & np.isfinite(vehicles.boxes.yaw_rad))
    overlaps = iou_bev(vehicles.boxes[rows], tracks.boxes) >= _SAME_PLACE_IOU
    is_same = vehicles.ids[rows][:, None] == tracks.ids
    return int(overlaps.any(axis=0).sum()), int((overlaps & is_same).any(axis=0).sum())


def _quantile(values: Float64, share: float) -> float:
    known = values[np.isfinite(values)]
    return float(np.quantile(known, share)) if len(known) else float("nan")


def _boxed_share(errors: LocationErrors) -> float:
    return float(np.isfinite(errors.center_m).mean()) if len(errors) else float("nan")


def _error_columns(
    name: str, unit: str, values: Callable[[LocationErrors], Float64]
) -> list[Column[LocationErrors]]:
    """Return the columns of the median and of the 90 % quantile of one error."""
    return [
        Column(
            f"{name} p50 [{unit}]", lambda e: _quantile(values(e), 0.5), ".3f", f"{name}_p50_{unit}"
        ),
        Column(
            f"{name} p90 [{unit}]", lambda e: _quantile(values(e), 0.9), ".3f", f"{name}_p90_{unit}"
        ),
    ]


_LOCATION_COLUMNS = (
    Column[LocationErrors]("cars", len, "", "detected"),
    Column[LocationErrors]("with a box", _boxed_share, ".3f", "boxed"),
    *_error_columns("centre", "m", lambda errors: errors.center_m),
    *_error_columns("yaw", "deg", lambda errors: np.degrees(errors.yaw_rad)),
    *_error_columns("axis", "deg", lambda errors: np.degrees(errors.axis_rad)),
    *_error_columns("distance", "m", lambda errors: errors.distance_m),
)
