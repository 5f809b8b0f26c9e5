"""Motion of labelled objects, from label boxes and poses (the flags of Table 3.1).

The thesis' own flags were never published. Here an object moves while its box travels over the ground.
The speed of a box is the median of the velocities between all pairs of its positions within a window
(the Theil-Sen slope), which single bad boxes do not shift: those at the image's border, whose hidden
end the annotator guessed, and those of one late INS packet. Only the horizontal way counts, since the
height of a box follows the vehicle's pitch. Two thresholds with a memory turn speeds into flags, so
that an object that stops stands, an object that starts moves, and one that slows down for a moment
does not flicker.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from scipy import ndimage

from data.recorded_drive import RecordedDrive
from perception.errors import LabelError, PoseError
from perception.evaluation.config import MotionLabelConfig, ObstacleProtocol
from perception.evaluation.objects import MotionState
from perception.evaluation.obstacle_measure import ObstacleMeasure
from perception.geometry.boxes import transform_boxes
from perception.geometry.grids import LocalArea
from perception.types import Drive, Float64, Int, Labels

_TIME_SLACK_S = 1e-3  # stamps a frame apart differ by rounding


@dataclass(frozen=True)
class TrackPositions:
    """R labelled boxes of a drive, in order of time within each track.

    Attributes:
        frames: (R,) frame numbers.
        stamps_s: (R,) times in seconds.
        track_ids: (R,) track ids.
        positions_world: (R, 3) bottom centres in the world frame.
    """

    frames: Int
    stamps_s: Float64
    track_ids: Int
    positions_world: Float64


@dataclass(frozen=True)
class PosedLabels:
    """Labels of one frame with its time and pose.

    Attributes:
        frame: Number of the frame.
        stamp_s: Time of the scan.
        world_SE3_velo: (4, 4) pose of the LiDAR.
        labels: Labels of the frame.
    """

    frame: int
    stamp_s: float
    world_SE3_velo: Float64
    labels: Labels


@dataclass(frozen=True)
class MotionLabels:
    """Motion of R labelled boxes.

    Attributes:
        frames: (R,) frame numbers.
        track_ids: (R,) track ids.
        velocities_m_s: (R, 2) velocities over the ground, along x and y of the world; NaN where a track has one
            box in the window.
        motions: (R,) values of `Motion`.
    """

    frames: Int
    track_ids: Int
    velocities_m_s: Float64
    motions: Int

    @property
    def speeds_m_s(self) -> Float64:
        """(R,) lengths of the velocities."""
        return np.asarray(np.linalg.norm(self.velocities_m_s, axis=1))

    def of(self, frame: int, track_ids: Int) -> Int:
        """Return the (M,) motion states of tracks in a frame, unknown where they have no box."""
        rows = self.frames == frame
        motion_of = dict(zip(self.track_ids[rows].tolist(), self.motions[rows], strict=True))
        motions = [motion_of.get(track_id, MotionState.UNKNOWN) for track_id in track_ids.tolist()]
        return np.array(motions, np.int64)

    def velocities_of(self, frame: int, track_ids: Int) -> Float64:
        """Return the (M, 2) velocities of tracks in a frame, NaN where they have no box."""
        rows = self.frames == frame
        velocity_of = dict(
            zip(self.track_ids[rows].tolist(), self.velocities_m_s[rows], strict=True)
        )
        nowhere = np.full(2, np.nan)
        velocities = [velocity_of.get(track_id, nowhere) for track_id in track_ids.tolist()]
        return np.array(velocities, np.float64).reshape(-1, 2)

    def moving_tracks(self) -> list[int]:
        """Return the ids of the tracks that move at any time, in ascending order."""
        return sorted(set(self.track_ids[self.motions == MotionState.MOVING].tolist()))


def obstacle_measure(drive: Drive, area: LocalArea, protocol: ObstacleProtocol) -> ObstacleMeasure:
    """Return the measure of a drive's obstacles, which knows what moves where there are labels and poses.

    Args:
        drive: Drive, with or without labels.
        area: Area over which objects count.
        protocol: Protocol of the evaluation.
    """
    motion = None
    if (
        isinstance(drive, RecordedDrive)
        and drive.is_sequence
        and drive.has_labels
        and drive.has_poses
    ):
        motion = label_drive_motion(drive, protocol.motion)
    return ObstacleMeasure(
        area, protocol.objects, motion, is_labelled_around=isinstance(drive, LabelledAround)
    )


@runtime_checkable
class LabelledAround(Protocol):
    """A drive in which everything around the vehicle is labelled, in the camera's view or not."""

    def labels_around(self, index: int) -> Labels | None:
        """Return the labels of all objects around in one frame, None where it was not labelled; boxes in the image are -1."""
        ...

    def other_labels(self) -> list[PosedLabels]:
        """Return the labels of moments between the frames, numbered down from -1."""
        ...


def evaluation_labels(drive: Drive, index: int) -> Labels | None:
    """Return all labels of one frame, also of what is beside the camera's view; None without labels.

    Raises:
        LabelError: They cannot be read, or are of images alone.
    """
    if not drive.has_labels:
        return None
    if isinstance(drive, LabelledAround):
        return drive.labels_around(index)
    labels = drive.labels(index)
    require_located(labels, drive.root)
    return labels


def require_located(labels: Labels, where: Path) -> None:
    """Validate that labels have 3D boxes.

    Raises:
        LabelError: They are of images alone.
    """
    if np.isnan(labels.boxes_velo.bottom_m).any():
        raise LabelError(where, expected="labels of 3D boxes", found="those of images alone")


