"""One frame through every stage, in real time and in bounded memory."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Protocol, Self

import numpy as np

from perception.datmo.detector import SegmentedScan
from perception.datmo.stage import DatmoMethod, datmo_stage
from perception.errors import UsageError
from perception.geometry.grids import MOVING_OBJECT_AREA, LocalArea, VehicleBody
from perception.geometry.mounting import check_mounting
from perception.geometry.registration import Localizer, PoseOrigin, RegistrationConfig
from perception.geometry.threads import one_blas_thread
from perception.obstacles.dense_cloud import PosedScan, ScanWindow, merge, register_window
from perception.obstacles.ground_planes import PlaneGround
from perception.obstacles.ground_surface import SurfaceGround
from perception.obstacles.motion import motion_segmenter
from perception.sensor import HDL_64E, LidarModel
from perception.types import Float32, Frame, GroundModel, Method, PointState, Result


@dataclass(frozen=True)
class PipelineConfig:
    """Every choice of the pipeline, with its default.

    Attributes:
        method: our default for ground and obstacles, or the thesis' own.
        datmo: how moving objects are found and followed: our default, the thesis' grids with the values
            of its Table 7.4 or with those of the author's code, or not at all.
        previous_scans: m, how many scans before the newest are merged (Table 7.1).
        area: where ground, obstacles and moving objects are wanted.
        body: the vehicle's own outline; its returns are left out of every stage.
        registration: how scans are registered.
        seed: of the thesis' RANSAC.
    """

    method: Method = "default"
    datmo: DatmoMethod = "default"
    previous_scans: int = 6
    area: LocalArea = MOVING_OBJECT_AREA
    body: VehicleBody = field(default_factory=VehicleBody)
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse a window without history."""
        if self.previous_scans < 1:
            raise UsageError(
                "previous_scans", expected="at least 1", found=str(self.previous_scans)
            )

    @classmethod
    def for_obstacles(cls, method: Method = "default", previous_scans: int = 6) -> Self:
        """Return the choices of the thesis' study of obstacles (7.1.1): its area, and no objects."""
        return cls(method, "none", previous_scans, LocalArea())


class GroundEstimator(Protocol):
    """Finds the ground under the newest scan of a window."""

    def update(self, window: ScanWindow) -> GroundModel:
        """Return the ground in the newest scan's frame; a window of one scan begins anew."""
        ...


class Pipeline:
    """Follows one drive, a frame at a time: `step` for a robot, a loop over frames for files."""

    def __init__(self, sensor: LidarModel = HDL_64E, config: PipelineConfig | None = None) -> None:
        self.sensor = sensor
        self.config = config or PipelineConfig()
        self.reset()

    def reset(self) -> None:
        """Forget the drive so far, as between frames that do not follow each other."""
        self._localizer = Localizer(self.config.registration)
        self._window = ScanWindow(self.config.previous_scans)
        self._ground = ground_estimator(self.sensor, self.config, self.config.method)
        self._motion = motion_segmenter(self.sensor, self.config.area, self.config.method)
        self._datmo = datmo_stage(self.config.datmo, self.sensor, self.config.area)

    def step(self, frame: Frame) -> Result:
        """Say where the ground of this frame is, what stands on it, what moves, and where to.

        Raises:
            PerceptionError: the LiDAR is mounted otherwise than its model says, or the INS jumps.
        """
        clock = StageClock()
        with one_blas_thread():
            result, scan = self._segment(frame, clock)
            if self._datmo is None:
                return result
            with clock.stage("moving objects"):
                tracks = self._datmo.update(scan)
        return replace(result, tracks=tracks, timings_s=clock.seconds)

    def segment(self, frame: Frame) -> tuple[Result, SegmentedScan]:
        """Do all that comes before moving objects: for whoever compares ways to find and follow them.

        Raises:
            PerceptionError: as for `step`.
        """
        with one_blas_thread():
            return self._segment(frame, StageClock())

    def _segment(self, frame: Frame, clock: "StageClock") -> tuple[Result, SegmentedScan]:
        if not len(self._window):
            check_mounting(frame.points_velo, self.sensor, frame.source)
        with clock.stage("registration"):
            # The vehicle's own returns move with it and would be obstacles wherever it is.
            around = np.flatnonzero(~self.config.body.contains_xy(frame.points_velo))
            points_velo = frame.points_velo.take(around, axis=0)
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
        point_states[around] = obstacles.point_states
        obstacles = replace(obstacles, point_states=point_states)
        return Result(frame, pose, ground, obstacles, timings_s=clock.seconds), scan

    def _localize(self, frame: Frame, points_velo: Float32) -> tuple[ScanWindow, bool]:
        """Put the frame's scan into the window, with its pose; tell whether poses begin anew."""
        if self.config.method == "thesis" and frame.world_SE3_velo is not None:
            self._window.push(PosedScan(points_velo, frame.world_SE3_velo))
            return register_window(self._window), False
        localization = self._localizer.update(
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
        self._planes = PlaneGround(sensor, area)
        self._area, self._random = area, np.random.default_rng(seed)

    def update(self, window: ScanWindow) -> GroundModel:
        return self._planes.estimate(merge(window, self._area).points_velo, self._random)


def ground_estimator(sensor: LidarModel, config: PipelineConfig, method: Method) -> GroundEstimator:
    """Make the ground estimator of a method."""
    if method == "thesis":
        return _PlanesOfWindow(sensor, config.area, config.seed)
    return SurfaceGround(sensor, config.area)


class StageClock:
    """Takes the time of one stage after another."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Take the time of what is done within."""
        start = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - start
