"""Edges of a scan: where something near ends before something far, at its left, at its right, and on top.

Images show an edge there, whatever is near (Levinson and Thrun, Automatic Online Calibration of Cameras and Lasers,
2013). A grid of the LiDAR's own angles tells neighbours, so that the calibration decides neither the edges nor their
number:

    . . . far far .        top edge: all above are far, and the one below is as near
    . . near near far      right edge: all beside, in three rows, are far, and the one on the other side is as near
    . . near near far

The ground has none: rows below are always nearer.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from perception.kernels.angle_grid import AT_LEFT, AT_RIGHT, AT_TOP, edges_of_grid, nearest_by_angle
from perception.maps.projection import rows_near_view
from perception.sensor import LidarModel
from perception.types import ArrayTable, Bool, Calibration, Float32, Float64, Int

_MAX_RANGE_M = 60.0  # beyond, neighbouring beams are half a metre apart
# Something is far from a surface where it is farther by a tenth and 0.4 m, and belongs to it within 2 % and 0.25 m.
_FAR_RATIO, _FAR_M = 1.1, 0.4
_SAME_RATIO, _SAME_M = 0.02, 0.25
_LIMITS = _MAX_RANGE_M, _FAR_RATIO, _FAR_M, _SAME_RATIO, _SAME_M
_MARGIN_SHARE = 0.1  # of the image's size, by which edges beyond its borders are kept
_NEAREST_M = 1.0
_KINDS = np.array([AT_LEFT, AT_RIGHT, AT_TOP], np.uint8)
# Where the next beam is.
_SIDEWAYS, _UPWARDS = np.array([-1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class ScanEdges(ArrayTable):
    """K edges of a scan.

    Attributes:
        points_velo: (K, 3) places in metres, half a beam beyond the last return of what is near.
        is_upright: (K,) whether it is a left or right edge; else one on top.
        turns: (K,) direction in turns from straight ahead, counter-clockwise, -0.5 to 0.5.
    """

    points_velo: Annotated[Float64, 3]
    is_upright: Bool
    turns: Float64


def find_scan_edges(
    points_velo: Float32, calibration: Calibration, size_px: tuple[int, int], sensor: LidarModel
) -> ScanEdges:
    """Find the edges in and around the camera's field of view.

    Args:
        points_velo: (N, 4) scan.
        calibration: Calibration of the camera, which may be off by some degrees.
        size_px: (width, height) of the image.
        sensor: LiDAR model of the scan.
    """
    in_view = rows_near_view(points_velo, *_widened(calibration, size_px))
    grid = _AngleGrid.of(points_velo, in_view, calibration, sensor)
    edges = edges_of_grid(grid.ranges_m, *_LIMITS)
    rows, columns = np.nonzero(edges > 0)
    kinds, at = np.nonzero(edges[rows, columns] & _KINDS[:, None])
    places = grid.ends(rows[at], columns[at], _SIDEWAYS[kinds], _UPWARDS[kinds])
    turns = np.arctan2(places[:, 1], places[:, 0]) / (2 * np.pi)
    return ScanEdges(places, _UPWARDS[kinds] == 0, turns)


def _widened(calibration: Calibration, size_px: tuple[int, int]) -> tuple[Float64, tuple[int, int]]:
    """Return projection and size of the image with a margin on every side."""
    width, height = size_px
    margin_px = _MARGIN_SHARE * width, _MARGIN_SHARE * height
    shift = np.eye(3)
    shift[:2, 2] = margin_px
    wide = round(width + 2 * margin_px[0]), round(height + 2 * margin_px[1])
    return shift @ calibration.image_P_velo, wide


@dataclass(frozen=True)
class _AngleGrid:
    """Nearest return in each direction of the LiDAR: a row a beam from the top, a column a firing from the left.

    Attributes:
        ranges_m: (L + 2, C + 4) range, infinite without a return, with a margin of one row and two columns.
        point_of: (L, C) row of the return in the scan, -1 without one.
        points_velo: (N, 4) scan.
        column_rad: Angle between two columns.
        rows_rad: (L,) elevation of each row.
    """

    ranges_m: Float32
    point_of: Int
    points_velo: Float32
    column_rad: float
    rows_rad: Float64

    @classmethod
    def of(
        cls, points_velo: Float32, rows: Int, calibration: Calibration, sensor: LidarModel
    ) -> "_AngleGrid":
        """Sort some returns of an (N, 4) scan by their directions."""
        points_velo = np.ascontiguousarray(points_velo, np.float32)
        ahead = calibration.cam_SE3_velo[2, :2]  # the optical axis, seen from above
        between = (sensor.elevations_rad[:-1] + sensor.elevations_rad[1:]) / 2
        nearest_m = max(_NEAREST_M, sensor.min_range_m)
        ranges_m, point_of = nearest_by_angle(
            points_velo,
            rows,
            ahead[0],
            ahead[1],
            sensor.azimuth_step_rad,
            np.sin(between),
            nearest_m,
        )
        return cls(ranges_m, point_of, points_velo, sensor.azimuth_step_rad, sensor.elevations_rad)

    def ends(self, rows: Int, columns: Int, sideways: Float64, upwards: Float64) -> Float64:
        """Return (K, 3) returns, moved by half a beam: an edge is between it and the next one.

        Args:
            rows: (K,) rows of the returns in the grid.
            columns: (K,) their columns.
            sideways: (K,) columns by which the next beam is to the right.
            upwards: (K,) rows by which it is above.
        """
        points = self.points_velo[self.point_of[rows, columns], :3].astype(np.float64)
        across_m = np.hypot(points[:, 0], points[:, 1])
        turned_rad = np.arctan2(points[:, 1], points[:, 0]) - sideways * self.column_rad / 2
        gaps_rad = self.rows_rad[np.maximum(rows - 1, 0)] - self.rows_rad[rows]
        raised_rad = np.arctan2(points[:, 2], across_m) + upwards * gaps_rad / 2
        places = [
            across_m * np.cos(turned_rad),
            across_m * np.sin(turned_rad),
            across_m * np.tan(raised_rad),
        ]
        return np.column_stack(places)
