"""Reference of the normal equations of corners: distances in the later image and their slopes, by NumPy."""

from dataclasses import replace

import numpy as np

from perception.calibration.surface_corners import CornerTracks
from perception.geometry.se3 import from_motion_vector, inverse
from perception.types import Float64


def corner_misfits(
    tracks: CornerTracks, offset_SE3_cam: Float64, sweep: float, motion_error: Float64
) -> tuple[Float64, Float64]:
    """Return (K, 2) distances in pixels of corners from where they should be, and their (K, 2, 13) slopes.

    Args:
        tracks: Corners of one frame.
        offset_SE3_cam: (4, 4) change of the calibration.
        sweep: Share of the sweep.
        motion_error: (6,) error of the motion in the camera's frame.
    """
    surfaces = tracks.corners.surfaces_cam(offset_SE3_cam)
    cam_SE3_velo = offset_SE3_cam @ tracks.corners.view.cam_SE3_velo
    moved = (
        from_motion_vector(motion_error)
        @ cam_SE3_velo
        @ tracks.later_SE3_velo
        @ inverse(cam_SE3_velo)
    )
    distances_m = surfaces.distances_m + sweep * tracks.sweep_shifts_m
    surfaces = replace(surfaces, distances_m=distances_m)
    points = surfaces.points_m()
    with np.errstate(divide="ignore", invalid="ignore"):
        per_shift = surfaces.rays / surfaces.slopes[:, None] @ moved[:3, :3].T
    later = points @ moved[:3, :3].T + moved[:3, 3]
    crosses = np.cross(surfaces.normals, points)
    # Slopes of the later point by turn, shift, sweep, and the error of the motion.
    slopes = np.empty((len(points), 3, 13))
    slopes[:, :, 3:6] = (
        per_shift[:, :, None] * surfaces.normals[:, None] + np.eye(3) - moved[:3, :3]
    )
    before = np.einsum("ij,kjl->kil", moved[:3, :3], _crosses(points))
    slopes[:, :, :3] = -per_shift[:, :, None] * crosses[:, None] - _crosses(later) + before
    slopes[:, :, 6] = per_shift * tracks.sweep_shifts_m[:, None]
    slopes[:, :, 7:10], slopes[:, :, 10:] = -_crosses(later), np.eye(3)
    P = tracks.corners.view.image_P_cam
    scaled = later @ P[:, :3].T + P[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        expected_px = scaled[:, :2] / scaled[:, 2:]
        by_point = (P[:2, :3] - expected_px[:, :, None] * P[2, :3]) / scaled[:, 2, None, None]
    return expected_px - tracks.later_px, by_point @ slopes


def _crosses(points: Float64) -> Float64:
    """Return (K, 3, 3) matrices that multiply as the cross products with (K, 3) vectors do."""
    x, y, z = points.T
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.moveaxis(np.array(rows), 2, 0)
