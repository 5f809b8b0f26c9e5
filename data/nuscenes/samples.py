"""Labelled frames of any drive as samples of nuScenes' detection task."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from data.derived.motion_labels import (
    LabelledAround,
    PosedLabels,
    TrackPositions,
    evaluation_labels,
    gather_tracks,
    posed_labels,
)
from data.nuscenes.boxes import category, upright_boxes
from data.nuscenes.scene import NuScenesScene
from data.nuscenes.scene_tables import Annotation
from data.recorded_drive import RecordedDrive
from perception.errors import DriveError, LabelError
from perception.evaluation.nuscenes.boxes import Racks, Surroundings, TaskObjects
from perception.evaluation.nuscenes.protocol import MAX_GAP_S
from perception.evaluation.objects import LabelledView
from perception.geometry.boxes import points_inside, transform_boxes
from perception.geometry.se3 import inverse
from perception.types import Float64, Int, Labels

_RACK = "static_object.bicycle_rack"


@dataclass(frozen=True)
class Sample:
    """Objects of one labelled frame.

    Attributes:
        token: Name in results.
        stamp_us: Time in microseconds.
        truths: Objects in the world of the results.
        track_ids: (M,) track ids of the objects, -1 where they have none.
        surroundings: What tells which boxes count.
    """

    token: str
    stamp_us: int
    truths: TaskObjects
    track_ids: Int
    surroundings: Surroundings


def read_samples(drive: RecordedDrive, indices: Sequence[int] | None = None) -> list[Sample]:
    """Return the labelled frames of a drive, all or those of some indices.

    Raises:
        DriveError: The drive has no labelled boxes.
        PerceptionError: A scan or its labels cannot be read.
    """
    if not drive.has_labels:
        raise DriveError(drive.root, expected=f"labelled boxes of {drive.name}", found="none")
    chosen = range(len(drive)) if indices is None else indices
    if isinstance(drive, NuScenesScene):
        return list(_scene_samples(drive, chosen))
    return list(_labelled_samples(drive, chosen))


def _scene_samples(drive: NuScenesScene, indices: Sequence[int]) -> Iterator[Sample]:
    """Yield the key frames of a scene, by what its tables state."""
    tables = drive.boxes.tables
    boxes = [(sample, box) for sample, ones in tables.annotations.items() for box in ones]
    positions = TrackPositions(
        frames=np.arange(len(boxes)),
        stamps_s=np.array([tables.stamps_us[sample] for sample, _ in boxes], np.float64) * 1e-6,
        track_ids=np.array([drive.boxes.track_ids[box.instance] for _, box in boxes], np.int64),
        positions_world=np.array([box.centre_m for _, box in boxes]).reshape(-1, 3),
    )
    velocities_m_s = central_velocities(positions)
    of_sample: dict[str, list[int]] = {}
    for row, (sample, _) in enumerate(boxes):
        of_sample.setdefault(sample, []).append(row)
    for index in indices:
        scan = drive.scans[index]
        if not scan.is_key_frame:
            continue
        rows = of_sample.get(scan.sample, [])
        here = [boxes[row][1] for row in rows]
        yield Sample(
            scan.sample,
            tables.stamps_us[scan.sample],
            _annotated_objects(here, velocities_m_s[rows], f"{tables.folder} {scan.sample}"),
            positions.track_ids[rows],
            Surroundings(scan.world_SE3_ego[:2, 3], _racks(here)),
        )


def _annotated_objects(boxes: list[Annotation], velocities_m_s: Float64, where: str) -> TaskObjects:
    if not boxes:
        return TaskObjects.empty()
    types = [category(box.category, box.attributes).task_class or "" for box in boxes]
    several = [
        box.attributes
        for box, name in zip(boxes, types, strict=True)
        if name and len(box.attributes) > 1
    ]
    if several:
        raise LabelError(where, expected="one attribute of a box", found=", ".join(several[0]))
    centers_m, size_m = (
        np.stack([getattr(box, name) for box in boxes]) for name in ("centre_m", "size_m")
    )
    turned = np.stack([box.world_R_box.as_matrix() for box in boxes])
    return TaskObjects(
        types=np.array(types, np.str_),
        centers_m=centers_m,
        size_m=size_m,
        yaw_rad=upright_boxes(centers_m, size_m, turned).yaw_rad,
        velocities_m_s=velocities_m_s,
        attributes=np.array([(*box.attributes, "")[0] for box in boxes], np.str_),
        has_points=np.array([box.points != 0 for box in boxes]),
    )


def _racks(boxes: list[Annotation]) -> Racks:
    racks = [box for box in boxes if box.category == _RACK]
    if not racks:
        return Racks.empty()
    return Racks(
        np.stack([box.centre_m for box in racks]),
        np.stack([box.size_m for box in racks]),
        np.stack([box.world_R_box.as_matrix() for box in racks]),
    )


def _labelled_samples(drive: RecordedDrive, indices: Sequence[int]) -> Iterator[Sample]:
    """Yield frames by their labels; velocities follow from the tracks, and scans tell which boxes have points."""
    posed: list[PosedLabels] = []
    if drive.is_sequence and drive.has_poses:
        posed = [one for index in range(len(drive)) if (one := posed_labels(drive, index))]
        posed += drive.other_labels() if isinstance(drive, LabelledAround) else []
    positions = gather_tracks(posed)
    velocities_m_s = central_velocities(positions)
    keys = zip(positions.frames.tolist(), positions.track_ids.tolist(), strict=True)
    row_of = {key: row for row, key in enumerate(keys)}
    velocities_m_s = np.vstack([velocities_m_s, np.full(2, np.nan)])
    for index in indices:
        labels, token = evaluation_labels(drive, index), drive.sample_token(index)
        if labels is None or token is None:
            continue
        pose = drive.map_SE3_velo(index)
        boxes = transform_boxes(pose, labels.boxes_velo)
        rows = [row_of.get((index, track), -1) for track in labels.track_ids.tolist()]
        inside = points_inside(labels.boxes_velo, drive.points_velo(index))
        truths = TaskObjects(
            types=drive.task_classes(index, labels),
            centers_m=boxes.centers_m,
            size_m=boxes.size_m,
            yaw_rad=boxes.yaw_rad,
            velocities_m_s=velocities_m_s[np.array(rows, np.int64)],
            attributes=np.full(len(labels), ""),
            has_points=np.asarray(inside.any(axis=1)),
        )
        view = _labelled_view(drive, index, labels)
        surroundings = Surroundings(pose[:2, 3], Racks.empty(), view)
        stamp_us = round(drive.stamp_s(index) * 1e6)
        yield Sample(token, stamp_us, truths, labels.track_ids, surroundings)


def _labelled_view(drive: RecordedDrive, index: int, labels: Labels) -> LabelledView | None:
    """Return the image to which the labels of a frame are confined, its camera in the world of results; None without one."""
    calibration = drive.frame_calibration(index)
    if isinstance(drive, LabelledAround) or calibration is None:
        return None
    cam_SE3_map = calibration.cam_SE3_velo @ inverse(drive.map_SE3_velo(index))
    return LabelledView.of(replace(calibration, cam_SE3_velo=cam_SE3_map), labels.dont_care_px)


def central_velocities(positions: TrackPositions) -> Float64:
    """Return the (R, 2) velocities from the label before to the one behind, or one of them; NaN where they are too far."""
    order = np.lexsort((positions.stamps_s, positions.track_ids))
    ids, stamps_s = positions.track_ids[order], positions.stamps_s[order]
    places_m = positions.positions_world[order, :2]
    is_next: Int = (ids[1:] == ids[:-1]).astype(np.int64)
    before, after = np.append(0, is_next)[: len(ids)], np.append(is_next, 0)[: len(ids)]
    rows = np.arange(len(ids))
    elapsed_s = stamps_s[rows + after] - stamps_s[rows - before]
    is_known = (elapsed_s > 0) & (elapsed_s <= MAX_GAP_S * np.maximum(before + after, 1))
    velocities_m_s = np.full((len(ids), 2), np.nan)
    steps_m = places_m[rows + after] - places_m[rows - before]
    velocities_m_s[order[is_known]] = steps_m[is_known] / elapsed_s[is_known, None]
    return velocities_m_s
