"""Reference tracker of detections in the image alone: two thresholds of the score, one filter per track, in loops.

Y. Zhang et al., "ByteTrack: Multi-Object Tracking by Associating Every Detection Box", ECCV 2022: detections of high
scores continue tracks first, those of low scores the tracks that are left; only the former begin tracks. It knows
neither the motion of the camera nor the returns of the LiDAR.
"""

from dataclasses import dataclass, field

import numpy as np

from benchmarks.reference.point_tracker import ReferenceKalmanFilter
from perception.geometry.box_overlap_px import iou_px
from perception.tracking.association import assign_hungarian
from perception.types import Detections, Float64, Int

# Scores from which on a detection is a high one, may begin a track, and may continue one.
_HIGH, _NEW, _LOW = 0.6, 0.7, 0.1
_MIN_IOU_HIGH, _MIN_IOU_LOW = 0.2, 0.5
_MAX_UNSEEN = 30  # frames
# Standard deviations as shares of the box's height: of a measured side, and of the change of velocity in a frame.
_SIDE_SHARE, _VELOCITY_SHARE = 1 / 20, 1 / 160
_OBSERVATION = np.eye(4, 8)
_TRANSITION = np.eye(8) + np.eye(8, k=4)


@dataclass
class _ImageTrack:
    """One track: a filter of the middle, the size and their velocities.

    Attributes:
        number: Id of the track.
        kind: Class of the track.
        filter: Filter of column, row, width, height, and their changes in a frame.
        detections: Number of detections.
        unseen: Number of frames since the last one.
    """

    number: int
    kind: str
    filter: ReferenceKalmanFilter
    detections: int = 1
    unseen: int = 0

    @property
    def box_px(self) -> Float64:
        """(4,) x1 y1 x2 y2."""
        middle, size = self.filter.mean[:2], self.filter.mean[2:4]
        return np.concatenate([middle - size / 2, middle + size / 2])

    def predict(self) -> None:
        """Move by one frame."""
        height = max(float(self.filter.mean[3]), 1.0)
        shares = np.repeat([_SIDE_SHARE, _VELOCITY_SHARE], 4)
        self.filter.predict(_TRANSITION, np.diag((shares * height) ** 2))
        self.unseen += 1

    def update(self, box_px: Float64) -> None:
        """Correct by a detection."""
        noise = np.eye(4) * (_SIDE_SHARE * (box_px[3] - box_px[1])) ** 2
        self.filter.update(_middle_and_size(box_px), _OBSERVATION, noise)
        self.detections += 1
        self.unseen = 0


@dataclass
class ReferenceImageTracker:
    """Tracks detections in the image, frame after frame."""

    _tracks: list[_ImageTrack] = field(default_factory=list)
    _next_number: int = 0

    def update(self, detections: Detections) -> Int:
        """Return (M,) the ids of detections; -1 of those without a track that was seen twice."""
        for track in self._tracks:
            track.predict()
        numbers = np.full(len(detections), -1)
        is_high = detections.scores >= _HIGH
        free = list(self._tracks)
        for rows, min_iou in (
            (np.flatnonzero(is_high), _MIN_IOU_HIGH),
            (np.flatnonzero(~is_high & (detections.scores >= _LOW)), _MIN_IOU_LOW),
        ):
            free = _continue(free, detections, rows, min_iou, numbers)
        is_new = (numbers < 0) & (detections.scores >= _NEW)
        for row in np.flatnonzero(is_new).tolist():
            self._init(detections.boxes_px[row], str(detections.types[row]))
        self._tracks = [track for track in self._tracks if track.unseen <= _MAX_UNSEEN]
        return numbers

    def _init(self, box_px: Float64, kind: str) -> None:
        height = box_px[3] - box_px[1]
        deviations = height * np.repeat([2 * _SIDE_SHARE, 10 * _VELOCITY_SHARE], 4)
        mean = np.concatenate([_middle_and_size(box_px), np.zeros(4)])
        state = ReferenceKalmanFilter(mean, np.diag(deviations**2))
        self._tracks.append(_ImageTrack(self._next_number, kind, state))
        self._next_number += 1


def _continue(
    tracks: list[_ImageTrack], detections: Detections, rows: Int, min_iou: float, numbers: Int
) -> list[_ImageTrack]:
    """Continue tracks by some detections, write their ids, and return the tracks that are left."""
    if not (tracks and len(rows)):
        return tracks
    overlap = iou_px(np.array([track.box_px for track in tracks]), detections.boxes_px[rows])
    same = np.array([track.kind for track in tracks])[:, None] == detections.types[rows]
    pairs = assign_hungarian(1.0 - overlap, (overlap >= min_iou) & same)
    for track, row in zip(pairs.tracks.tolist(), rows[pairs.detections].tolist(), strict=True):
        tracks[track].update(detections.boxes_px[row])
        numbers[row] = tracks[track].number
    return [tracks[track] for track in pairs.unmatched_tracks.tolist()]


def _middle_and_size(box_px: Float64) -> Float64:
    return np.concatenate([(box_px[:2] + box_px[2:]) / 2, box_px[2:] - box_px[:2]])
