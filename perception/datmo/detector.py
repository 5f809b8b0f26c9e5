"""Interface of detectors of moving objects."""

from dataclasses import dataclass
from typing import Protocol

from perception.geometry.footprints import Footprints
from perception.types import Float32, Float64, GroundModel, UInt8


@dataclass(frozen=True)
class SegmentedScan:
    """One scan with the results of the stages before.

    Attributes:
        stamp_s: Time of the scan in seconds.
        points_velo: (N, 4) points without returns of the vehicle itself.
        point_states: (N,) one `PointState` each.
        ground: Ground surface in the LiDAR frame.
        world_SE3_velo: (4, 4) refined pose.
        ins_world_SE3_velo: (4, 4) pose as the INS gave it; the refined one where there is no INS.
        is_reset: Whether poses of earlier scans no longer fit to this one.
        covariance: (6, 6) covariance of the refined pose beside those of the scans before, None where it is not known.
    """

    stamp_s: float
    points_velo: Float32
    point_states: UInt8
    ground: GroundModel
    world_SE3_velo: Float64
    ins_world_SE3_velo: Float64
    is_reset: bool = False
    covariance: Float64 | None = None


@dataclass(frozen=True)
class DetectedObjects:
    """Objects of one scan, in its LiDAR frame.

    Attributes:
        moving: Moving objects.
        static: Static objects, where the detector finds them.
    """

    moving: Footprints
    static: Footprints


class ObjectDetector(Protocol):
    """Detects moving objects, scan after scan."""

    def detect(self, scan: SegmentedScan) -> DetectedObjects:
        """Return the objects of a scan."""
        ...
