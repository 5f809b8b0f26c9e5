"""Labelled objects of a drive, each as one track, to initialise and evaluate trackers of one object."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.derived.moving_truth import MovingTruth, moving_truth
from data.recorded_drive import RecordedDrive
from data.synthetic.drive import SyntheticDrive
from perception.evaluation.single_object.track import ObjectSequence, TrueTrack
from perception.types import Boxes3D, Float64, Labels

_UNLABELLED_OCCLUSION = (
    2  # occlusion of an object that is there by exact truth and not labelled in the image
)


@dataclass(frozen=True)
class DriveObjects:
    """Labelled objects of a drive.

    Attributes:
        sequence: Name of the drive.
        stamps_s: (F,) times of its frames in seconds.
        camera_labels: (F) labels of the objects in the camera's view.
        truth: Motion and poses, with exact boxes of all objects where the drive has them; None
            without poses.
    """

    sequence: str
    stamps_s: Sequence[float]
    camera_labels: Sequence[Labels]
    truth: MovingTruth | None

    @classmethod
    def of(cls, drive: RecordedDrive | SyntheticDrive) -> "DriveObjects":
        """Read the labels of a drive.

        Raises:
            DriveError: The drive has no labels.
            LabelError: The labels cannot be read.
        """
        return cls(
            sequence=drive.name,
            stamps_s=[drive.stamp_s(index) for index in range(len(drive))],
            camera_labels=[drive.labels(index) for index in range(len(drive))],
            truth=moving_truth(drive) if drive.has_poses else None,
        )

    def sequences(self, min_frames: int) -> list[ObjectSequence]:
        """Return every object in the camera's view in a minimum number of frames, from its first to its last."""
        frames: dict[int, list[int]] = {}
        kinds: dict[int, str] = {}
        for frame, labels in enumerate(self.camera_labels):
            for track_id, kind in zip(labels.track_ids.tolist(), labels.types, strict=True):
                frames.setdefault(track_id, []).append(frame)
                kinds[track_id] = str(kind)
        return [
            ObjectSequence(
                f"track {track_id}", self.sequence, track_id, kinds[track_id], where[0], where[-1]
            )
            for track_id, where in sorted(frames.items())
            if track_id >= 0 and len(where) >= min_frames
        ]

    def track(self, target: ObjectSequence) -> TrueTrack:
        """Return one object in those frames in which its position is known."""
        last = min(target.last_frame, len(self.camera_labels) - 1)
        rows = [self._row(frame, target.track_id) for frame in range(target.first_frame, last + 1)]
        known = [row for row in rows if row is not None]
        return TrueTrack(
            frames=np.array([row.frame for row in known], np.int64),
            stamps_s=np.array([self.stamps_s[row.frame] for row in known], np.float64),
            boxes_velo=Boxes3D(
                np.array([row.box_velo.bottom_m[0] for row in known]).reshape(-1, 3),
                np.array([row.box_velo.size_m[0] for row in known]).reshape(-1, 3),
                np.array([row.box_velo.yaw_rad[0] for row in known]).reshape(-1),
            ),
            boxes_px=np.array([row.box_px for row in known]).reshape(-1, 4),
            velocities_m_s=np.array([row.velocity_m_s for row in known]).reshape(-1, 2),
            occlusion=np.array([row.occlusion for row in known], np.int64),
        )

    def _row(self, frame: int, track_id: int) -> "_Row | None":
        """Return one object in one frame, or None where its position is unknown."""
        posed = None if self.truth is None else self.truth.posed[frame]
        camera_labels = _of_track(self.camera_labels[frame], track_id)
        # Exact truth has hidden objects, labels have distant ones.
        known = camera_labels if posed is None else _of_track(posed.labels, track_id)
        boxes = known.boxes_velo if len(known) else camera_labels.boxes_velo
        if len(boxes) == 0:
            return None
        velocity_m_s = np.full(2, np.nan)
        if self.truth is not None and posed is not None:
            world = self.truth.motion.velocities_of(frame, np.array([track_id]))[0]
            # A row vector: times the world's axes in the LiDAR frame.
            velocity_m_s = world @ posed.world_SE3_velo[:2, :2]
        return _Row(
            frame=frame,
            box_velo=boxes[:1],
            box_px=camera_labels.boxes_px[0] if len(camera_labels) else np.full(4, np.nan),
            velocity_m_s=velocity_m_s,
            occlusion=int(camera_labels.occlusion[0])
            if len(camera_labels)
            else _UNLABELLED_OCCLUSION,
        )


def _of_track(labels: Labels, track_id: int) -> Labels:
    return labels[labels.track_ids == track_id]


@dataclass(frozen=True)
class _Row:
    """One object in one frame: a row of a `TrueTrack`."""

    frame: int
    box_velo: Boxes3D
    box_px: Float64
    velocity_m_s: Float64
    occlusion: int
