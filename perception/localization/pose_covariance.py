"""Covariances of poses: x, y, z in metres, then a rotation vector in rad, along the axes of the world frame.

What a pose is registered with is uncertain itself, and its rotation moves the pose along an arc around it. Registrations
of a drive err in part alike: the rings of few beams on the road pitch each scan a little to the same side. What is alike
grows with the number of keyframes, what is not with its root.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.geometry.se3 import cross_matrix
from perception.localization.alignment import Alignment
from perception.types import Float64

# Standard deviations of a second without registration, in metres and rad.
_UNREGISTERED = (1.0, 0.02)
_SHORTEST_S = 0.1
# Share of the variance of a registration that is the same for all registrations of a drive: the least by which the
# intervals of 8 to 12 s hold what they say with VLP-16, HDL-32E, HDL-64E and VLS-128 on 18 synthetic streets.
_ALIKE_SHARE = 0.25


@dataclass(frozen=True)
class PoseUncertainty:
    """Uncertainty of a pose since the first scan.

    Attributes:
        by_chance: (6, 6) covariance by errors that differ from registration to registration.
        alike: (6, 6) error of the pose by what all registrations err alike in, a column for each of its six directions.
    """

    by_chance: Float64
    alike: Float64

    @classmethod
    def none(cls) -> Self:
        """Return that of the first scan, where the world begins."""
        return cls(np.zeros((6, 6)), np.zeros((6, 6)))

    @property
    def covariance(self) -> Float64:
        """(6, 6) covariance of the pose."""
        return np.asarray(self.by_chance + self.alike @ self.alike.T)

    def registered(
        self, world_SE3_keyframe: Float64, found: Alignment, world_SE3_velo: Float64
    ) -> "PoseUncertainty":
        """Return the uncertainty of a pose that was registered with a keyframe, whose own this is.

        Args:
            world_SE3_keyframe: (4, 4) pose of the keyframe.
            found: Alignment of the scan with the keyframe.
            world_SE3_velo: (4, 4) pose of the scan.
        """
        away_m = world_SE3_velo[:3, 3] - world_SE3_keyframe[:3, 3]
        turn = np.kron(np.eye(2), world_SE3_keyframe[:3, :3])
        # From rotation and translation in the frame of the keyframe to position and rotation of the scan.
        lever = np.block([[-cross_matrix(away_m), np.eye(3)], [np.eye(3), np.zeros((3, 3))]])
        of_scan = lever @ turn
        carried = self._carried(away_m)
        by_chance = (1 - _ALIKE_SHARE) * of_scan @ found.covariance @ of_scan.T
        alike = np.sqrt(_ALIKE_SHARE) * of_scan @ _root(found.covariance)
        return PoseUncertainty(carried.by_chance + by_chance, carried.alike + alike)

    def unregistered(
        self, world_SE3_last: Float64, world_SE3_velo: Float64, gap_s: float
    ) -> "PoseUncertainty":
        """Return the uncertainty of a pose that the INS or the velocity carried on from the last, whose own this is.

        Args:
            world_SE3_last: (4, 4) last pose.
            world_SE3_velo: (4, 4) pose.
            gap_s: Time between the two in seconds.
        """
        deviations = np.repeat(_UNREGISTERED, 3) * max(gap_s, _SHORTEST_S)
        carried = self._carried(world_SE3_velo[:3, 3] - world_SE3_last[:3, 3])
        return PoseUncertainty(carried.by_chance + np.diag(deviations**2), carried.alike)

    def _carried(self, away_m: Float64) -> "PoseUncertainty":
        """Return what the uncertainty of a pose makes of one at a distance from it."""
        lever = np.block([[np.eye(3), -cross_matrix(away_m)], [np.zeros((3, 3)), np.eye(3)]])
        return PoseUncertainty(lever @ self.by_chance @ lever.T, lever @ self.alike)


def _root(covariance: Float64) -> Float64:
    """Return the symmetric root of a (6, 6) covariance, NaN of one that is not known."""
    if not np.isfinite(covariance).all():
        return np.full_like(covariance, np.nan)
    values, directions = np.linalg.eigh(covariance)
    return np.asarray(directions * np.sqrt(np.maximum(values, 0.0)) @ directions.T)
