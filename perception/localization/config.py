"""Configuration of registration: LiDAR odometry, and the thesis' ICP over a window of scans."""

from dataclasses import dataclass, field

import numpy as np

from perception.types import Method


@dataclass(frozen=True)
class WindowIcpConfig:
    """Registration of the thesis: all scans of the window are aligned with the newest (Algorithm 2).

    Attributes:
        voxel_size_m: Edge of a cell of the box-grid filter in metres (open in the thesis).
        max_correspondence_m: Largest distance of a point-to-point match in metres (open in the thesis).
    """

    voxel_size_m: float = 0.5
    max_correspondence_m: float = 1.0


@dataclass(frozen=True)
class RegistrationConfig:
    """Registration of scans: GICP against a keyframe, from the INS or from constant velocity.

    Attributes:
        method: Method of this stage; else that of the pipeline.
        voxel_size_m: Edge of a cell of the box-grid filter in metres; points farther away than 240 of them are left out.
        max_points: Largest number of points of a scan that are filtered; scans with more are thinned evenly.
        max_correspondence_m: Largest distance of a match in metres; leaves out what moved.
        keyframe_distance_m: Distance in metres after which the reference scan is replaced.
        min_keyframe_distance_m: Distance in metres of the reference scan from which on what is static is told from
            vehicles that creep along.
        keyframe_angle_rad: Rotation in rad after which the reference scan is replaced.
        keyframe_inlier_ratio: Share of matched points below which the reference scan is replaced, 0 to 1.
        min_inlier_ratio: Smallest share of matched points of an accepted alignment, 0 to 1.
        tight_distance_m: Largest distance in metres from the surfaces of the reference scan of a point that speaks for a
            motion, where two motions are compared.
        min_surface_gain: Smallest share of a scan's points by which more speak for another motion than for the motion so
            far, 0 to 1, where it is a correction.
        max_ins_loss: Largest share of a scan's points by which fewer may speak for the motion of the INS than for the
            motion so far, 0 to 1, where it is believed.
        min_moving_ratio: Smallest share of a scan's points that move at which later scans are not aligned with them.
        surface_distance_m: Largest distance in metres of a static point from the surfaces of such a scan.
        ins_prior_share: Share of the matches that, with normals along a direction, tell as much about a motion in it
            as the INS step does, 0 to 1; with fewer, as along a fence, the INS tells more.
        max_correction_m: Largest translation in metres from the initial guess of an accepted alignment.
        max_correction_rad: Largest rotation in rad from the initial guess of an accepted alignment.
        max_gap_s: Largest time between two scans, in seconds, that are matched.
        max_speed_m_s: Largest speed of the vehicle in m/s; a faster INS pose is an error.
        max_acceleration_m_s2: Largest acceleration of the vehicle in m/s².
        max_jump_m: INS error in metres tolerated beyond what speed and acceleration explain.
        max_turn_rad_s: Largest turn rate of the vehicle in rad/s; a faster INS pose is an error.
        icp: Registration by the method of the thesis.
    """

    # Measured: voxels of 0.3 m are no better, of 0.7 m half as accurate;
    # with a sixth of an HDL-64E scan steps are 8 mm off those of a whole one, with a quarter 6 mm.
    method: Method | None = None
    voxel_size_m: float = 0.5
    max_points: int = 20_500
    max_correspondence_m: float = 0.5
    keyframe_distance_m: float = 5.0
    min_keyframe_distance_m: float = 1.0
    keyframe_angle_rad: float = float(np.radians(15))
    keyframe_inlier_ratio: float = 0.6
    min_inlier_ratio: float = 0.4
    tight_distance_m: float = 0.05
    min_surface_gain: float = 0.025
    max_ins_loss: float = 0.04
    min_moving_ratio: float = 0.1
    surface_distance_m: float = 0.1
    ins_prior_share: float = 0.006
    max_correction_m: float = 1.0
    max_correction_rad: float = float(np.radians(4))
    max_gap_s: float = 1.0
    max_speed_m_s: float = 70.0
    max_acceleration_m_s2: float = 20.0
    max_jump_m: float = 2.0
    max_turn_rad_s: float = 4.0
    icp: WindowIcpConfig = field(default_factory=WindowIcpConfig)
