"""Errors of poses since the first scan, and how often the truth lies within the intervals of their covariance.

Errors are those of the motion since then, along the axes of the first scan; they add up from keyframe to keyframe, and so
does the covariance. Without INS the world is where it begins: a first pose has no error.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.evaluation.intervals import groups, interval_coverage, squared_mahalanobis
from perception.evaluation.report import Metric, Metrics
from perception.geometry.se3 import inverse, rotation_vector
from perception.localization.pose_covariance import carried_covariance
from perception.types import ArrayTable, Float64, Result

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


@dataclass(frozen=True)
class PoseErrors(ArrayTable):
    """Errors of N motions since the first scan, along its axes.

    Attributes:
        ages_s: (N,) Time since the first scan.
        position_m: (N, 3) Errors of the positions.
        rotation_rad: (N, 3) Errors of the rotations, as rotation vectors.
        covariances: (N, 6, 6) Reported covariances of positions and rotations; NaN where they are not known.
    """

    ages_s: Float64
    position_m: Annotated[Float64, 3]
    rotation_rad: Annotated[Float64, 3]
    covariances: Annotated[Float64, 6, 6]

    def summary(self) -> PoseMetrics:
        """Return the medians, and the shares within the intervals."""
        position, rotation = slice(0, 3), slice(3, 6)
        spread = [
            squared_mahalanobis(errors, self.covariances[:, part, part])
            for errors, part in ((self.position_m, position), (self.rotation_rad, rotation))
        ]
        return PoseMetrics(
            frames=len(self),
            position_m=float(np.median(np.linalg.norm(self.position_m, axis=1))),
            rotation_deg=float(np.degrees(np.median(np.linalg.norm(self.rotation_rad, axis=1)))),
            position_coverage=interval_coverage(spread[0], 3),
            rotation_coverage=interval_coverage(spread[1], 3),
        )

    def deviation_ratios(self) -> Float64:
        """Return the (6,) root mean square of the errors over the mean of the reported deviations, x y z and about x y z.

        Deviations that are right make 1, those that are too small more.
        """
        known = np.isfinite(self.covariances).all(axis=(1, 2))
        errors = np.hstack([self.position_m, self.rotation_rad])[known]
        variances = np.diagonal(self.covariances[known], axis1=1, axis2=2)
        return np.asarray(np.sqrt(np.square(errors).mean(axis=0)) / np.sqrt(variances).mean(axis=0))


class PoseIntervals:
    """Accumulates the errors of the poses of one drive."""

    def __init__(self, true_poses: Sequence[Float64] | None) -> None:
        """Start without a frame.

        Args:
            true_poses: (4, 4) exact world_SE3_velo of every frame of the drive; None where they are not known.
        """
        self._true_poses = true_poses
        self._first: tuple[int, float, Float64, Float64] | None = None
        self._errors: list[PoseErrors] = []

    def update(self, result: Result) -> None:
        """Add the pose of one frame."""
        frame = result.frame
        self.add(frame.index, frame.stamp_s, result.world_SE3_velo, result.pose_covariance)

    def add(self, index: int, stamp_s: float, pose: Float64, covariance: Float64) -> None:
        """Add a pose.

        Args:
            index: Number of the frame in the drive.
            stamp_s: Time of its scan.
            pose: (4, 4) world_SE3_velo.
            covariance: (6, 6) covariance of the pose.
        """
        if self._true_poses is None:
            return
        if self._first is None:
            self._first = index, stamp_s, pose, covariance
            return
        first, start_s, start, of_start = self._first
        found, true = (
            inverse(start) @ pose,
            inverse(self._true_poses[first]) @ self._true_poses[index],
        )
        turn = np.kron(np.eye(2), start[:3, :3])
        covariance = covariance + carried_covariance(of_start, pose[:3, 3] - start[:3, 3])
        self._errors.append(
            PoseErrors(
                ages_s=np.array([stamp_s - start_s]),
                position_m=(found[:3, 3] - true[:3, 3])[None],
                rotation_rad=rotation_vector(found[:3, :3] @ true[:3, :3].T)[None],
                covariances=(turn.T @ covariance @ turn)[None],
            )
        )

    @property
    def errors(self) -> PoseErrors:
        """Errors of all poses after the first."""
        return PoseErrors.concatenate(self._errors)

    def compute(self) -> dict[str, PoseMetrics]:
        """Return the metrics by the time since the first scan; none without exact poses."""
        errors = self.errors
        ages_s = errors.ages_s
        spans = {name: (ages_s > low) & (ages_s <= high) for name, (low, high) in _SPANS_S.items()}
        return {name: one.summary() for name, one in groups(errors, spans).items()}
