"""Metrics of detected vehicles as objects: tracks in the image, positions on the road, ids shared with moving objects."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from perception.detection.vehicles.camera_views import views_of
from perception.errors import PerceptionError
from perception.evaluation.intervals import BoxIntervalMetrics, BoxIntervals, box_intervals, groups
from perception.evaluation.multi_object.coverage import MIN_FRAMES, Coverage, CoverageMetrics
from perception.evaluation.multi_object.ground_protocol import (
    GROUND_CLASSES,
    REACH_M,
    GroundTracks,
    ground_frame,
    measured_objects,
    tracks_around,
)
from perception.evaluation.multi_object.kitti_protocol import (
    MIN_IOU,
    ImageBoxes,
    KittiClass,
    kitti_frames,
)
from perception.evaluation.multi_object.mot_metrics import MotMetrics, evaluate_tracks, mot_table
from perception.evaluation.multi_object.sequence import TrackedFrame
from perception.evaluation.nuscenes.tracking import TrackTaskReport
from perception.evaluation.report import CONTEXT, Metric, Metrics, Report, SummedMetrics, Table
from perception.geometry.box_overlap import iou_bev
from perception.geometry.box_overlap_px import iou_px
from perception.geometry.boxes import points_inside
from perception.geometry.se3 import wrap
from perception.tracking.association import Association, assign_hungarian
from perception.types import (
    ArrayTable,
    Bool,
    Boxes3D,
    Float,
    Float64,
    Int,
    Labels,
    Result,
    Tracks,
    Vehicles,
)

# KITTI's moderate: visible or partly occluded, truncated by less than a third.
_MAX_OCCLUSION, _MAX_TRUNCATION = 1, 0.3
_MIN_IOU_PX = 0.5  # overlap in the image of a detection and a true vehicle
_SAME_PLACE_IOU = 0.15
_BOXED_CLASSES = ("Car", "Van", "Truck", "Pedestrian", "Cyclist")
_IMAGE_CLASSES: tuple[KittiClass, ...] = ("car", "pedestrian")
_RANGES_M = {"0 to 25 m": (0.0, 25.0), "25 to 50 m": (25.0, 50.0), "from 50 m": (50.0, np.inf)}
# KITTI's labels are tight: points on a side of the box may lie outside.
_MARGIN_M = 0.1

PROTOCOL_WORDS = {
    "tracking": "KITTI tracking benchmark, boxes in the image; objects that have an id",
    "ground_tracking": (
        "objects with an id and a 3D box; KITTI's rules of what is ignored, overlap from above of at least 0.5 for "
        "vehicles and 0.25 for pedestrians and cyclists; where all around is labelled, all round, objects that no return "
        "is of or that are farther than 50 m ignored"
    ),
    "location": (
        "true cars that are visible or partly occluded and truncated by at most 0.3, each with the "
        "detection of the greatest overlap of at least 0.5 in the image"
    ),
    "intervals": (
        "boxes of true objects of all classes, matched as in location, of which 90 % should lie within the reported "
        "uncertainty: the centre's ellipse over the ground, and intervals of each size and of the heading modulo pi; boxes "
        "that do not touch the true one are counted apart"
    ),
    "coverage": (
        f"labelled cars that some detector finds in at least {MIN_FRAMES} frames, from the score from which a vehicle "
        "counts and by an overlap of at least 0.5 in the image, by their nearest range; those that ever have an id"
    ),
    "same id": (
        "moving objects that overlap a confirmed vehicle of the same frame on the ground by 0.15 or more, "
        "and those of them that have its id"
    ),
}


@dataclass(frozen=True)
class LocationErrors(ArrayTable):
    """Errors of N detected true vehicles; NaN where the detection has no box or no return.

    Attributes:
        range_m: (N,) Distance from the LiDAR to the true centre over the ground.
        center_m: (N,) Distance of the centres over the ground.
        yaw_rad: (N,) Absolute heading error, 0 to pi.
        axis_rad: (N,) Absolute error of the box's axis, 0 to pi/2: front and rear are not distinguished.
        distance_m: (N,) Absolute error of the reported distance against the nearest return in the true box.
    """

    range_m: Float64
    center_m: Float64
    yaw_rad: Float64
    axis_rad: Float64
    distance_m: Float64

    def summary(self) -> "LocationMetrics":
        """Return the median and the 90 % quantile of each error."""
        center_m, distance_m = _quantiles(self.center_m), _quantiles(self.distance_m)
        yaw_deg, axis_deg = (_quantiles(np.degrees(one)) for one in (self.yaw_rad, self.axis_rad))
        boxed = float(np.isfinite(self.center_m).mean()) if len(self) else float("nan")
        return LocationMetrics(len(self), boxed, *center_m, *yaw_deg, *axis_deg, *distance_m)


@dataclass(frozen=True)
class LocationMetrics(Metrics):
    """Medians (p50) and 90 % quantiles (p90) of the errors of detected vehicles; NaN without any.

    Attributes:
        detected: Number of detected true vehicles.
        boxed: Share of them whose detection has a box.
        center_p50_m: Distance of the centres over the ground.
        center_p90_m: Distance of the centres over the ground.
        yaw_p50_deg: Absolute heading error.
        yaw_p90_deg: Absolute heading error.
        axis_p50_deg: Absolute error of the box's axis.
        axis_p90_deg: Absolute error of the box's axis.
        distance_p50_m: Absolute error of the reported distance.
        distance_p90_m: Absolute error of the reported distance.
    """

    detected: Annotated[int, Metric("cars")]
    boxed: Annotated[float, Metric("with a box", ".3f")]
    center_p50_m: Annotated[float, Metric("centre p50 [m]", ".3f")]
    center_p90_m: Annotated[float, Metric("centre p90 [m]", ".3f")]
    yaw_p50_deg: Annotated[float, Metric("yaw p50 [deg]", ".3f")]
    yaw_p90_deg: Annotated[float, Metric("yaw p90 [deg]", ".3f")]
    axis_p50_deg: Annotated[float, Metric("axis p50 [deg]", ".3f")]
    axis_p90_deg: Annotated[float, Metric("axis p90 [deg]", ".3f")]
    distance_p50_m: Annotated[float, Metric("distance p50 [m]", ".3f")]
    distance_p90_m: Annotated[float, Metric("distance p90 [m]", ".3f")]


def location_errors(
    vehicles: Vehicles,
    true_px: Float64,
    true_boxes: Boxes3D,
    points_velo: Float,
) -> LocationErrors:
    """Measure the vehicles of one frame that match a true vehicle in the image.

    Args:
        vehicles: Detected vehicles in the LiDAR frame.
        true_px: (T, 4) True boxes x1 y1 x2 y2 in the image.
        true_boxes: (T) True boxes in the LiDAR frame.
        points_velo: (N, 3+) Points of the scan in the LiDAR frame.
    """
    pairs = _image_pairs(true_px, vehicles)
    true, found = true_boxes[pairs.tracks], vehicles.boxes[pairs.detections]
    center_offsets_m = found.bottom_m[:, :2] - true.bottom_m[:, :2]
    turn_rad = found.yaw_rad - true.yaw_rad
    nearest_m = np.array(
        [_nearest_m(points_velo[inside]) for inside in points_inside(true, points_velo, _MARGIN_M)]
    )
    return LocationErrors(
        range_m=np.hypot(true.bottom_m[:, 0], true.bottom_m[:, 1]),
        center_m=np.hypot(center_offsets_m[:, 0], center_offsets_m[:, 1]),
        yaw_rad=np.abs(wrap(turn_rad)),
        axis_rad=np.abs(wrap(turn_rad, np.pi)),
        distance_m=np.abs(vehicles.distances_m[pairs.detections] - nearest_m.reshape(-1)),
    )


def matched_labels(labels: Labels, vehicles: Vehicles) -> tuple[Labels, Int]:
    """Return the moderate labels of boxed classes that a detection matches in the image, and its (N,) row for each."""
    known = labels[_is_moderate(labels) & np.isin(labels.types, _BOXED_CLASSES)]
    pairs = _image_pairs(known.boxes_px, vehicles)
    return known[pairs.tracks], pairs.detections


def _is_moderate(labels: Labels) -> Bool:
    return np.asarray((labels.occlusion <= _MAX_OCCLUSION) & (labels.truncation <= _MAX_TRUNCATION))


def _image_pairs(true_px: Float64, vehicles: Vehicles) -> Association:
    """Return the pairs of true boxes and detections of the greatest overlap in the image."""
    iou = iou_px(true_px, vehicles.fused.detections.boxes_px)
    return assign_hungarian(1.0 - iou, iou >= _MIN_IOU_PX)


def _nearest_m(points: Float) -> float:
    return float(np.linalg.norm(points[:, :3], axis=1).min()) if len(points) else np.nan


@dataclass(frozen=True)
class ColocatedObjects(SummedMetrics):
    """Moving objects at the position of a confirmed vehicle, summed over frames.

    Attributes:
        colocated: Number of these objects.
        same_id: Number of these objects that have the vehicle's id.
    """

    colocated: int = 0
    same_id: int = 0


@dataclass(frozen=True)
class VehicleReport(Report):
    """Metrics of the vehicles of one drive.

    Attributes:
        frames: Number of evaluated frames.
        is_around: Whether tracks on the ground count all round, not in the image alone.
        tracking: Metrics of the tracks in the image by class.
        ground_tracking: Metrics of the tracks on the ground by class, of the classes that are labelled or tracked.
        location: Errors of the positions on the road by range.
        intervals: Shares of the true boxes within the intervals of their uncertainty, by class and by range.
        coverage: Share of the detected cars that have an id, by range.
        ids: Ids shared by vehicles and moving objects.
        task: Metrics of nuScenes' tracking task, where all round is labelled.
    """

    frames: Annotated[int, CONTEXT]
    is_around: Annotated[bool, CONTEXT]
    tracking: Mapping[str, MotMetrics]
    ground_tracking: Mapping[str, MotMetrics]
    location: Mapping[str, LocationMetrics]
    intervals: Mapping[str, BoxIntervalMetrics]
    coverage: Mapping[str, CoverageMetrics]
    ids: ColocatedObjects
    task: TrackTaskReport | None = None

    def tables(self) -> list[Table[Any]]:
        """Return the tracks in the image and on the ground, and the errors by range with the number of shared ids below."""
        ids = (
            f"moving objects at the position of a vehicle: {self.ids.colocated}, "
            f"with its id: {self.ids.same_id}"
        )
        where = f"all round to {REACH_M:g} m" if self.is_around else "in the image"
        title = "detected cars on the road: median and 90 % quantile of the errors"
        return [
            mot_table("tracks in the image: KITTI 2D boxes, ratios in percent", self.tracking),
            mot_table(
                f"tracks on the ground, {where}: boxes from above, ratios in percent",
                self.ground_tracking,
            ),
            *(self.task.tables() if self.task else ()),
            Table(title, LocationMetrics.columns(), self.location, notes=("", ids)),
            Table(
                "boxes: shares of the truth within intervals that should hold 90 %",
                BoxIntervalMetrics.columns(),
                self.intervals,
            ),
            Table(
                f"cars detected in {MIN_FRAMES} frames or more, by nearest range",
                CoverageMetrics.columns(),
                self.coverage,
            ),
        ]


class VehicleMeasure:
    """Accumulates the metrics of detected vehicles over the frames of a drive."""

    def __init__(self, display_score: float) -> None:
        """Start without a frame.

        Args:
            display_score: Existence of a vehicle from which on it counts, 0 to 1.
        """
        self._display_score = display_score
        self._frames: dict[KittiClass, list[TrackedFrame]] = {name: [] for name in _IMAGE_CLASSES}
        self._ground_frames: dict[str, list[TrackedFrame]] = {name: [] for name in GROUND_CLASSES}
        self._errors: list[LocationErrors] = []
        self._intervals: list[BoxIntervals] = []
        self._coverage = Coverage()
        self._ids = ColocatedObjects()
        self._is_around = False

    def update(self, result: Result, labels: Labels | None, around: Labels | None = None) -> None:
        """Add one frame in its main camera; one without a camera, in which nothing can be detected, is left out.

        Args:
            result: Result of the frame.
            labels: Labels of the objects in the image of its main camera.
            around: Labels of all objects around, where they are known: tracks on the ground count all round then.
        """
        everywhere, result = result, views_of(result)[0]
        vehicles = result.vehicles
        if vehicles is None or labels is None:
            return
        predicted = _predicted_boxes(vehicles, self._display_score)
        for name, frames in self._frames.items():
            frames.extend(kitti_frames(labelled_boxes(labels), predicted, name, 1))
        on_ground = labels
        if around is None or everywhere.vehicles is None:
            tracks = _ground_tracks(vehicles, self._display_score)
        else:
            on_ground = measured_objects(around, result.frame.points_velo)
            tracks = tracks_around(_ground_tracks(everywhere.vehicles, self._display_score))
            self._is_around = True
        for kind, ground_frames in self._ground_frames.items():
            ground_frames.append(ground_frame(on_ground, tracks, kind))
        true = labels[_is_moderate(labels) & (labels.types == "Car")]
        points = result.frame.points_velo
        self._errors.append(location_errors(vehicles, true.boxes_px, true.boxes_velo, points))
        known, rows = matched_labels(labels, vehicles)
        self._intervals.append(box_intervals(vehicles, rows, known.boxes_velo, known.types))
        cars = labels[(labels.types == "Car") & (labels.track_ids >= 0)]
        views = result.modality_detections.values()
        self._coverage.update(
            cars.track_ids,
            cars.boxes_px,
            np.hypot(cars.boxes_velo.bottom_m[:, 0], cars.boxes_velo.bottom_m[:, 1]),
            [one.boxes_px[one.scores >= self._display_score] for one in views],
            predicted.boxes_px,
        )
        self._ids += _colocated_objects(vehicles, result.tracks)

    def compute(self) -> VehicleReport:
        """Return the metrics of all frames so far.

        Raises:
            PerceptionError: no frame had a camera.
        """
        if not self._errors:
            raise PerceptionError(
                "vehicles", expected="frames with a camera to detect in", found="none"
            )
        errors = LocationErrors.concatenate(self._errors)
        by_range = {
            name: errors[(errors.range_m >= low) & (errors.range_m < high)].summary()
            for name, (low, high) in _RANGES_M.items()
        }
        intervals = BoxIntervals.concatenate(self._intervals)
        by_kind = {name: intervals.types == name for name in _BOXED_CLASSES} | {
            name: (intervals.range_m >= low) & (intervals.range_m < high)
            for name, (low, high) in _RANGES_M.items()
        }
        held = {name: one.summary() for name, one in groups(intervals, by_kind).items()}
        coverage = {name: self._coverage.compute(*ends_m) for name, ends_m in _RANGES_M.items()}
        tracking = {str(name): evaluate_tracks(one, MIN_IOU) for name, one in self._frames.items()}
        on_ground = {
            name: evaluate_tracks(frames, GROUND_CLASSES[name].min_iou)
            for name, frames in self._ground_frames.items()
            if any(len(one.truth_ids) + len(one.track_ids) for one in frames)
        }
        return VehicleReport(
            len(self._errors),
            self._is_around,
            tracking,
            on_ground,
            by_range,
            held,
            coverage,
            self._ids,
        )


def labelled_boxes(labels: Labels) -> ImageBoxes:
    """Return the labels of one frame as boxes of a sequence of one frame."""
    regions = len(labels.dont_care_px)
    return ImageBoxes(
        frames=np.zeros(len(labels) + regions, np.int64),
        ids=np.append(labels.track_ids, np.full(regions, -1)),
        types=np.append(labels.types.astype(np.str_), np.full(regions, "DontCare")),
        truncation=np.append(labels.truncation, np.full(regions, -1.0)),
        occlusion=np.append(labels.occlusion, np.full(regions, -1.0)),
        boxes_px=np.concatenate([labels.boxes_px, labels.dont_care_px]),
    )


def _predicted_boxes(vehicles: Vehicles, display_score: float) -> ImageBoxes:
    detections, unknown = vehicles.fused.detections, np.full(len(vehicles), -1.0)
    frames = np.zeros(len(vehicles), np.int64)
    boxes = ImageBoxes(
        frames, vehicles.ids, detections.types, unknown, unknown, detections.boxes_px
    )
    return boxes[(vehicles.ids >= 0) & (vehicles.fused.existence >= display_score)]


def _ground_tracks(vehicles: Vehicles, display_score: float) -> GroundTracks:
    detections = vehicles.fused.detections
    is_tracked = (vehicles.ids >= 0) & (vehicles.fused.existence >= display_score)
    rows = np.flatnonzero(is_tracked & np.isfinite(vehicles.boxes.yaw_rad))
    return GroundTracks(
        vehicles.ids[rows],
        detections.types[rows],
        vehicles.boxes[rows],
        detections.boxes_px[rows],
    )


def _colocated_objects(vehicles: Vehicles, tracks: Tracks) -> ColocatedObjects:
    rows = np.flatnonzero((vehicles.ids >= 0) & np.isfinite(vehicles.boxes.yaw_rad))
    overlaps = iou_bev(vehicles.boxes[rows], tracks.boxes) >= _SAME_PLACE_IOU
    is_same = vehicles.ids[rows][:, None] == tracks.ids
    return ColocatedObjects(
        int(overlaps.any(axis=0).sum()), int((overlaps & is_same).any(axis=0).sum())
    )


def _quantiles(values: Float64) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if not len(known):
        return float("nan"), float("nan")
    return float(np.quantile(known, 0.5)), float(np.quantile(known, 0.9))
