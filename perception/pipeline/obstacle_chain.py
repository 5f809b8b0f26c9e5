"""What needs the scans alone, one after another: registration, ground, static and moving, moving objects."""

from dataclasses import dataclass, replace

import numpy as np

from perception.datmo.detector import SegmentedScan
from perception.datmo.stage import datmo_stage
from perception.geometry.threads import limit_blas_threads
from perception.localization.mounting import check_mounting
from perception.localization.registration import LidarOdometry, PoseOrigin
from perception.obstacles.dense_cloud import PosedScan, ScanWindow, register_window
from perception.obstacles.ground import ground_estimator
from perception.obstacles.motion_segmentation import motion_segmenter
from perception.pipeline.clock import StageClock
from perception.pipeline.config import PipelineConfig
from perception.sensor import LidarModel
from perception.types import (
    Float32,
    Float64,
    Frame,
    GroundModel,
    Obstacles,
    PointState,
    Result,
    Tracks,
)


@dataclass(frozen=True)
class LidarResult:
    """What the scans tell at one moment.

    Attributes:
        world_SE3_velo: (4, 4) pose after registration.
        ground: the ground surface in the LiDAR frame.
        obstacles: static and moving.
        tracks: what moves, as objects with an identity.
        is_reset: whether scans before this one no longer fit to it.
    """

    world_SE3_velo: Float64
    ground: GroundModel
    obstacles: Obstacles
    tracks: Tracks
    is_reset: bool

    def result(self, frame: Frame) -> Result:
        """Return it as what is known of the frame."""
        return Result(frame, self.world_SE3_velo, self.ground, self.obstacles, self.tracks)


class ObstacleChain:
    """Remembers one drive, scan after scan."""

    def __init__(self, sensor: LidarModel, config: PipelineConfig) -> None:
        self._sensor, self._config = sensor, config
        self.reset()

    def reset(self) -> None:
        """Forget the drive so far."""
        config = self._config
        self._odometry = LidarOdometry(config.registration)
        self._window = ScanWindow(config.motion.previous_scans)
        sensor, area = self._sensor, config.area
        self._ground = ground_estimator(
            config.ground, config.method_of(config.ground), sensor, area, config.seed
        )
        self._motion = motion_segmenter(
            config.motion, config.method_of(config.motion), sensor, area
        )
        self._datmo = datmo_stage(config.datmo, sensor, area)

    def close(self) -> None:
        """There is nothing to end."""

    def step(self, frame: Frame, clock: StageClock) -> LidarResult:
        """Say where the ground of this frame is, what stands on it, what moves, and where to.

        Raises:
            PerceptionError: the LiDAR is mounted otherwise than its model says, or the INS jumps.
        """
        obstacles, scan = self._segment(frame, clock)
        tracks = Tracks.empty()
        if self._datmo is not None:
            with clock.stage("moving objects"):
                tracks = self._datmo.update(scan)
        return LidarResult(scan.world_SE3_velo, scan.ground, obstacles, tracks, scan.is_reset)

    def segment(self, frame: Frame) -> tuple[Result, SegmentedScan]:
        """Do all that comes before moving objects: for whoever compares ways to find and follow them.

        Raises:
            PerceptionError: as for `step`.
        """
        clock = StageClock()
        with limit_blas_threads():
            obstacles, scan = self._segment(frame, clock)
        result = Result(
            frame,
            scan.world_SE3_velo,
            scan.ground,
            obstacles,
            timings_s=clock.seconds,
            spans=clock.spans,
        )
        return result, scan

    def _segment(self, frame: Frame, clock: StageClock) -> tuple[Obstacles, SegmentedScan]:
        if not len(self._window):
            check_mounting(frame.points_velo, self._sensor, frame.source)
        with clock.stage("registration"):
            # The vehicle's own returns move with it and would be obstacles wherever it is.
            outside_ego = np.flatnonzero(~self._config.ego_vehicle.contains_xy(frame.points_velo))
            points_velo = frame.points_velo.take(outside_ego, axis=0)
            window, is_reset = self._localize(frame, points_velo)
        with clock.stage("ground"):
            ground = self._ground.update(window)
        with clock.stage("static and moving"):
            obstacles = self._motion.update(window, ground)
        pose = window.newest.world_SE3_velo
        scan = SegmentedScan(
            stamp_s=frame.stamp_s,
            points_velo=points_velo,
            point_states=obstacles.point_states,
            ground=ground,
            world_SE3_velo=pose,
            ins_world_SE3_velo=pose if frame.world_SE3_velo is None else frame.world_SE3_velo,
            is_reset=is_reset,
        )
        point_states = np.full(len(frame.points_velo), PointState.OUTSIDE, np.uint8)
        point_states[outside_ego] = obstacles.point_states
        return replace(obstacles, point_states=point_states), scan

    def _localize(self, frame: Frame, points_velo: Float32) -> tuple[ScanWindow, bool]:
        """Put the frame's scan into the window, with its pose; tell whether poses begin anew."""
        registration = self._config.registration
        if self._config.method_of(registration) == "thesis" and frame.world_SE3_velo is not None:
            self._window.push(PosedScan(points_velo, frame.world_SE3_velo))
            icp = registration.icp
            registered = register_window(
                self._window, icp.voxel_size_m, icp.max_correspondence_m, icp.threads
            )
            return registered, False
        localization = self._odometry.update(
            points_velo, frame.stamp_s, frame.world_SE3_velo, frame.source
        )
        if localization.is_reset:
            self._window.clear()
        # A scan that is given twice is no second witness.
        if localization.origin is PoseOrigin.REPEATED:
            self._window.pop()
        self._window.push(PosedScan(points_velo, localization.world_SE3_velo))
        return self._window, localization.is_reset
