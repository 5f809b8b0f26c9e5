"""Result of the pipeline for one frame."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from perception.types.detections import Detections, Modality, ModalityDetections
from perception.types.frame import Frame
from perception.types.health import Health
from perception.types.objects import Tracks, Vehicles
from perception.types.obstacles import GroundModel, Obstacles, OccupancyGrid
from perception.types.stages import StageSpan, relative_to_start
from perception.types.table import Float64, UInt8


@dataclass(frozen=True)
class PipelineSnapshot:
    """State of a pipeline between two frames, from which another pipeline of the same configuration goes on.

    Attributes:
        lidar: Memory of the LiDAR stages, in the form of `perception.snapshot`.
        camera: Memory of the camera stages.
    """

    lidar: bytes
    camera: bytes


@dataclass(frozen=True)
class Result:
    """Result of the pipeline for one frame.

    Attributes:
        frame: Frame that was processed.
        world_SE3_velo: (4, 4) pose of the LiDAR: as smooth as the scans say, where the INS says.
        ground: Ground surface in the LiDAR frame.
        obstacles: Static and moving obstacles.
        tracks: Moving objects with their ids.
        modality_detections: Detections of each modality in the main camera; empty where detection is off.
        map_images: (H, W) 8-bit image of each map that a detector used, 0 where nothing is known.
        vehicles: Vehicles of the fused detections, None where detection is off.
        depthcn: Detections of DepthCN in the main camera, None where it is off.
        timings_s: Duration of each stage in seconds; stages that overlap count more than once.
        spans: Start and end of each stage, stages of one worker in their order.
        skipped: Stages that were left out to keep the time budget.
        world_SE3_odom: (4, 4) correction that drew the pose to the INS; the identity without one.
        pose_covariance: (6, 6) covariance of the pose, without INS since the first scan, position in m and rotation
            vector in rad along the axes of the world frame; NaN where the method gives none.
        health: Findings on sensors and stages.
        further_detections: Detections of each modality in each of the frame's further cameras.
        snapshot: State of the pipeline after the frame, where it was asked for.
        occupancy: Occupancy grid, where the outputs of a run show it.
    """

    frame: Frame
    world_SE3_velo: Float64
    ground: GroundModel
    obstacles: Obstacles
    tracks: Tracks = field(default_factory=Tracks.empty)
    modality_detections: ModalityDetections = field(default_factory=dict)
    map_images: Mapping[Modality, UInt8] = field(default_factory=dict)
    vehicles: Vehicles | None = None
    depthcn: Detections | None = None
    timings_s: dict[str, float] = field(default_factory=dict)
    spans: tuple[StageSpan, ...] = ()
    skipped: tuple[str, ...] = ()
    world_SE3_odom: Float64 = field(default_factory=lambda: np.eye(4))
    pose_covariance: Float64 = field(default_factory=lambda: np.full((6, 6), np.nan))
    health: Health = field(default_factory=Health)
    further_detections: tuple[ModalityDetections, ...] = ()
    snapshot: PipelineSnapshot | None = None
    occupancy: OccupancyGrid | None = None

    @property
    def odom_SE3_velo(self) -> Float64:
        """(4, 4) pose of the LiDAR by odometry alone, in which scans of some seconds agree to centimetres."""
        return np.asarray(np.linalg.solve(self.world_SE3_odom, self.world_SE3_velo), np.float64)

    def detections_in(self, camera: int) -> ModalityDetections:
        """Return the detections of each modality in a camera, 0 for the main one."""
        return (self.modality_detections, *self.further_detections)[camera]

    @property
    def duration_s(self) -> float:
        """Time in seconds from the start of the first stage to the end of the last, NaN where it was not measured."""
        return max((one.stop_s for one in relative_to_start(self.spans)), default=float("nan"))

    @property
    def latency_s(self) -> float:
        """Time in seconds from the arrival of the frame to the end of its last stage, NaN where it was not measured."""
        return max((span.stop_s for span in self.spans), default=float("nan"))
