"""The stages that need the scans alone: registration, ground, voxels, static and moving, moving objects."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from perception.datmo.detector import SegmentedScan
from perception.datmo.stage import datmo_stage
from perception.geometry.se3 import from_motion_vector, inverse, motion_vector
from perception.geometry.threads import limit_blas_threads
from perception.health.monitors import ScanAndInsMonitors, is_clock_set, is_scan_usable
from perception.health.scan_statistics import ScanMeter
from perception.localization.mounting import check_mounting
from perception.localization.registration import RegisteredScans, Registration
from perception.obstacles.ground import GroundEstimator, ground_estimator
from perception.obstacles.motion_segmentation import motion_segmenter
from perception.obstacles.motion_segmenter import MotionSegmenter
from perception.pipeline.config import PipelineConfig
from perception.pipeline.workers import StageClock
from perception.sensor import LidarModel
from perception.snapshot import Restorable
from perception.types import (
    INS,
    Float64,
    Frame,
    GroundModel,
    Health,
    HealthFinding,
    HealthLevel,
    Obstacles,
    PointState,
    Result,
    StageSpan,
    Tracks,
    Voxels,
)

_POSE_LOST = HealthFinding(
    "registration",
    HealthLevel.WARN,
    "pose lost",
    "the scan matches those before it at no motion: the pose goes on at the last velocity",
)
# Time after the last scan at which a scan without a valid stamp is taken to be.
_NEXT_S = 1e-3


class PosedGround(NamedTuple):
    """Ground of a scan, and the (4, 4) pose of its LiDAR, drawn to the INS."""

    ground: GroundModel
    world_SE3_velo: Float64


@dataclass(frozen=True)
class LidarResult:
    """Result of the LiDAR stages for one frame.

    Attributes:
        world_SE3_velo: (4, 4) pose of the LiDAR by odometry: of scans of some seconds it agrees to centimetres.
        ground: Ground surface in the LiDAR frame.
        obstacles: Static and moving obstacles.
        tracks: Moving objects with their ids.
        is_reset: Whether poses of earlier scans no longer fit to this one.
        spans: Start and end of each stage.
        scan: Input of DATMO.
        world_SE3_odom: (4, 4) correction that draws the pose to the INS.
        pose_covariance: (6, 6) covariance of the pose so drawn.
        snapshot: Memory of the stages after the frame, where it was asked for.
        health: Health of LiDAR and INS.
    """

    world_SE3_velo: Float64
    ground: GroundModel
    obstacles: Obstacles
    tracks: Tracks
    is_reset: bool
    spans: tuple[StageSpan, ...]
    scan: SegmentedScan
    world_SE3_odom: Float64
    pose_covariance: Float64
    snapshot: bytes | None = None
    health: Health = field(default_factory=Health)

    @property
    def posed_ground(self) -> PosedGround:
        """Ground and drawn pose."""
        return PosedGround(self.ground, self.world_SE3_odom @ self.world_SE3_velo)

    def of_frame(self, frame: Frame) -> Result:
        """Return it as the result of a frame without detectors."""
        return Result(
            frame,
            self.posed_ground.world_SE3_velo,
            self.ground,
            self.obstacles,
            self.tracks,
            timings_s={span.stage: span.stop_s - span.start_s for span in self.spans},
            spans=self.spans,
            world_SE3_odom=self.world_SE3_odom,
            pose_covariance=self.pose_covariance,
            health=self.health,
        )


class LidarFutures(NamedTuple):
    """What the LiDAR worker finds out of one frame, in this order.

    Attributes:
        health: Health of LiDAR and INS.
        ground: Ground and pose of the scan; None where they are not known of this one.
        result: Result of all LiDAR stages.
    """

    health: Future[Health]
    ground: Future[PosedGround | None]
    result: Future[LidarResult]

    def posed_ground(self) -> PosedGround:
        """Return ground and pose as soon as they are known."""
        return self.ground.result() or self.result.result().posed_ground


class LidarStages(Restorable):
    """Runs the LiDAR stages on the frames of a drive in turn."""

    memories = (
        *("_registration", "_ground", "_motion", "_datmo"),
        *("_monitors", "_last", "_last_ins", "_last_s", "_now_s", "_velocity"),
    )

    def __init__(self, sensor: LidarModel, config: PipelineConfig) -> None:
        self._sensor, self._config = sensor, config
        self._meter = ScanMeter(sensor)
        self.reset()

    def reset(self) -> None:
        """Forget the drive so far."""
        self._monitors = ScanAndInsMonitors(self._meter)
        self._reset_stages()

    def _reset_stages(self) -> None:
        sensor, config = self._sensor, self._config
        self._last: LidarResult | None = None
        self._last_s = self._now_s = -np.inf
        self._last_ins: Float64 | None = None
        self._velocity: Float64 = np.zeros(6)  # rotation vector and translation a second
        registration = config.registration
        self._registration = Registration(
            registration, config.method_of(registration), config.motion.previous_scans
        )
        self._ground, self._motion = self._make_segmentation()
        self._datmo = datmo_stage(config.datmo, sensor, config.area_of(sensor))

    def _make_segmentation(self) -> tuple[GroundEstimator, MotionSegmenter[Any]]:
        """Return ground and motion segmentation without memory."""
        sensor, config = self._sensor, self._config
        ground, motion, area = config.ground, config.motion, config.area_of(sensor)
        return (
            ground_estimator(ground, config.method_of(ground), sensor, area, config.seed),
            motion_segmenter(motion, config.method_of(motion), sensor, area),
        )

    def check(self, frame: Frame, clock: StageClock) -> Health:
        """Return the health of LiDAR and INS in a frame, by which its scan is used or not."""
        return clock.run("scan health", self._monitors.update, frame)

    def step(
        self,
        frame: Frame,
        health: Health,
        clock: StageClock,
        *,
        with_datmo: bool = True,
        on_ground: Callable[[PosedGround], object] | None = None,
    ) -> LidarResult:
        """Run the stages on a frame, in their order.

        Args:
            frame: Frame of the drive.
            health: Health of LiDAR and INS in it, by `check`.
            clock: Clock of the stages.
            with_datmo: Whether moving objects are detected and tracked, where DATMO is on.
            on_ground: Function that takes ground and pose of the scan as soon as they are known.

        Raises:
            PerceptionError: the LiDAR is mounted otherwise than its model says, or the INS jumps.
        """
        measured = frame
        if is_clock_set(health):
            self._reset_stages()
        if health.level_of(INS) is HealthLevel.ERROR and self._may_lack_ins:
            frame = replace(frame, world_SE3_velo=None)
        if self._last is not None and not is_scan_usable(health):
            return self._predict(frame, self._last, health, clock)
        scans = clock.run("registration", self._register, frame)
        if scans.is_extrapolated:
            health = health.joined([_POSE_LOST])
            if self._last is not None and not scans.is_reset:
                return self._segment_alone(frame, self._last, scans, health, clock)
        ground = clock.run("ground", self._ground.update, scans.window)
        if on_ground is not None:
            pose = scans.world_SE3_odom @ scans.window.newest.world_SE3_velo
            on_ground(PosedGround(ground, pose))
        voxels = clock.run("voxels", self._motion.voxelize, scans.window, ground)
        obstacles = clock.run("static and moving", self._motion.segment, voxels)
        self._registration.mark_moving(obstacles.point_states == PointState.MOVING)
        scan = _segmented_scan(frame, scans, ground, obstacles)
        tracks = Tracks.empty()
        if self._datmo is not None and with_datmo:
            tracks = clock.run("moving objects", self._datmo.update, scan)
        obstacles = _of_whole_scan(frame, scans, obstacles)
        pose, is_reset = scan.world_SE3_velo, scans.is_reset
        spans, drawn, covariance = clock.spans, scans.world_SE3_odom, scans.covariance
        self._monitors.register(measured, pose, is_reset=is_reset or scans.is_extrapolated)
        result = LidarResult(
            pose, ground, obstacles, tracks, is_reset, spans, scan, drawn, covariance, health=health
        )
        self._remember(result, frame)
        return result

    @property
    def _may_lack_ins(self) -> bool:
        """Whether scans are registered without INS, too; the thesis' window is not."""
        return self._config.method_of(self._config.registration) == "default"

    def _remember(self, result: LidarResult, frame: Frame) -> None:
        """Keep what a scan that cannot be used is predicted from."""
        stamp_s, self._last_ins = frame.stamp_s, frame.world_SE3_velo
        if self._last is not None and not result.is_reset:
            step = inverse(self._last.world_SE3_velo) @ result.world_SE3_velo
            self._velocity = motion_vector(step) / max(stamp_s - self._last_s, _NEXT_S)
        self._last, self._last_s, self._now_s = _without_points(result), stamp_s, stamp_s

    def _predict(
        self, frame: Frame, last: LidarResult, health: Health, clock: StageClock
    ) -> LidarResult:
        """Go on without a scan: the motion of the INS, the ground as it was, and predicted tracks."""
        # A scan out of order takes no time; the next one in order is registered with those before it.
        self._now_s = stamp_s = max(frame.stamp_s, self._now_s + _NEXT_S)
        pose = last.world_SE3_velo @ self._motion_since(frame, stamp_s)
        scan = replace(
            last.scan, stamp_s=stamp_s, world_SE3_velo=pose, ins_world_SE3_velo=pose, is_reset=False
        )
        tracks = Tracks.empty()
        if self._datmo is not None:
            tracks = clock.run("moving objects", self._datmo.update, scan)
        states = np.full(len(frame.points_velo), PointState.OUTSIDE, np.uint8)
        return replace(
            last,
            world_SE3_velo=pose,
            obstacles=replace(last.obstacles, point_states=states),
            tracks=tracks,
            is_reset=False,
            spans=clock.spans,
            scan=scan,
            health=health,
        )

    def _segment_alone(
        self,
        frame: Frame,
        last: LidarResult,
        scans: RegisteredScans,
        health: Health,
        clock: StageClock,
    ) -> LidarResult:
        """Take ground and obstacles, all of them static, from a scan whose pose is not known; the memory stays as it is."""
        estimator, motion = self._make_segmentation()
        ground = clock.run("ground", estimator.update, scans.window)
        voxels = clock.run("voxels", motion.voxelize, scans.window, ground)
        obstacles = clock.run("static and moving", motion.segment, voxels)
        obstacles = _of_whole_scan(frame, scans, obstacles)
        predicted = self._predict(frame, last, health, clock)
        scan = replace(predicted.scan, covariance=scans.window.newest.covariance)
        return replace(predicted, ground=ground, obstacles=obstacles, scan=scan)

    def _motion_since(self, frame: Frame, stamp_s: float) -> Float64:
        """Return the (4, 4) motion since the last scan by the INS, else at constant velocity."""
        is_in_order = frame.stamp_s == stamp_s
        if frame.world_SE3_velo is not None and self._last_ins is not None and is_in_order:
            return inverse(self._last_ins) @ frame.world_SE3_velo
        return from_motion_vector(self._velocity * (stamp_s - self._last_s))

    def segment(self, frame: Frame) -> tuple[Result, SegmentedScan]:
        """Run the stages before moving objects, to compare methods of DATMO on the same scans.

        Raises:
            PerceptionError: the LiDAR is mounted otherwise than its model says, or the INS jumps.
        """
        clock = StageClock()
        with limit_blas_threads():
            result = self.step(frame, self.check(frame, clock), clock, with_datmo=False)
        return result.of_frame(frame), result.scan

    def _register(self, frame: Frame) -> RegisteredScans:
        """Register the scan, without returns of the vehicle itself, which would be obstacles that move with it."""
        if self._registration.is_empty:
            check_mounting(frame.points_velo, self._sensor, frame.source)
        scan = self._config.ego_vehicle.crop(frame.points_velo)
        return self._registration.update(frame, scan)


