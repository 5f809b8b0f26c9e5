"""The stages that need the scans alone: registration, ground, static and moving, moving objects."""

from dataclasses import replace

import numpy as np

from perception.datmo.detector import SegmentedScan
from perception.datmo.stage import datmo_stage
from perception.geometry.threads import limit_blas_threads
from perception.localization.mounting import check_mounting
from perception.localization.registration import RegisteredScans, Registration
from perception.obstacles.ground import ground_estimator
from perception.obstacles.motion_segmentation import motion_segmenter
from perception.pipeline.config import PipelineConfig
from perception.pipeline.stages import LidarResult, run_lidar_stages
from perception.pipeline.workers import StageClock
from perception.sensor import LidarModel
from perception.types import Frame, GroundModel, Obstacles, PointState, Result


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
        self.ground = ground_estimator(
            ground, config.method_of(ground), sensor, config.area, config.seed
        )
        self.motion = motion_segmenter(motion, config.method_of(motion), sensor, config.area)
        self.datmo = datmo_stage(config.datmo, sensor, config.area)

    def close(self) -> None:
        """Do nothing: there is no process to end."""

    def step(self, frame: Frame, clock: StageClock) -> LidarResult:
        """Run all stages on a frame.

        Raises:
            PerceptionError: the LiDAR is mounted otherwise than its model says, or the INS jumps.
        """
        return run_lidar_stages(self, frame, clock)

    def segment(self, frame: Frame) -> tuple[Result, SegmentedScan]:
        """Run the stages before moving objects, to compare methods of DATMO on the same scans.

        Raises:
            PerceptionError: the LiDAR is mounted otherwise than its model says, or the INS jumps.
        """
        with limit_blas_threads():
            result = run_lidar_stages(self, frame, StageClock(), with_datmo=False)
        assert result.scan is not None  # it is of this process
        return result.of_frame(frame), result.scan

    def register(self, frame: Frame) -> RegisteredScans:
        """Register the scan, without returns of the vehicle itself, which would be obstacles that move with it."""
        if self._registration.is_empty:
            check_mounting(frame.points_velo, self._sensor, frame.source)
        rows = np.flatnonzero(~self._config.ego_vehicle.contains_xy(frame.points_velo))
        return self._registration.update(frame, rows)

    def segmented_scan(
        self, frame: Frame, scans: RegisteredScans, ground: GroundModel, obstacles: Obstacles
    ) -> SegmentedScan:
        """Return the input of DATMO."""
        newest = scans.window.newest
        ins_pose = frame.world_SE3_velo
        return SegmentedScan(
            stamp_s=frame.stamp_s,
            points_velo=newest.points_velo,
            point_states=obstacles.point_states,
            ground=ground,
            world_SE3_velo=newest.world_SE3_velo,
            ins_world_SE3_velo=newest.world_SE3_velo if ins_pose is None else ins_pose,
            is_reset=scans.is_reset,
        )

    def of_whole_scan(
        self, frame: Frame, scans: RegisteredScans, obstacles: Obstacles
    ) -> Obstacles:
        """Return the obstacles with a state for every point of the frame, returns of the vehicle itself included."""
        point_states = np.full(len(frame.points_velo), PointState.OUTSIDE, np.uint8)
        point_states[scans.rows] = obstacles.point_states
        return replace(obstacles, point_states=point_states)
