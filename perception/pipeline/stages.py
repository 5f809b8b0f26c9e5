"""The stages in their order: one function for each worker, one line for each stage."""

from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from perception.datmo.detector import SegmentedScan
from perception.pipeline.workers import StageClock
from perception.types import Float64, Frame, GroundModel, Obstacles, Result, StageSpan, Tracks

if TYPE_CHECKING:  # they call these functions
    from perception.pipeline.camera_stages import CameraStages
    from perception.pipeline.lidar_stages import LidarStages


@dataclass(frozen=True)
class LidarResult:
    """Result of the LiDAR stages for one frame.

    Attributes:
        world_SE3_velo: (4, 4) refined pose of the LiDAR.
        ground: Ground surface in the LiDAR frame.
        obstacles: Static and moving obstacles.
        tracks: Moving objects with their ids.
        is_reset: Whether poses of earlier scans no longer fit to this one.
        spans: Start and end of each stage.
        scan: Input of DATMO; None where the result comes from another process.
    """

    world_SE3_velo: Float64
    ground: GroundModel
    obstacles: Obstacles
    tracks: Tracks
    is_reset: bool
    spans: tuple[StageSpan, ...]
    scan: SegmentedScan | None

    def of_frame(self, frame: Frame) -> Result:
        """Return it as the result of a frame without a camera."""
        timings_s = {span.stage: span.stop_s - span.start_s for span in self.spans}
        result = Result(frame, self.world_SE3_velo, self.ground, self.obstacles, self.tracks)
        return replace(result, timings_s=timings_s, spans=self.spans)


def run_lidar_stages(
    stages: "LidarStages", frame: Frame, clock: StageClock, *, with_datmo: bool = True
) -> LidarResult:
    """Run the stages that need the scans alone, on the LiDAR worker."""
    scans = clock.run("registration", stages.register, frame)
    ground = clock.run("ground", stages.ground.update, scans.window)
    obstacles = clock.run("static and moving", stages.motion.update, scans.window, ground)
    scan = stages.segmented_scan(frame, scans, ground, obstacles)
    tracks = Tracks.empty()
    if stages.datmo is not None and with_datmo:
        tracks = clock.run("moving objects", stages.datmo.update, scan)
    obstacles = stages.of_whole_scan(frame, scans, obstacles)
    return LidarResult(
        scan.world_SE3_velo, ground, obstacles, tracks, scans.is_reset, clock.spans, scan
    )


def run_camera_stages(
    stages: "CameraStages", frame: Frame, lidar: "Future[LidarResult]", clock: StageClock
) -> Result:
    """Run the stages that need a camera, on the camera worker, beside those of the LiDAR worker."""
    maps = clock.run("maps", stages.maps, frame) if stages.can_detect(frame) else None
    detections = stages.detect(frame, maps, clock)  # image, depth and reflectance detector, fusion
    depthcn = stages.detect_by_depthcn(frame, maps, clock)
    lidar_result = lidar.result()
    vehicles = stages.locate_and_track(frame, detections, lidar_result, clock)
    return stages.result(frame, lidar_result, detections, vehicles, depthcn, clock)
