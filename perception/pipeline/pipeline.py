"""One frame through every stage, in real time and in bounded memory.

    obstacles  | registration - ground - static and moving - moving objects -.
               |                                                             |
    vehicles   | maps - three detectors, fused - DepthCN -------------------- vehicles - Result

Each line is a worker, which takes frame after frame; a stage waits for those that its input is from. Where
both have something to do, that of the obstacles has a process of its own.
"""

import logging
import time
from collections.abc import Iterable
from concurrent.futures import Future
from contextlib import ExitStack
from dataclasses import replace
from typing import Self

from perception.detection.detectors.multimodal import MultimodalOutput
from perception.detection.vehicles.locate import locate
from perception.errors import CalibrationError
from perception.geometry.threads import limit_opencv_threads
from perception.maps.projection import camera_of
from perception.pipeline.clock import StageClock
from perception.pipeline.config import PipelineConfig
from perception.pipeline.detection_chain import (
    EMPTY_DETECTION_RESULT,
    DetectionResult,
    is_detection_enabled,
    load_detectors,
)
from perception.pipeline.obstacle_chain import LidarResult, ObstacleChain
from perception.pipeline.obstacle_process import ObstacleProcess
from perception.pipeline.stream import FramePolicy, ResultStream
from perception.pipeline.workers import InlineWorker, ThreadWorker, Worker
from perception.sensor import HDL_64E, LidarModel
from perception.tracking.vehicles.tracker import VehicleTracker
from perception.types import Frame, Result

log = logging.getLogger(__name__)

# One frame for each worker.
_MAX_IN_FLIGHT = 2


class Pipeline:
    """Follows one drive, a frame at a time: `step` for a robot, `stream` for files and for live use.

    A context manager, which ends its workers and their process.
    """

    def __init__(self, sensor: LidarModel = HDL_64E, config: PipelineConfig | None = None) -> None:
        """Open the networks, and begin the other process; both are ready for the first frame then.

        Args:
            sensor: whose scans will come.
            config: every choice.

        Raises:
            ModelError: a network is missing, or is not what it is wanted for.
            PerceptionError: no process can be started.
        """
        self.sensor = sensor
        self.config = config or PipelineConfig()
        self._has_detectors = is_detection_enabled(self.config.detection)
        # Where nothing works beside them, obstacles need no process of their own.
        has_own_process = self.config.parallel and self._has_detectors
        self._obstacles = (ObstacleProcess if has_own_process else ObstacleChain)(
            sensor, self.config
        )
        with ExitStack() as on_error:
            on_error.callback(self._obstacles.close)
            self._detection = load_detectors(self.config.detection, sensor)
            self._obstacles.reset()  # a process answers when it is ready for the first frame
            on_error.pop_all()
        self._reset_vehicles()
        if self.config.parallel:
            limit_opencv_threads()
        kind = ThreadWorker if self.config.parallel else InlineWorker
        self._obstacle_worker: Worker = kind("obstacles")
        self._vehicle_worker: Worker = kind("vehicles")
        self._has_warned = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the workers and their process; no frame can be given any more."""
        self._obstacle_worker.close()
        self._vehicle_worker.close()
        self._obstacles.close()

    def reset(self) -> None:
        """Forget the drive so far, as between frames that do not follow each other."""
        self._reset_stages().result()

    def step(self, frame: Frame) -> Result:
        """Say where the ground of this frame is, what stands on it, what moves, and which vehicles there are.

        Raises:
            PerceptionError: the LiDAR is mounted otherwise than its model says, or the INS jumps.
        """
        return self._submit(frame, time.perf_counter()).result()

    def stream(
        self, frames: Iterable[Frame], policy: FramePolicy = "every", *, is_sequence: bool = True
    ) -> ResultStream:
        """Return an iterator over the results of frames, in order; the next is worked on meanwhile.

        What is found is the same as by `step`. Use it in a `with`, or take all of it.

        Args:
            frames: from files, or as they come.
            policy: `every` frame, for which the source waits; or the `latest`, for a source that does not:
                frames that come while there is no room are dropped, and counted.
            is_sequence: whether they follow each other; else nothing is remembered from one to the next.

        Example:
            with Pipeline() as pipeline, pipeline.stream(lidar, "latest") as results:
                for result in results:
                    drive_by(result)
        """
        submit = self._submit if is_sequence else self._submit_independent
        return ResultStream(frames, submit, policy, _MAX_IN_FLIGHT)

    def _submit_independent(self, frame: Frame, arrival_s: float) -> "Future[Result]":
        self._reset_stages()
        return self._submit(frame, arrival_s)

    def _reset_stages(self) -> "Future[None]":
        self._vehicle_worker.submit(self._reset_vehicles)
        return self._obstacle_worker.submit(self._obstacles.reset)

    def _reset_vehicles(self) -> None:
        self._vehicles = VehicleTracker(self.config.vehicles.tracker)

    def _submit(self, frame: Frame, arrival_s: float) -> "Future[Result]":
        """Give a frame's stages to the workers, each after those that it waits for."""
        lidar_clock = StageClock(self._obstacle_worker.name, arrival_s)
        camera_clock = StageClock(self._vehicle_worker.name, arrival_s)
        lidar_future = self._obstacle_worker.submit(self._obstacles.step, frame, lidar_clock)
        return self._vehicle_worker.submit(
            self._assemble_result, frame, lidar_future, lidar_clock, camera_clock
        )

    def _assemble_result(
        self,
        frame: Frame,
        lidar_future: "Future[LidarResult]",
        lidar_clock: StageClock,
        camera_clock: StageClock,
    ) -> Result:
        """Look through the camera's eyes while obstacles are found; then join what both have seen."""
        detected = self._detect(frame, camera_clock)
        lidar_result = lidar_future.result()
        if lidar_result.is_reset:
            self._vehicles.clear()
        result = lidar_result.result(frame)
        if detected.multimodal is not None:
            result = self._add_vehicles(result, detected.multimodal, camera_clock)
        return replace(
            result,
            depthcn=detected.depthcn,
            timings_s=lidar_clock.seconds | camera_clock.seconds,
            spans=lidar_clock.spans + camera_clock.spans,
        )

    def _detect(self, frame: Frame, clock: StageClock) -> DetectionResult:
        if not self._has_detectors:
            return EMPTY_DETECTION_RESULT
        try:
            camera_of(frame)
        except CalibrationError as error:
            self._warn_once("no vehicles are detected: %s", error)
            return EMPTY_DETECTION_RESULT
        return self._detection.detect(frame, clock)

    def _add_vehicles(
        self, result: Result, multimodal: MultimodalOutput, clock: StageClock
    ) -> Result:
        """Add the vehicles, which are seen by the detectors and move as the tracks do."""
        with clock.stage("vehicles"):
            located = locate(multimodal.fused, result.frame, result.ground, self.config.vehicles)
            moved = self._vehicles.update(
                located, result.frame, result.world_SE3_velo, result.tracks
            )
        return replace(
            result,
            modality_detections=multimodal.modality_detections,
            map_images=multimodal.pictures,
            vehicles=moved.vehicles,
            tracks=moved.tracks,
        )

    def _warn_once(self, message: str, *values: object) -> None:
        if not self._has_warned:
            log.warning(message, *values)
        self._has_warned = True
