"""Corners of a frame that wait for the image of a later one, when the vehicle has come nearer."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.calibration.grey_image import GreyImage
from perception.calibration.image_edges import FOCAL_PX
from perception.calibration.surface_corners import (
    CornerTracks,
    ScanView,
    SurfaceCorners,
    SweepVelocity,
)
from perception.geometry.se3 import inverse
from perception.types import Float64, Frame

# Corners have to come nearer to tell anything. A slow vehicle may wait for the usual way, a slower one tells nothing.
USUAL_TRAVEL_M, MIN_TRAVEL_M = 0.4, 0.15
_MIN_CORNERS = 15


@dataclass(frozen=True)
class ObservedCorners:
    """Corners of a frame with an image.

    Attributes:
        image: Image.
        corners: Its corners on surfaces.
        world_SE3_velo: (4, 4) pose of the LiDAR.
        sweep: Motion of the LiDAR during its sweep.
    """

    image: GreyImage
    corners: SurfaceCorners
    world_SE3_velo: Float64
    sweep: SweepVelocity

    @classmethod
    def of(
        cls, frame: Frame, world_SE3_velo: Float64, sweep: SweepVelocity, offset_SE3_cam: Float64
    ) -> Self:
        """Find the corners of a frame with an image and a calibration.

        Args:
            frame: Frame.
            world_SE3_velo: (4, 4) pose of the LiDAR.
            sweep: Motion of the LiDAR during its sweep.
            offset_SE3_cam: (4, 4) change of the calibration, as far as it is known.
        """
        image = _image(frame)
        corners = SurfaceCorners.find(image, ScanView.of(frame, image), offset_SE3_cam)
        return cls(image, corners, world_SE3_velo, sweep)

    def travelled_m(self, world_SE3_velo: Float64) -> float:
        """Return how far the LiDAR has come to a (4, 4) pose."""
        return float(np.linalg.norm(world_SE3_velo[:3, 3] - self.world_SE3_velo[:3, 3]))

    def tracked(self, later: Frame, world_SE3_velo: Float64) -> CornerTracks | None:
        """Return the corners in the image of a later frame; None of an image of another size, or where few are found.

        Args:
            later: Frame with an image and a calibration.
            world_SE3_velo: (4, 4) pose of the LiDAR.
        """
        image = _image(later)
        if image.size_px != self.image.size_px:
            return None
        later_SE3_velo = inverse(world_SE3_velo) @ self.world_SE3_velo
        tracks = CornerTracks.track(self.corners, self.image, image, later_SE3_velo, self.sweep)
        return tracks if len(tracks) >= _MIN_CORNERS else None


def _image(frame: Frame) -> GreyImage:
    assert frame.image is not None and frame.calibration is not None
    return GreyImage.of(frame.image, frame.calibration, FOCAL_PX)
