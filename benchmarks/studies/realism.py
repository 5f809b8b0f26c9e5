"""Realism of synthetic frames: what a network finds in them that was trained on photographs, beside real frames."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from perception.cli.progress import progress_bar
from perception.errors import CalibrationError, ImageError, UsageError
from perception.evaluation.detection.protocol import (
    DIFFICULTIES,
    KITTI_CLASSES,
    DetectionClass,
)
from perception.evaluation.report import Column, Table
from perception.geometry.box_overlap_px import iou_px
from perception.render.curve_plots import Curve, CurvePanel
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.types import Bool, Detections, Float64, Labels

if TYPE_CHECKING:
    from data.recorded_drive import RecordedDrive
    from perception.detection.detectors.modality_detector import ModalityDetector

RANGES_M: tuple[tuple[float, float], ...] = ((0, 15), (15, 30), (30, 50), (0, 50))
_MODERATE = next(one for one in DIFFICULTIES if one.name == "moderate")
# A detection is at the distance of the label that it overlaps by this.
_SAME_IOU = 0.5
_ELSEWHERE = "elsewhere"


@dataclass(frozen=True)
class RangedFrame:
    """Labels and detections of one frame, with distances.

    Attributes:
        labels: (G) labels.
        detections: (D) detections.
        label_distances_m: (G,) horizontal distances from the LiDAR.
        detection_distances_m: (D,) those of the labels that they overlap, else of an object of the class that is as
            high in the image.
    """

    labels: Labels
    detections: Detections
    label_distances_m: Float64
    detection_distances_m: Float64

    @classmethod
    def of(cls, labels: Labels, detections: Detections, focal_px: float) -> "RangedFrame":
        """Measure the distances; the focal length is that of rows."""
        label_distances_m = np.hypot(*labels.boxes_velo.bottom_m[:, :2].T)
        _, y1, _, y2 = detections.boxes_px.T
        heights_m = SizePriors.of(detections.types).height_m[:, 0]
        distances_m = focal_px * heights_m / np.maximum(y2 - y1, 1.0)
        if len(labels) and len(detections):
            overlaps = iou_px(detections.boxes_px, labels.boxes_px)
            is_label = overlaps.max(axis=1) >= _SAME_IOU
            distances_m = np.where(
                is_label, label_distances_m[overlaps.argmax(axis=1)], distances_m
            )
        return cls(labels, detections, label_distances_m, distances_m)

    def within(self, low_m: float, high_m: float) -> "RangedFrame":
        """Leave out the detections beyond a range, and let no label beyond it have to be detected."""

        def is_in(distances_m: Float64) -> Bool:
            return (distances_m >= low_m) & (distances_m < high_m)

        types = np.where(is_in(self.label_distances_m), self.labels.types, _ELSEWHERE)
        kept = is_in(self.detection_distances_m)
        return replace(
            self,
            labels=replace(self.labels, types=types),
            detections=self.detections[kept],
            detection_distances_m=self.detection_distances_m[kept],
        )


class RangePrecision(NamedTuple):
    """Average precision within a range of distance.

    Attributes:
        objects: Number of objects that must be detected.
        ap: Average precision R40 in percent of that of a perfect detector, which is below 100 with few objects; NaN
            with one object or none, where it is 0.
    """

    objects: int
    ap: float


# Average precision by class, then by range.
RealismMetrics = Mapping[str, Mapping[str, RangePrecision]]


def measure_ranges(frames: Sequence[RangedFrame], class_names: Sequence[str]) -> RealismMetrics:
    """Return the average precision of KITTI's classes at its IoU, moderate, by distance.

    Args:
        frames: Labels and detections of all frames.
        class_names: Classes that the network reports.
    """
    known = [one for one in KITTI_CLASSES if one.name in class_names]
    return {
        one.name: {
            range_name(range_m): _precision([frame.within(*range_m) for frame in frames], one)
            for range_m in RANGES_M
        }
        for one in known
    }


def range_name(range_m: tuple[float, float]) -> str:
    """Return a range in words."""
    return f"{range_m[0]:g} to {range_m[1]:g} m"


def _precision(frames: Sequence[RangedFrame], detection_class: DetectionClass) -> RangePrecision:
    from perception.evaluation.detection.average_precision import match_detections, max_ap
    from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
    from perception.evaluation.detection.evaluation_boxes import pair_boxes

    truths = TrueBoxes.of_frames([frame.labels for frame in frames])
    detected = DetectedBoxes.of_frames([frame.detections for frame in frames])
    neighbours = (*detection_class.neighbours, _ELSEWHERE)
    of_range = replace(detection_class, neighbours=neighbours)
    boxes = pair_boxes(truths, detected, len(frames))
    curve = match_detections(boxes, [of_range], [_MODERATE])[of_range].curves().get(_MODERATE.name)
    heights_px = truths.boxes_px[:, 3] - truths.boxes_px[:, 1]
    is_object = (truths.types == detection_class.name) & (heights_px > _MODERATE.min_height_px)
    is_object &= truths.occlusion <= _MODERATE.max_occlusion
    objects = int((is_object & (truths.truncation <= _MODERATE.max_truncation)).sum())
    ap, best = curve.ap() if curve is not None else 0.0, max_ap(objects)
    return RangePrecision(objects, 100 * ap / best if best else float("nan"))


def measure_realism(
    networks: Sequence[Path], drives: Sequence[Path]
) -> dict[str, dict[str, RealismMetrics]]:
    """Return the average precision by distance of camera networks by name, on drives by name.

    Args:
        networks: ONNX files of detectors in images, or YAML files that describe them.
        drives: Labelled drives, synthetic and real.

    Raises:
        PerceptionError: a network or a drive cannot be read or used.
    """
    from data.detections.measured_drives import DriveReader
    from perception.detection.detectors.modality_detector import ModalityDetector

    opened = {file.stem: ModalityDetector(file) for file in networks}
    for file, network in zip(networks, opened.values(), strict=True):
        if network.modality != "rgb":
            expected, found = "detectors in camera images", f"{file} of modality {network.modality}"
            raise UsageError("--public", expected=expected, found=found)
    results: dict[str, dict[str, RealismMetrics]] = {name: {} for name in opened}
    for drive_name, drive in DriveReader().drives(drives):
        frames = _detect(opened, drive)
        for name, network in opened.items():
            results[name][drive_name] = measure_ranges(frames[name], network.class_names)
    return results


def _detect(
    networks: Mapping[str, "ModalityDetector"], drive: "RecordedDrive"
) -> dict[str, list[RangedFrame]]:
    """Return the frames of a drive with the detections of each network."""
    frames: dict[str, list[RangedFrame]] = {name: [] for name in networks}
    for index in progress_bar(range(len(drive)), drive.name, len(drive)):
        frame = drive[index]
        if frame.image is None:
            raise ImageError(frame.source, expected="an image", found="none")
        if frame.calibration is None:
            raise CalibrationError(frame.source, expected="a camera's calibration", found="none")
        focal_px = float(frame.calibration.image_P_cam[1, 1])
        for name, network in networks.items():
            detections = network.detect(frame.image)
            frames[name].append(RangedFrame.of(drive.labels(index), detections, focal_px))
    return frames


def realism_table(title: str, metrics: Mapping[str, RealismMetrics]) -> Table[tuple[str, str]]:
    """Return a row for each class and range, and two columns for each drive: objects and average precision."""
    columns: list[Column[tuple[str, str]]] = []
    for drive in metrics:
        columns += [
            Column("objects", partial(_objects, metrics[drive]), key=f"{drive}: objects"),
            Column(drive, partial(_ap, metrics[drive]), ".1f", drive),
        ]
    first = next(iter(metrics.values()))
    rows = {f"{name} {reach}": (name, reach) for name in first for reach in first[name]}
    return Table(title, columns, rows, "class, distance")


def _objects(metrics: RealismMetrics, of: tuple[str, str]) -> int:
    return metrics[of[0]][of[1]].objects


def _ap(metrics: RealismMetrics, of: tuple[str, str]) -> float | None:
    ap = metrics[of[0]][of[1]].ap
    return None if np.isnan(ap) else ap


def realism_panels(name: str, metrics: Mapping[str, RealismMetrics]) -> list[CurvePanel]:
    """Return a panel for each class: average precision over distance, a curve for each drive."""
    ranges_m = RANGES_M[:-1]  # without the range that holds all
    middles_m = [(low_m + high_m) / 2 for low_m, high_m in ranges_m]
    names = [range_name(range_m) for range_m in ranges_m]
    classes = next(iter(metrics.values()))
    return [
        CurvePanel(
            f"{name}: {of_class}",
            "distance [m]",
            "AP R40 [% of maximum], moderate",
            [
                Curve(drive, middles_m, [one[of_class][reach].ap for reach in names])
                for drive, one in metrics.items()
            ],
            x_ticks=middles_m,
        )
        for of_class in classes
    ]