def label_drive_motion(
    drive: RecordedDrive, thresholds: MotionLabelConfig | None = None
) -> MotionLabels:
    """Label every box of a drive as static or moving, by the poses of its INS.

    The boxes of a frame whose pose cannot be read are left out, as are those of a drive without INS. Labels of moments
    that have no frame count, too: they tell the motion at the start and the end of a short drive.

    Raises:
        DriveError: The drive has no labels.
        LabelError: The labels cannot be read.
    """
    return label_posed_motion(
        drive, [posed_labels(drive, index) for index in range(len(drive))], thresholds
    )


def label_posed_motion(
    drive: RecordedDrive,
    posed: Sequence[PosedLabels | None],
    thresholds: MotionLabelConfig | None = None,
) -> MotionLabels:
    """Label the boxes of all frames that have a pose, by those of moments between the frames, too."""
    known = [frame for frame in posed if frame is not None]
    others = drive.other_labels() if isinstance(drive, LabelledAround) else []
    return label_motion(gather_tracks([*known, *others]), thresholds)


def posed_labels(drive: RecordedDrive, index: int) -> PosedLabels | None:
    """Read the labels of one frame and its pose, or None where there is no pose."""
    labels = evaluation_labels(drive, index)
    try:
        world_SE3_velo = drive.world_SE3_velo(index)
    except PoseError:
        return None  # reading this frame raises the error
    if world_SE3_velo is None or labels is None:
        return None
    return PosedLabels(index, drive.stamp_s(index), world_SE3_velo, labels)


def gather_tracks(posed_labels: list[PosedLabels]) -> TrackPositions:
    """Transform the boxes of all frames to the world frame; objects without a track are left out."""
    parts = [(posed, posed.labels[posed.labels.track_ids >= 0]) for posed in posed_labels]
    counts = [len(labels) for _, labels in parts]
    positions = [
        transform_boxes(posed.world_SE3_velo, labels.boxes_velo).bottom_m for posed, labels in parts
    ]
    return TrackPositions(
        frames=np.repeat(np.array([posed.frame for posed, _ in parts], np.int64), counts),
        stamps_s=np.repeat(np.array([posed.stamp_s for posed, _ in parts], np.float64), counts),
        track_ids=np.concatenate([np.zeros(0, np.int64), *(part.track_ids for _, part in parts)]),
        positions_world=np.concatenate([np.zeros((0, 3)), *positions]),
    )


def label_motion(
    tracks: TrackPositions, thresholds: MotionLabelConfig | None = None
) -> MotionLabels:
    """Label every box as static or moving at its time."""
    limits = thresholds or MotionLabelConfig()
    velocities_m_s = np.full((len(tracks.frames), 2), np.nan)
    motions = np.full(len(tracks.frames), MotionState.UNKNOWN, np.int64)
    for track_id in np.unique(tracks.track_ids):
        rows = np.flatnonzero(tracks.track_ids == track_id)
        rows = rows[np.argsort(tracks.stamps_s[rows], kind="stable")]
        stamps_s = tracks.stamps_s[rows]
        windows = _windows(stamps_s, limits.window_s)
        velocities_m_s[rows] = [
            _velocity_m_s(stamps_s[window], tracks.positions_world[rows[window], :2])
            for window in windows
        ]
        spans_s = np.array([np.ptp(stamps_s[window]) for window in windows])
        speeds_m_s = np.linalg.norm(velocities_m_s[rows], axis=1)
        motions[rows] = _with_hysteresis(speeds_m_s, spans_s, limits)
    return MotionLabels(tracks.frames, tracks.track_ids, velocities_m_s, motions)


def _windows(stamps_s: Float64, window_s: float) -> list[slice]:
    """Return the rows around every stamp, shifted inwards where the track begins or ends."""
    last_start_s = max(stamps_s[-1] - window_s, stamps_s[0])
    starts_s = np.clip(stamps_s - window_s / 2, stamps_s[0], last_start_s)
    first = np.searchsorted(stamps_s, starts_s - _TIME_SLACK_S)
    last = np.searchsorted(stamps_s, starts_s + window_s + _TIME_SLACK_S)
    return [slice(a, b) for a, b in zip(first.tolist(), last.tolist(), strict=True)]


def _velocity_m_s(stamps_s: Float64, positions_m: Float64) -> Float64:
    """Return the (2,) median velocity over all pairs of positions (Theil-Sen)."""
    earlier, later = np.triu_indices(len(stamps_s), k=1)
    if len(earlier) == 0:
        return np.full(2, np.nan)
    elapsed_s = stamps_s[later] - stamps_s[earlier]
    velocities = (positions_m[later] - positions_m[earlier]) / elapsed_s[:, None]
    return np.asarray(np.median(velocities, axis=0))


def _with_hysteresis(speeds_m_s: Float64, spans_s: Float64, limits: MotionLabelConfig) -> Int:
    """Apply the two thresholds: a moving object stays moving, before and after, while above the lower."""
    with np.errstate(invalid="ignore"):
        starts = (speeds_m_s >= limits.start_m_s) & (speeds_m_s * spans_s >= limits.min_travel_m)
        continues = starts | (speeds_m_s >= limits.stop_m_s)
        is_static = (speeds_m_s < limits.stop_m_s) & (
            spans_s >= limits.min_duration_s - _TIME_SLACK_S
        )
    runs, _ = ndimage.label(continues)
    moves = continues & np.isin(runs, np.unique(runs[starts]))
    return np.select(
        [moves, is_static], [MotionState.MOVING, MotionState.STATIC], MotionState.UNKNOWN
    )
