"""Tracking of detected vehicles beside a plain tracker in the image, on the same detections of the same labelled drive."""

import os
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.measure import Comparison, Contender, compare, metric
from benchmarks.reference.image_tracker import ReferenceImageTracker
from benchmarks.stages import PreparedDrive
from perception.detection.detectors.modalities import camera_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.vehicles.locate import locate
from perception.evaluation.multi_object.kitti_protocol import MIN_IOU, ImageBoxes, kitti_frames
from perception.evaluation.multi_object.mot_metrics import MotMetrics, evaluate_tracks
from perception.evaluation.vehicle_measure import labelled_boxes
from perception.tracking.vehicles.tracker import VehicleTracker
from perception.types import Detections, Float64, Frame, FusedDetections, Labels

_PUBLIC_NETWORK, _INPUT_SIZE = "yolox_nano.onnx", "384x1248"
_MIN_EXISTENCE = 0.5


def compare_vehicle_trackers(prepared: PreparedDrive) -> Comparison:
    """Track the detections of the camera view, and of a public network where `PUBLIC_NETWORKS` names its folder.

    Raises:
        DriveError: the drive has no labels.
        ImageError: the drive has no images.
    """
    labels = [prepared.drive.labels(frame.index) for frame in prepared.frames]
    poses = [window.newest.world_SE3_velo for window in prepared.windows]
    contenders = []
    for name, detector in _networks().items():
        detections = [detector.detect(camera_image(frame)) for frame in prepared.frames]
        ours = _OurTracker(prepared.frames, poses, detections)
        reference = _ReferenceTracker(detections)
        contenders += [
            Contender(f"Trifuse: {name}", ours.run),
            Contender(f"two thresholds in the image: {name}", reference.run),
        ]
    columns = [
        metric("HOTA [%]", partial(_ratio, labels, "HOTA"), ".1f"),
        metric("MOTA [%]", partial(_ratio, labels, "MOTA"), ".1f"),
        metric("IDSW", lambda tracked: _metrics(labels, tracked).clear.id_switches, ""),
    ]
    return compare("vehicle tracking: KITTI 2D boxes, car", contenders, len(labels), *columns)


def _networks() -> dict[str, ModalityDetector]:
    networks = {"camera view": ModalityDetector("rgb")}
    if folder := os.environ.get("PUBLIC_NETWORKS"):
        networks["public YOLOX-nano"] = _widened(Path(folder, _PUBLIC_NETWORK))
    return networks


def _widened(model: Path) -> ModalityDetector:
    """Open a network of a fixed input for images of KITTI's size."""
    with TemporaryDirectory() as folder:
        described = Path(folder, "wide.yaml")
        described.write_text(f"model: {model.resolve()}\ninput_size: {_INPUT_SIZE}\n")
        return ModalityDetector(described)


@dataclass
class _OurTracker:
    """The tracker of the pipeline; located in the scan without a ground model.

    Attributes:
        frames: Frames in order.
        poses: Pose of each frame.
        detections: Detections in each frame.
    """

    frames: list[Frame]
    poses: list[Float64]
    detections: list[Detections]

    def run(self, i: int) -> ImageBoxes:
        """Return the tracked boxes of frame i."""
        if i == 0:
            self._tracker = VehicleTracker()
        frame = self.frames[i]
        located = locate(FusedDetections.unfused(self.detections[i]), frame, None)
        vehicles = self._tracker.update(located, frame, self.poses[i]).vehicles
        is_reported = vehicles.fused.existence >= _MIN_EXISTENCE
        return _tracked(vehicles.fused.detections, np.where(is_reported, vehicles.ids, -1))


@dataclass
class _ReferenceTracker:
    """The reference tracker in the image.

    Attributes:
        detections: Detections in each frame.
    """

    detections: list[Detections]

    def run(self, i: int) -> ImageBoxes:
        """Return the tracked boxes of frame i."""
        if i == 0:
            self._tracker = ReferenceImageTracker()
        return _tracked(self.detections[i], self._tracker.update(self.detections[i]))


def _tracked(detections: Detections, ids: Any) -> ImageBoxes:  # noqa: ANN401 - (M,) ids
    unknown, frames = np.full(len(ids), -1.0), np.zeros(len(ids), np.int64)
    return ImageBoxes(frames, ids, detections.types, unknown, unknown, detections.boxes_px)


def _metrics(labels: list[Labels], tracked: list[ImageBoxes]) -> MotMetrics:
    frames = [
        kitti_frames(labelled_boxes(true), found, "car", 1)[0]
        for true, found in zip(labels, tracked, strict=True)
    ]
    return evaluate_tracks(frames, MIN_IOU)


def _ratio(labels: list[Labels], name: str, tracked: list[ImageBoxes]) -> float:
    return 100 * _metrics(labels, tracked).ratios()[name]
