"""The stages that need the scans alone: registration, ground, static and moving, moving objects."""

from dataclasses import dataclass, replace

import numpy as np

from perception.datmo.detector import SegmentedScan
from perception.datmo.stage import datmo_stage
from perception.geometry.threads import limit_blas_threads
from perception.localization.mounting import check_mounting
from perception.localization.registration import Registration
from perception.obstacles.ground import ground_estimator
from perception.obstacles.motion_segmentation import motion_segmenter
from perception.pipeline.config import PipelineConfig
from perception.pipeline.workers import StageClock
from perception.sensor import LidarModel
from perception.types import (
    Float64,
    Frame,
    GroundModel,
    Int,
    Obstacles,
    PointState,
    Result,
    StageSpan,
    Tracks,
)


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
    """

    world_SE3_velo: Float64
    ground: GroundModel
    obstacles: Obstacles
    tracks: Tracks
    is_reset: bool
    spans: tuple[StageSpan, ...] = ()

    def of_frame(self, frame: Frame) -> Result:
        """Return it as the result of a frame without a camera."""
        return Result(
            frame,
            self.world_SE3_velo,
            self.ground,
            self.obstacles,
            self.tracks,
            timings_s={span.stage: span.stop_s - span.start_s for span in self.spans},
            spans=self.spans,
        )


class LidarStages:
    """Runs the LiDAR stages on the frames of a drive in turn."""

    def __init__(self, sensor: LidarModel, config: PipelineConfig) -> None:
        """Make the stages.

        Args:
            sensor: LiDAR model of the scans.
            config: Pipeline configuration.
        """
        self._sensor, self._config = sensor, config
        self.reset()

    def reset(self) -> None:
        """Forget the drive so far."""
        sensor, config = self._sensor, self._config
        registration, ground, motion = config.registration, config.ground, config.motion
        self._registration = Registration(
            registration, config.method_of(registration), motion.previous_scans
        )
        self._ground = ground_estimator(
            ground, config.method_of(ground), sensor, config.area, config.seed
        )
        self._motion = motion_segmenter(motion, config.method_of(motion), sensor, config.area)
        self._datmo = datmo_stage(config.datmo, sensor, config.area)

    def close(self) -> None:
        """Do nothing: there is no process to end."""

    def step(self, frame: Frame, clock: StageClock) -> LidarResult:
        """Run all stages on a frame.

        Raises:
            PerceptionError: the LiDAR is mounted otherwise than its model says, or the INS jumps.
        """
        scan, result = self._segment(frame, clock)
        if self._datmo is not None:
            with clock.stage("moving objects"):
                result = replace(result, tracks=self._datmo.update(scan))
        return replace(result, spans=clock.spans)

    def segment(self, frame: Frame) -> tuple[Result, SegmentedScan]:
        """Run the stages before moving objects, to compare methods of DATMO on the same scans.

        Raises:
            PerceptionError: the LiDAR is mounted otherwise than its model says, or the INS jumps.
        """
        clock = StageClock()
        with limit_blas_threads():
            scan, result = self._segment(frame, clock)
        return replace(result, spans=clock.spans).of_frame(frame), scan

    def _segment(self, frame: Frame, clock: StageClock) -> tuple[SegmentedScan, LidarResult]:
        """Run registration, ground estimation and static-moving segmentation."""
        if self._registration.is_empty:
            check_mounting(frame.points_velo, self._sensor, frame.source)
        with clock.stage("registration"):
            rows = self._rows_outside_ego_vehicle(frame)
            points_velo = frame.points_velo.take(rows, axis=0)
            scans = self._registration.update(frame, points_velo)
        with clock.stage("ground"):
            ground = self._ground.update(scans.window)
        with clock.stage("static and moving"):
            obstacles = self._motion.update(scans.window, ground)
        pose = scans.window.newest.world_SE3_velo
        scan = SegmentedScan(
            stamp_s=frame.stamp_s,
            points_velo=points_velo,
            point_states=obstacles.point_states,
            ground=ground,
            world_SE3_velo=pose,
            ins_world_SE3_velo=pose if frame.world_SE3_velo is None else frame.world_SE3_velo,
            is_reset=scans.is_reset,
        )
        point_states = np.full(len(frame.points_velo), PointState.OUTSIDE, np.uint8)
        point_states[rows] = obstacles.point_states
        obstacles = replace(obstacles, point_states=point_states)
        return scan, LidarResult(pose, ground, obstacles, Tracks.empty(), scans.is_reset)

    def _rows_outside_ego_vehicle(self, frame: Frame) -> Int:
        """Return the points that are no returns of the vehicle itself, which would be obstacles that move with it."""
        return np.flatnonzero(~self._config.ego_vehicle.contains_xy(frame.points_velo))
