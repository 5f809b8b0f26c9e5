"""Moving objects of a drive, frame by frame: by labels and INS poses, or by the exact truth of a synthetic drive."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from data.derived.motion_labels import (
    LabelledAround,
    MotionLabels,
    PosedLabels,
    gather_tracks,
    label_motion,
    label_posed_motion,
    posed_labels,
)
from data.recorded_drive import RecordedDrive
from data.synthetic.drive import SyntheticDrive
from data.synthetic.truth_files import read_truth, truth_files
from perception.errors import CalibrationError, DriveError
from perception.evaluation.config import EvaluationView, MotionLabelConfig
from perception.evaluation.multi_object.track_assignment import (
    MovingScene,
    points_above_bottom,
)
from perception.evaluation.objects import LabelledObjects, LabelledView
from perception.maps.projection import VIRTUAL_CAMERA
from perception.types import Drive, Float64, Frame


@dataclass(frozen=True)
class MovingTruth:
    """Labelled objects of a drive and their motion.

    Attributes:
        posed: Labels and pose of each frame, None where there is no pose.
        motion: Motion of all labelled boxes.
        view: Evaluated region: the camera's view, or everything around.
    """

    posed: Sequence[PosedLabels | None]
    motion: MotionLabels
    view: EvaluationView

    def scene(self, frame: Frame, clearance_m: float) -> MovingScene | None:
        """Return the objects of a frame, or None where its labels have no pose.

        Args:
            frame: Frame with the scan, whose points in each box are counted.
            clearance_m: Height above a box's bottom in metres, below which points count as ground.

        Raises:
            CalibrationError: The camera's view is evaluated, and the size of its image is unknown.
        """
        posed = self.posed[frame.index]
        if posed is None:
            return None
        labels = posed.labels
        ids, boxes = labels.track_ids, labels.boxes_velo
        velocities_world = self.motion.velocities_of(frame.index, ids)
        return MovingScene(
            objects=LabelledObjects(boxes, self.motion.of(frame.index, ids), ids),
            # Row vectors: times the world's axes in the LiDAR frame.
            velocities_m_s=velocities_world @ posed.world_SE3_velo[:2, :2],
            moves_in_drive=np.isin(ids, self._moving_tracks),
            points=points_above_bottom(boxes, frame.points_velo, clearance_m),
            view=_labelled_view(frame, labels.dont_care_px) if self.view == "camera" else None,
        )

    def types(self) -> dict[int, str]:
        """Return the class name of every object."""
        frames = [posed.labels for posed in self.posed if posed is not None]
        return {
            track_id: str(kind)
            for labels in frames
            for track_id, kind in zip(labels.track_ids.tolist(), labels.types, strict=True)
        }

    @cached_property
    def _moving_tracks(self) -> list[int]:
        return self.motion.moving_tracks()


def moving_truth(
    drive: Drive, view: EvaluationView = "camera", thresholds: MotionLabelConfig | None = None
) -> MovingTruth:
    """Return the motion of the labelled objects of a drive.

    A synthetic drive knows the exact place of everyone around. The labels of a recorded drive are put
    into the world by its INS.

    Args:
        drive: Drive with labels and poses.
        view: Evaluated region: the camera's view, or everything around, which takes labels of all of it.
        thresholds: Thresholds of motion.

    Raises:
        DriveError: The drive has no labels with poses, or none of everything around.
    """
    if isinstance(drive, SyntheticDrive):
        exact = _posed_truth(drive)
        motion = label_motion(gather_tracks(exact), thresholds)
        motion = replace(motion, velocities_m_s=_velocities(drive, motion))
        return MovingTruth(exact, motion, view)
    parts = {
        "frames in a row": isinstance(drive, RecordedDrive) and drive.is_sequence,
        "labels with tracks": drive.has_labels,
        "INS poses": drive.has_poses,
    }
    missing = [part for part, is_present in parts.items() if not is_present]
    if not isinstance(drive, RecordedDrive) or missing:
        raise DriveError(
            drive.root,
            expected="labels with tracks, and INS poses",
            found=f"a drive without {' and '.join(missing)}",
            advice="name a drive with both, such as a tracking sequence",
        )
    posed = _posed_labels(drive, view)
    return MovingTruth(posed, label_posed_motion(drive, posed, thresholds), view)


def _posed_labels(drive: RecordedDrive, view: EvaluationView) -> Sequence[PosedLabels | None]:
    """Read the exact truth of a drive, or else its labels and INS poses."""
    files = truth_files(drive)
    if files is not None:
        return read_truth(drive, files)
    if view == "all" and not isinstance(drive, LabelledAround):
        raise DriveError(
            drive.root,
            expected="labels of all objects around, as Argoverse 2, nuScenes and `trifuse synth` have them",
            found="labels of what the camera sees",
            advice="evaluate with --protocol.view camera",
        )
    return [posed_labels(drive, index) for index in range(len(drive))]


def _posed_truth(drive: SyntheticDrive) -> list[PosedLabels]:
    return [
        PosedLabels(
            index,
            drive.stamp_s(index),
            drive.true_world_SE3_velo(index),
            drive.labels_around(index),
        )
        for index in range(len(drive))
    ]


def _velocities(drive: SyntheticDrive, motion: MotionLabels) -> Float64:
    """Return the (R, 2) exact velocities of the boxes."""
    velocities = [
        drive.world.actors[track_id].velocity_m_s(drive.world.road, drive.stamp_s(frame))[:2]
        for frame, track_id in zip(motion.frames.tolist(), motion.track_ids.tolist(), strict=True)
    ]
    return np.array(velocities, np.float64).reshape(-1, 2)


def _labelled_view(frame: Frame, dont_care_px: Float64) -> LabelledView:
    view = LabelledView.of(frame.calibration or VIRTUAL_CAMERA, dont_care_px)
    if view is None:
        raise CalibrationError(
            frame.source,
            expected="a camera calibration with an image size",
            found="none",
        )
    return view
