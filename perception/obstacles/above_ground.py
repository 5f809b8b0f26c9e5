"""Points above the ground (thesis 5.1.3)."""

from dataclasses import dataclass

import numpy as np

from perception.geometry.grids import LocalArea
from perception.kernels.cropping import split_by_height
from perception.types import Bool, Float, Float32, GroundModel, Int, PointState, UInt8


@dataclass(frozen=True)
class AboveGround:
    """The points of one scan above the ground of the local area.

    Attributes:
        points_velo: (O, 3) obstacle points.
        rows: (O,) where they are in the scan.
        ground_rows: (G,) where the ground points of the area are in the scan.
        scan_length: N.
    """

    points_velo: Float32
    rows: Int
    ground_rows: Int
    scan_length: int

    def point_states(self, is_moving: Bool) -> UInt8:
        """Return the (N,) `PointState` of the whole scan, given which of the (O,) obstacle points move."""
        states = np.full(self.scan_length, PointState.OUTSIDE, np.uint8)
        states[self.ground_rows] = PointState.GROUND
        states[self.rows] = np.where(is_moving, PointState.MOVING, PointState.STATIC)
        return states


def split_by_ground(
    points_velo: Float, ground: GroundModel, area: LocalArea, min_ground_distance_m: float
) -> AboveGround:
    """Split a scan into ground and obstacle points; points above the area are neither.

    Args:
        points_velo: (N, 3+) points in the frame of the ground surface.
        ground: Ground surface in the same frame.
        area: Local area in which obstacles are reported.
        min_ground_distance_m: Smallest distance of an obstacle point from the ground in metres (d_min).
    """
    local = area.crop(points_velo)
    distance_m = np.asarray(ground.distance_m(local.points_velo), np.float32)
    points, rows, ground_rows = split_by_height(
        local.points_velo, local.rows, distance_m, min_ground_distance_m, area.height_m
    )
    return AboveGround(points, rows, ground_rows, len(points_velo))
