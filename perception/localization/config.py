"""Configuration of registration: LiDAR odometry, and the thesis' ICP over a window of scans."""

from dataclasses import dataclass, field

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
        max_speed_m_s: Largest speed of the vehicle in m/s; a faster INS pose is an error.
        icp: Registration by the method of the thesis.
    """

    # Measured: voxels of 0.3 m are no better, of 0.7 m half as accurate;
    # with a sixth of an HDL-64E scan steps are 8 mm off those of a whole one, with a quarter 6 mm.
    method: Method | None = None
    voxel_size_m: float = 0.5
    max_points: int = 20_500
    max_speed_m_s: float = 70.0
    icp: WindowIcpConfig = field(default_factory=WindowIcpConfig)
