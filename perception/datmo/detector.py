"""What every detector of moving objects offers."""

from dataclasses import dataclass
from typing import Protocol

from perception.geometry.footprints import Footprints
from perception.types import Float32, Float64, GroundModel, UInt8


@dataclass(frozen=True)
class SegmentedScan:
    """One scan, and what the stages before say of it.

    Attributes:
        stamp_s: its time.
        points_velo: (N, 4) without the vehicle's own returns.
        point_states: (N,) one `PointState` each.
        ground: in the LiDAR frame.
        world_SE3_velo: (4, 4) refined pose.
        ins_world_SE3_velo: (4, 4) pose as the INS gave it; the refined one where there is no INS.
        is_reset: whether poses before this scan no longer fit to it.
    """

    stamp_s: float
    points_velo: Float32
    point_states: UInt8
    ground: GroundModel
    world_SE3_velo: Float64
    ins_world_SE3_velo: Float64
    is_reset: bool = False


@dataclass(frozen=True)
class DetectedObjects:
    """The things of one scan, in its LiDAR frame.

    Attributes:
        moving: things that move.
        static: things that stand, where the detector knows them.
    """

    moving: Footprints
    static: Footprints


class ObjectDetector(Protocol):
    """Finds moving objects, scan after scan."""

    def detect(self, scan: SegmentedScan) -> DetectedObjects:
        """Cut a scan into things."""
        ...
