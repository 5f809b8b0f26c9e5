"""What needs the scans alone, one after another: registration, ground, static and moving, moving objects."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from perception.datmo.detector import SegmentedScan
from perception.datmo.stage import datmo_stage
from perception.geometry.grids import LocalArea
from perception.geometry.threads import limit_blas_threads
from perception.localization.mounting import check_mounting
from perception.localization.registration import LidarOdometry, PoseOrigin
from perception.obstacles.dense_cloud import PosedScan, ScanWindow, merge, register_window
from perception.obstacles.ground_planes import PiecewisePlanesEstimator
from perception.obstacles.ground_surface import GroundSurfaceEstimator
from perception.obstacles.motion_segmentation import motion_segmenter
from perception.pipeline.clock import StageClock
from perception.pipeline.config import PipelineConfig
from perception.sensor import LidarModel
from perception.types import (
    Float32,
    Float64,
    Frame,
    GroundModel,
    Method,
    Obstacles,
    PointState,
    Result,
    Tracks,
)


class GroundEstimator(Protocol):
    """Finds the ground under the newest scan of a window."""

    def update(self, window: ScanWindow) -> GroundModel:
        """Return the ground in the newest scan's frame; a window of one scan begins anew."""
        ...


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
        self._window = ScanWindow(config.previous_scans)
        self._ground = ground_estimator(self._sensor, config, config.method)
        self._motion = motion_segmenter(self._sensor, config.area, config.method)
        self._datmo = datmo_stage(config.datmo, self._sensor, config.area)

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
        if self._config.method == "thesis" and frame.world_SE3_velo is not None:
            self._window.push(PosedScan(points_velo, frame.world_SE3_velo))
            return register_window(self._window), False
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


class _PlanesOfWindow:
    """The thesis' planes through the merged cloud (Algorithm 3 on (5.1))."""

    def __init__(self, sensor: LidarModel, area: LocalArea, seed: int) -> None:
        self._planes = PiecewisePlanesEstimator(sensor, area)
        self._area, self._random = area, np.random.default_rng(seed)

    def update(self, window: ScanWindow) -> GroundModel:
        return self._planes.estimate(merge(window, self._area).points_velo, self._random)


def ground_estimator(sensor: LidarModel, config: PipelineConfig, method: Method) -> GroundEstimator:
    """Make the ground estimator of a method."""
    if method == "thesis":
        return _PlanesOfWindow(sensor, config.area, config.seed)
    return GroundSurfaceEstimator(sensor, config.area)
