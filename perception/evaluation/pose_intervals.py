"""Errors of poses since the first scan, and how often the truth lies within the intervals of their covariance.

A first pose has no error: the world is where it begins. Errors are those of the motion since then, along the axes of the
first scan; they add up from keyframe to keyframe, and so does the covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.evaluation.intervals import interval_coverage, squared_mahalanobis
from perception.evaluation.report import Metric, Metrics
from perception.geometry.se3 import inverse, rotation_vector
from perception.types import Float64, Result

# Time since the first scan in seconds, by name.
_SPANS_S = {"up to 1 s": (0.0, 1.05), "1 to 5 s": (1.05, 5.05), "from 5 s": (5.05, np.inf)}


@dataclass(frozen=True)
class PoseMetrics(Metrics):
    """Errors of the motion since the first scan, and shares within the intervals that should hold 90 % of them.

    Attributes:
        frames: Number of poses.
        position_m: Median distance of the positions.
        rotation_deg: Median angle between the rotations.
        position_coverage: Share of the positions within the ellipsoid that should hold 90 %; NaN without covariances.
        rotation_coverage: The same of the rotations.
    """

    frames: Annotated[int, Metric("poses")]
    position_m: Annotated[float, Metric("position [m]", ".3f")]
    rotation_deg: Annotated[float, Metric("rotation [deg]", ".3f")]
    position_coverage: Annotated[float, Metric("positions in 90 %", ".3f")]
    rotation_coverage: Annotated[float, Metric("rotations in 90 %", ".3f")]


class PoseIntervals:
    """Accumulates the errors of the poses of one drive."""

    def __init__(self, true_poses: Sequence[Float64] | None) -> None:
        """Start without a frame.

        Args:
            true_poses: (4, 4) exact world_SE3_velo of every frame of the drive; None where they are not known.
        """
        self._true_poses = true_poses
        self._results: list[tuple[float, int, Float64, Float64]] = []

    def update(self, result: Result) -> None:
        """Add the pose of one frame."""
        if self._true_poses is not None:
            frame = result.frame
            self._results.append(
                (frame.stamp_s, frame.index, result.world_SE3_velo, result.pose_covariance)
            )

    def compute(self) -> dict[str, PoseMetrics]:
        """Return the metrics by the time since the first scan; none without exact poses."""
        if self._true_poses is None or len(self._results) < 2:
            return {}
        start_s, first, start, _ = self._results[0]
        start_SE3_true = inverse(self._true_poses[first])
        turn = np.kron(np.eye(2), start[:3, :3])
        ages_s, errors, covariances = [], [], []
        for stamp_s, index, pose, covariance in self._results[1:]:
            found, true = inverse(start) @ pose, start_SE3_true @ self._true_poses[index]
            between = rotation_vector(found[:3, :3] @ true[:3, :3].T)
            ages_s.append(stamp_s - start_s)
            errors.append(np.concatenate([found[:3, 3] - true[:3, 3], between]))
            covariances.append(turn.T @ covariance @ turn)
        ages = np.array(ages_s)
        return {
            name: _metrics(np.array(errors)[rows], np.array(covariances)[rows])
            for name, (low_s, high_s) in _SPANS_S.items()
            if (rows := (ages > low_s) & (ages <= high_s)).any()
        }


def _metrics(errors: Float64, covariances: Float64) -> PoseMetrics:
    position, rotation = slice(0, 3), slice(3, 6)
    spread = [
        squared_mahalanobis(errors[:, part], covariances[:, part, part])
        for part in (position, rotation)
    ]
    return PoseMetrics(
        frames=len(errors),
        position_m=float(np.median(np.linalg.norm(errors[:, position], axis=1))),
        rotation_deg=float(np.degrees(np.median(np.linalg.norm(errors[:, rotation], axis=1)))),
        position_coverage=interval_coverage(spread[0], 3),
        rotation_coverage=interval_coverage(spread[1], 3),
    )
