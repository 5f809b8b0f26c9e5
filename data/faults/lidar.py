"""Faults of the LiDAR."""

from dataclasses import replace

import numpy as np

from data.faults.moment import FaultMoment
from perception.types import Bool, Float32, Frame

_FIRST_M, _MEAN_M, _LAST_M = 1.0, 6.0, 25.0  # scattered returns, exponentially fewer with distance
_FOG_REFLECTANCE = 0.02
_RAIN_LOSS_M = 60.0  # range at which a share of the returns is lost to rain of size 1
_ELEVATION_STEPS = 4096


def sector_lost(moment: FaultMoment, width_deg: float) -> Frame:
    """Take away all returns of a sector, as behind a covered part of the housing."""
    x, y = moment.frame.points_velo[:, 0], moment.frame.points_velo[:, 1]
    middle_rad = moment.lasting.uniform(-np.pi, np.pi)
    off_rad = np.abs((np.arctan2(y, x) - middle_rad + np.pi) % (2 * np.pi) - np.pi)
    return _kept(moment.frame, off_rad > np.radians(width_deg) / 2)


def beams_lost(moment: FaultMoment, share: float) -> Frame:
    """Take away a share of the beams, drawn by chance; at least one."""
    points = moment.frame.points_velo
    edges_rad = _beam_edges_rad(moment.start.points_velo)
    beams = np.searchsorted(edges_rad, _elevations_rad(points))
    count = len(edges_rad) + 1
    lost = moment.lasting.permutation(count)[: max(1, round(share * count))]
    return _kept(moment.frame, ~np.isin(beams, lost))


def fog(moment: FaultMoment, share: float) -> Frame:
    """Let a share of the returns come from the air, near and weak, and lose more of them the farther they are."""
    points, rng = moment.frame.points_velo, moment.passing
    ranges_m = np.linalg.norm(points[:, :3], axis=1)
    luck = rng.random(len(points))
    scattered_m = _FIRST_M + rng.exponential(_MEAN_M, len(points))
    is_scattered = (luck < share) & (scattered_m < np.minimum(ranges_m - 0.5, _LAST_M))
    is_lost = ~is_scattered & (
        rng.random(len(points)) < 1 - np.exp(-share * ranges_m / _RAIN_LOSS_M * 8)
    )
    foggy = points.copy()
    scale = (scattered_m / np.maximum(ranges_m, 1e-3)).astype(np.float32)
    foggy[is_scattered, :3] *= scale[is_scattered, None]
    foggy[is_scattered, 3] = _FOG_REFLECTANCE
    return _kept(replace(moment.frame, points_velo=foggy), ~is_lost)


def scan_lost(moment: FaultMoment, share: float) -> Frame:
    """Take away a share of all returns, as of a sensor that fails; at least one stays."""
    return _kept(moment.frame, moment.passing.random(len(moment.frame.points_velo)) >= share)


def scan_repeated(moment: FaultMoment, size: float) -> Frame:
    """Give the last scan before the fault again and again, with the time and the pose of now."""
    del size
    return replace(
        moment.frame,
        points_velo=moment.start.points_velo,
        point_times_s=moment.start.point_times_s,
    )


def scan_late(moment: FaultMoment, seconds: float) -> Frame:
    """Delay every second scan."""
    late_s = seconds if moment.count % 2 == 0 else 0.0
    return replace(moment.frame, stamp_s=moment.frame.stamp_s + late_s)


def scan_out_of_order(moment: FaultMoment, seconds: float) -> Frame:
    """Give every second scan the time of an earlier one."""
    early_s = seconds if moment.count % 2 == 0 else 0.0
    return replace(moment.frame, stamp_s=moment.frame.stamp_s - early_s)


def time_jump(moment: FaultMoment, seconds: float) -> Frame:
    """Set the clock forward, or back where the time is negative."""
    return replace(moment.frame, stamp_s=moment.frame.stamp_s + seconds)


def _kept(frame: Frame, is_kept: Bool) -> Frame:
    """Return the frame with these points alone; at least one return stays, as no scan is empty."""
    is_kept = is_kept.copy()
    if not (is_kept & frame.points_velo[:, :3].any(axis=1)).any():
        is_kept[np.abs(frame.points_velo[:, :3]).sum(axis=1).argmax()] = True
    times_s = frame.point_times_s
    return replace(
        frame,
        points_velo=frame.points_velo[is_kept],
        point_times_s=None if times_s is None else times_s[is_kept],
    )


def _elevations_rad(points_velo: Float32) -> Float32:
    across_m = np.hypot(points_velo[:, 0], points_velo[:, 1])
    return np.asarray(np.arctan2(points_velo[:, 2], np.maximum(across_m, 1e-3)), np.float32)


def _beam_edges_rad(points_velo: Float32) -> Float32:
    """Return elevations between the beams of a scan: the emptiest places of a histogram of all returns."""
    elevations = _elevations_rad(points_velo)
    low, high = np.quantile(elevations, (0.001, 0.999))
    counts, edges = np.histogram(elevations, _ELEVATION_STEPS // 8, (float(low), float(high)))
    smooth = np.convolve(counts, np.ones(3) / 3, "same")
    is_low = (smooth[1:-1] < smooth[:-2]) & (smooth[1:-1] <= smooth[2:])
    return np.asarray(edges[1:-2][is_low], np.float32)
