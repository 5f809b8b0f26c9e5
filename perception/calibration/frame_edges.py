"""Edges of one frame in scan and image, at the time of the image.

A spinning LiDAR measures the left and the right of an image at other times than its middle; where the vehicle drives, edges
are moved to the time of the stamp. Which way it spins is one of three hypotheses, as no file states it.
"""

from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np

from perception.calibration.image_edges import FOCAL_PX, EdgeMaps, find_image_edges
from perception.calibration.scan_edges import ScanEdges, find_scan_edges
from perception.errors import CalibrationError
from perception.geometry.se3 import transform_points
from perception.localization.deskew import SweepMotion, deskew
from perception.sensor import LidarModel
from perception.types import Float64, Frame

_NIGHT_SHARE = 0.35  # of the scan's edges, in the dark


class SweepTurn(IntEnum):
    """Direction in which a LiDAR turns, seen from above."""

    CLOCKWISE = -1
    NONE = 0  # all points are of one time, or have been moved to one
    COUNTER_CLOCKWISE = 1


@dataclass(frozen=True)
class FrameEdges:
    """Edges of one frame.

    Attributes:
        scan: Edges of the scan in the LiDAR frame, as measured.
        image: Edges of the image.
        cam_SE3_velo: (4, 4) calibration that the frame came with.
        period_s: Time of a turn of the LiDAR in seconds.
        motion: Motion of the LiDAR during the sweep, or None where it is not known.
        is_night: Whether much of the image is dark; the scan's edges there are left out.
    """

    scan: ScanEdges
    image: EdgeMaps
    cam_SE3_velo: Float64
    period_s: float
    motion: SweepMotion | None = None
    is_night: bool = False
    _points_cam: dict[SweepTurn, Float64] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(
        cls,
        frame: Frame,
        sensor: LidarModel,
        motion: SweepMotion | None = None,
        max_focal_px: float = FOCAL_PX,
    ) -> "FrameEdges":
        """Find the edges of a frame.

        Args:
            frame: Frame with an image and a calibration.
            sensor: LiDAR model.
            motion: Motion of the LiDAR during the sweep.
            max_focal_px: Focal length above which the image is made smaller.

        Raises:
            CalibrationError: The frame has no image or no calibration.
        """
        if frame.image is None or frame.calibration is None:
            missing = "calibration" if frame.calibration is None else "image"
            raise CalibrationError(
                frame.source, expected="an image and its calibration", found=f"no {missing}"
            )
        height, width = frame.image.shape[:2]
        edges = cls(
            find_scan_edges(frame.points_velo, frame.calibration, (width, height), sensor),
            find_image_edges(frame.image, frame.calibration, max_focal_px),
            frame.calibration.cam_SE3_velo,
            1 / sensor.rate_hz,
            motion,
        )
        return edges._in_light()

    def _in_light(self) -> "FrameEdges":
        """Return the frame at night without the edges of the scan in the dark, where the image can have none."""
        is_dark = self.image.is_dark(self.image.pixels(self.points_cam(SweepTurn.NONE)))
        if not len(is_dark) or is_dark.mean() < _NIGHT_SHARE:
            return self
        return replace(self, scan=self.scan[~is_dark], is_night=True)

    def thinned(self, count: int) -> "FrameEdges":
        """Return the frame with at most so many edges of the scan, spread evenly."""
        if len(self.scan) <= count:
            return self
        rows = np.linspace(0, len(self.scan) - 1, count).round().astype(np.int64)
        return replace(self, scan=self.scan[rows])

    def points_cam(self, turn: SweepTurn) -> Float64:
        """Return the (K, 3) edges of the scan in the camera's frame, if the LiDAR turns in such a way."""
        if turn not in self._points_cam:
            points = self.scan.points_velo.astype(np.float32)
            if self.motion is not None and turn is not SweepTurn.NONE:
                times_s = (turn * self.period_s * self.scan.turns).astype(np.float32)
                points = deskew(points, times_s, self.motion)
            points_cam = transform_points(self.cam_SE3_velo, points)
            self._points_cam[turn] = np.asarray(points_cam, np.float64)
        return self._points_cam[turn]


def steady_motion(velo_SE3_later: Float64, later_s: float, sensor: LidarModel) -> SweepMotion:
    """Return the motion at constant velocity over one turn around a stamp.

    Args:
        velo_SE3_later: (4, 4) pose of the LiDAR at another time in its frame at the stamp.
        later_s: That time in seconds from the stamp, negative before it.
        sensor: LiDAR model.
    """
    half_s = 0.5 / sensor.rate_hz
    return SweepMotion.steady(velo_SE3_later, later_s, (-half_s, half_s))
