"""`trifuse evaluate vehicles`: detected vehicles as objects on the road, over time."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from data.frames import OnBadFrame
from data.kitti.sequence import KittiSequence
from data.kitti.tracking_rows import TrackingRows, read_label_rows
from data.results.vehicles import to_vehicle_rows
from perception.cli.evaluations.document import DatasetInfo, Evaluation, write_evaluation
from perception.cli.evaluations.drive_run import open_labelled_drive
from perception.cli.evaluations.vehicle_runs import (
    LabelNoise,
    VehicleFrame,
    VehicleSource,
    vehicle_frames,
)
from perception.cli.evaluations.vehicle_tables import (
    VehiclesReport,
    vehicle_results,
    vehicle_tables,
)
from perception.errors import DriveError
from perception.evaluation.config import KittiTrackingConfig
from perception.evaluation.multi_object.kitti_protocol import kitti_frames
from perception.evaluation.multi_object.mot_metrics import evaluate_tracks
from perception.evaluation.vehicle_location import LocationErrors, location_errors
from perception.geometry.box_overlap_bev import iou_bev
from perception.maps.projection import camera_of
from perception.types import Drive

# KITTI's moderate: visible or partly hidden, hardly cut off.
_MAX_OCCLUSION, _MAX_TRUNCATION = 1, 0.3
_SAME_PLACE_IOU = 0.15
_PROTOCOL = {
    "tracking": "KITTI tracking benchmark, class car, boxes in the image; rows of vehicles that have an id",
    "location": (
        "true cars that are visible or partly hidden and hardly cut off, each with the detection of the "
        "greatest overlap of at least 0.5 in the image"
    ),
    "same id": (
        "of moving objects and believed vehicles of one frame that overlap on the ground by 0.15 or more, "
        "those of one id"
    ),
}


def vehicles(  # noqa: PLR0913 - flags of a command
    root: Path,
    *,
    sequence: str | None = None,
    detector: VehicleSource = "fused",
    min_score: float = 0.5,
    noise: float = LabelNoise.noise,
    missing: float = LabelNoise.missing,
    seed: int = 0,
    frames: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    json: Path | None = None,
) -> None:
    """Measure detected vehicles as objects: HOTA, MOTA and IDF1 in the image; places on the road.

    Example: trifuse evaluate vehicles kitti/tracking --sequence 0000 --detector depthcn

    Args:
        root: sequences in KITTI's tracking layout, or a synthetic drive in it.
        sequence: which one, where there are several.
        detector: fused, the pipeline's own; depthcn; or labels, made noisy, to see what location and tracking add.
        min_score: of a detection that counts.
        noise: of the sides of labels, as a share of the box's size.
        missing: share of labels that are not detected.
        seed: of both.
        frames: only so many from the start; else all.
        on_bad_frame: stop at a damaged frame, or skip it and say so.
        json: gets the same figures with protocol, data and configuration.
    """
    drive = open_labelled_drive(root, sequence, None, frames)
    label_noise = LabelNoise(noise, missing, seed)
    labels = _label_rows(drive)
    observations = vehicle_frames(
        drive, detector, label_noise, limit=frames, on_bad_frame=on_bad_frame
    )
    report = measure_vehicles(drive, labels, observations, min_score)
    print(
        f"{drive.name}: {report.frames} of {len(drive)} frames, detector {detector}, scores from "
        f"{min_score:g}\n\n{vehicle_tables(report)}"
    )
    if json is not None:
        data = DatasetInfo(
            root=drive.root.resolve(),
            drive=drive.name,
            sensor=drive.sensor.name,
            frames=len(drive),
            first_frames=len(drive) if frames is None else frames,
            frames_evaluated=report.frames,
        )
        choices = {"detector": detector, "min_score": min_score, "label_noise": label_noise}
        evaluation = Evaluation("vehicles", {**_PROTOCOL}, vehicle_results(report))
        write_evaluation(json, data, choices, evaluation)


def measure_vehicles(
    drive: Drive, labels: TrackingRows, observations: Iterable[VehicleFrame], min_score: float
) -> VehiclesReport:
    """Measure frame after frame.

    Raises:
        PerceptionError: a frame cannot be read or used.
    """
    predictions, errors, numbers, colocated_counts = [], [], [], []
    for one in observations:
        frame, found = one.frame, one.tracked.vehicles
        calibration, _ = camera_of(frame)
        predictions.append(to_vehicle_rows(frame.index, found, calibration, min_score))
        true = drive.labels(frame.index)
        is_moderate = (true.occlusion <= _MAX_OCCLUSION) & (true.truncation <= _MAX_TRUNCATION)
        true = true[is_moderate & (true.types == "Car")]
        errors.append(location_errors(found, true.boxes_px, true.boxes_velo, frame.points_velo))
        numbers.append(frame.index)
        colocated_counts.append(_count_colocated(one))
    if not predictions:
        raise DriveError(drive.root, expected="frames with a camera to detect in", found="none")
    config = KittiTrackingConfig()
    read = labels[np.isin(labels.frames, numbers)]
    sequence = kitti_frames(read, TrackingRows.concatenate(predictions), "car", len(drive), config)
    colocated, same_id = np.sum(colocated_counts, axis=0).tolist()
    return VehiclesReport(
        len(predictions),
        evaluate_tracks(sequence, config.min_iou),
        LocationErrors.concatenate(errors),
        colocated,
        same_id,
    )


def _count_colocated(one: VehicleFrame) -> tuple[int, int]:
    """Return how many moving objects share their place with a believed vehicle, and how many its id."""
    found, tracks = one.tracked.vehicles, one.tracked.tracks
    rows = np.flatnonzero((found.ids >= 0) & np.isfinite(found.boxes.yaw_rad))
    together = iou_bev(found.boxes[rows], tracks.boxes) >= _SAME_PLACE_IOU
    is_same = found.ids[rows][:, None] == tracks.ids
    return int(together.any(axis=0).sum()), int((together & is_same).any(axis=0).sum())


def _label_rows(drive: Drive) -> TrackingRows:
    if not isinstance(drive, KittiSequence) or drive.label_file is None:
        raise DriveError(
            drive.root,
            expected="labels with track ids, as in KITTI's tracking layout",
            found="none",
            advice="name a sequence in that layout, or make one: trifuse synth OUT --layout tracking",
        )
    return read_label_rows(drive.label_file)
