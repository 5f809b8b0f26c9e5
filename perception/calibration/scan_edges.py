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

from perception.maps.projection import rows_near_view
from perception.sensor import LidarModel
from perception.types import ArrayTable, Bool, Calibration, Float32, Float64, Int

_MAX_RANGE_M = 60.0  # beyond, neighbouring beams are half a metre apart
# Something is far from a surface where it is farther by a tenth and 0.4 m, and belongs to it within 2 % and 0.25 m.
_FAR_RATIO, _FAR_M = 1.1, 0.4
_SAME_RATIO, _SAME_M = 0.02, 0.25
_MARGIN_SHARE = 0.1  # of the image's size, by which edges beyond its borders are kept
_NEAREST_M = 1.0
_FAR_OUTSIDE = np.float32(np.inf)
_MAX_SORTED_CM = 65_535.0


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
    points = points_velo[in_view, :3].astype(np.float64)
    ranges_m = np.sqrt(np.einsum("ij,ij->i", points, points))
    is_near = (ranges_m > max(_NEAREST_M, sensor.min_range_m)) & np.isfinite(ranges_m)
    points, ranges_m = points[is_near], ranges_m[is_near]
    if not len(points):
        return ScanEdges.empty()
    grid = _AngleGrid.of(points, ranges_m, calibration, sensor)
    found = [
        grid.moved(*grid.side_edges(-1), sideways=-1),
        grid.moved(*grid.side_edges(1), sideways=1),
        grid.moved(*grid.top_edges(), upwards=1),
    ]
    places = np.concatenate(found)
    is_upright = np.repeat([True, True, False], [len(part) for part in found])
    return ScanEdges(places, is_upright, np.arctan2(places[:, 1], places[:, 0]) / (2 * np.pi))


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
        ranges_m: (L + 2, C + 4) range, infinite without a return, with a frame of one row and two columns.
        point_of: (L, C) index of the return, -1 without one.
        points: (N, 3) returns.
        column_rad: Angle between two columns.
        rows_rad: (L,) elevation of each row.
    """

    ranges_m: Float32
    point_of: Int
    points: Float64
    column_rad: float
    rows_rad: Float64

    @classmethod
    def of(
        cls, points: Float64, ranges_m: Float64, calibration: Calibration, sensor: LidarModel
    ) -> "_AngleGrid":
        """Sort (N, 3) returns by their directions, the nearest of each direction last."""
        ahead = calibration.cam_SE3_velo[2, :2]  # the optical axis, seen from above
        across = points[:, :2] @ np.array([ahead[1], -ahead[0]])
        azimuths_rad = np.arctan2(across, points[:, :2] @ ahead)  # to the right
        columns = np.floor(azimuths_rad / sensor.azimuth_step_rad).astype(np.int64)
        columns -= columns.min()
        between = (sensor.elevations_rad[:-1] + sensor.elevations_rad[1:]) / 2
        elevations_rad = np.arcsin(points[:, 2] / ranges_m)
        rows = np.searchsorted(-between, -elevations_rad)
        # Whole centimetres are sorted digit by digit, in a third of the time.
        nearness_cm = _MAX_SORTED_CM - np.minimum(ranges_m * 100, _MAX_SORTED_CM)
        nearest_last = np.argsort(nearness_cm.astype(np.uint16), kind="stable")
        point_of = np.full((sensor.beams, int(columns.max()) + 1), -1)
        point_of[rows[nearest_last], columns[nearest_last]] = nearest_last
        framed = np.full((point_of.shape[0] + 2, point_of.shape[1] + 4), _FAR_OUTSIDE)
        framed[1:-1, 2:-2] = np.where(point_of >= 0, ranges_m[point_of], np.inf)
        return cls(framed, point_of, points, sensor.azimuth_step_rad, sensor.elevations_rad)

    def side_edges(self, side: int) -> tuple[Int, Int]:
        """Return rows and columns of the edges at the left (-1) or right (1) of what is near."""
        beside_m = np.minimum(self._shifted(0, side), self._shifted(0, 2 * side))
        around_m = np.minimum.reduce(
            [beside_m] + [self._shifted(row, side * column) for row in (-1, 1) for column in (1, 2)]
        )
        inside = self._is_same(0, -side) | self._is_same(0, -2 * side)
        return self._edges(around_m, np.isfinite(beside_m), inside)

    def top_edges(self) -> tuple[Int, Int]:
        """Return rows and columns of the edges on top of what is near."""
        above_m = self._shifted(-1, 0)
        around_m = np.minimum.reduce([above_m, self._shifted(-1, -1), self._shifted(-1, 1)])
        return self._edges(around_m, np.isfinite(above_m), self._is_same(1, 0))

    def moved(self, rows: Int, columns: Int, *, sideways: int = 0, upwards: int = 0) -> Float64:
        """Return (K, 3) returns of pixels, moved by half a beam: an edge is between it and the next one."""
        points = self.points[self.point_of[rows, columns]]
        across_m = np.hypot(points[:, 0], points[:, 1])
        turned_rad = np.arctan2(points[:, 1], points[:, 0]) - sideways * self.column_rad / 2
        gaps_rad = self.rows_rad[np.maximum(rows - 1, 0)] - self.rows_rad[rows]
        raised_rad = np.arctan2(points[:, 2], across_m) + upwards * gaps_rad / 2
        return np.column_stack(
            [
                across_m * np.cos(turned_rad),
                across_m * np.sin(turned_rad),
                across_m * np.tan(raised_rad),
            ]
        )

    def _shifted(self, rows: int, columns: int) -> Float32:
        """Return the range of the pixel so many rows below and columns to the right of each one."""
        height, width = self.point_of.shape
        return self.ranges_m[1 + rows : 1 + rows + height, 2 + columns : 2 + columns + width]

    def _is_same(self, rows: int, columns: int) -> Bool:
        """Return which pixels are of one surface with such a neighbour."""
        own_m = self._shifted(0, 0)
        with np.errstate(invalid="ignore"):  # where both are infinite
            gap_m = np.abs(self._shifted(rows, columns) - own_m)
        return np.asarray(gap_m < _SAME_M + _SAME_RATIO * own_m)

    def _edges(self, around_m: Float32, is_measured: Bool, inside: Bool) -> tuple[Int, Int]:
        """Return the pixels before far neighbours; without a return beside it, an end is not measured."""
        own_m = self._shifted(0, 0)
        is_edge = (own_m < _MAX_RANGE_M) & (around_m > _FAR_RATIO * own_m + _FAR_M)
        rows, columns = np.nonzero(is_edge & is_measured & inside)
        return rows, columns