def _without_points(result: LidarResult) -> LidarResult:
    """Return what holds at the next scan, too: pose and ground, but neither points nor voxels."""
    points_velo, states = np.zeros((0, 4), np.float32), np.zeros(0, np.uint8)
    size_m = result.obstacles.static.size_m
    voxels = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), size_m)
    scan = replace(result.scan, points_velo=points_velo, point_states=states)
    return replace(result, obstacles=Obstacles(states, voxels, voxels), scan=scan, spans=())


def _segmented_scan(
    frame: Frame, scans: RegisteredScans, ground: GroundModel, obstacles: Obstacles
) -> SegmentedScan:
    """Return the input of DATMO."""
    newest, ins_pose = scans.window.newest, frame.world_SE3_velo
    return SegmentedScan(
        stamp_s=frame.stamp_s,
        points_velo=newest.points_velo,
        point_states=obstacles.point_states,
        ground=ground,
        world_SE3_velo=newest.world_SE3_velo,
        ins_world_SE3_velo=newest.world_SE3_velo if ins_pose is None else ins_pose,
        is_reset=scans.is_reset,
        covariance=newest.covariance,
    )


def _of_whole_scan(frame: Frame, scans: RegisteredScans, obstacles: Obstacles) -> Obstacles:
    """Return the obstacles with a state for every point of the frame, returns of the vehicle itself included."""
    point_states = np.full(len(frame.points_velo), PointState.OUTSIDE, np.uint8)
    point_states[scans.rows] = obstacles.point_states
    return replace(obstacles, point_states=point_states)
