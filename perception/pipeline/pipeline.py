"""One frame through every stage, in real time and in bounded memory.

    LiDAR worker   | scan health - registration - ground - voxels - static and moving - moving objects -.
                   |     |                         |                                                  |
    camera worker  | image health - maps -.- DepthCN --------.- fusion - vehicle location - calibration - vehicles - Result
    its threads    |    `- bird's-eye view `- three detectors -'

Each worker is a thread, which takes one frame after another; a stage waits for the stages whose results it needs.
Compiled functions, NumPy, OpenCV and the networks release Python's lock, so that both threads run at once.
"""

import time
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Self

from perception.geometry.threads import find_blas, limit_opencv_threads, usable_cores
from perception.kernels.compiled import load_compiled
from perception.pipeline.camera_stages import CameraStages
from perception.pipeline.config import PipelineConfig
from perception.pipeline.lidar_stages import LidarFutures, LidarResult, LidarStages, PosedGround
from perception.pipeline.memory import exempt_from_collection, limit_heaps, release_compiler
from perception.pipeline.stream import FramePolicy, ResultStream
from perception.pipeline.workers import InlineWorker, StageClock, ThreadWorker, Worker
from perception.sensor import HDL_64E, LidarModel
from perception.types import Frame, Health, PipelineSnapshot, Result


class Pipeline:
    """Runs every stage on the frames of a drive: `step` for one frame, `stream` for files and for live use.

    A context manager, which ends its workers.
    """

    def __init__(self, sensor: LidarModel = HDL_64E, config: PipelineConfig | None = None) -> None:
        """Open the networks and start the workers; all are ready for the first frame then.

        Args:
            sensor: LiDAR model of the scans.
            config: Pipeline configuration.

        Raises:
            ModelError: a network is missing, or is of another kind than it is given for.
        """
        self.sensor = sensor
        self.config = config = config or PipelineConfig()
        limit_heaps()
        self._lidar = LidarStages(sensor, config)
        with ThreadPoolExecutor(1) as loader:
            loading = loader.submit(load_compiled)
            self._camera = CameraStages(sensor, config)
            loading.result()
        find_blas()
        if config.parallel:
            limit_opencv_threads()
        kind = ThreadWorker if config.parallel else InlineWorker
        self._lidar_worker: Worker = kind("obstacles")
        self._camera_worker: Worker = kind("vehicles")
        exempt_from_collection()
        release_compiler()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the workers; no frame can be given any more."""
        self._lidar_worker.close()
        self._camera_worker.close()

    def reset(self) -> None:
        """Forget the drive so far, as between frames that do not follow each other."""
        self._submit_reset().result()

    def restore(self, snapshot: PipelineSnapshot) -> None:
        """Go on from the state of another pipeline of the same configuration.

        Args:
            snapshot: State that a result of `stream` holds.

        Raises:
            DriveError: It is damaged, or of another configuration.
        """
        self._camera_worker.submit(self._camera.restore, snapshot.camera).result()
        self._lidar_worker.submit(self._lidar.restore, snapshot.lidar).result()

    def step(self, frame: Frame) -> Result:
        """Return the ground, static and moving obstacles, tracks and vehicles of a frame.

        Raises:
            PerceptionError: the LiDAR is mounted otherwise than its model says, or the INS jumps.
        """
        return self._submit(frame, time.perf_counter()).result()

    def stream(
        self,
        frames: Iterable[Frame],
        policy: FramePolicy = "every",
        *,
        is_sequence: bool = True,
        snapshot_frames: int = 0,
    ) -> ResultStream:
        """Return an iterator over the results of frames, in order; later frames are processed meanwhile.

        The results are those of `step`. Use it in a `with`, or take all of it.

        Args:
            frames: Frames from files, or as they come.
            policy: `every` frame, for which the source waits; or the `latest`, for a source that does not wait:
                frames that come while the workers are busy are dropped and counted.
            is_sequence: Whether the frames follow each other; else nothing is remembered from one to the next.
            snapshot_frames: Number of frames, by their indices, after which a result holds a snapshot; 0 for none.

        Example:
            with Pipeline() as pipeline, pipeline.stream(lidar, "latest") as results:
                for result in results:
                    drive_by(result)
        """

        def submit(frame: Frame, arrival_s: float) -> "Future[Result]":
            if not is_sequence:
                self._submit_reset()
            has_snapshot = snapshot_frames > 0 and (frame.index + 1) % snapshot_frames == 0
            return self._submit(frame, arrival_s, has_snapshot=has_snapshot)

        return ResultStream(frames, submit, policy, frames_in_flight())

    def _submit(
        self, frame: Frame, arrival_s: float, *, has_snapshot: bool = False
    ) -> "Future[Result]":
        """Give the stages of a frame to the two workers."""
        clock = StageClock(self._lidar_worker.name, arrival_s)
        health = self._lidar_worker.submit(self._lidar.check, frame, clock)
        ground: Future[PosedGround | None] = Future()
        result = self._lidar_worker.submit(
            self._run_lidar_stages, frame, health, ground, clock, has_snapshot
        )
        result.add_done_callback(partial(_give_up, ground))
        lidar = LidarFutures(health, ground, result)
        return self._camera_worker.submit(self._run_camera_stages, frame, arrival_s, lidar)

    def _run_lidar_stages(
        self,
        frame: Frame,
        health: "Future[Health]",
        ground: "Future[PosedGround | None]",
        clock: StageClock,
        has_snapshot: bool,
    ) -> LidarResult:
        """Run registration, ground, voxels, static and moving, and moving objects."""
        result = self._lidar.step(frame, health.result(), clock, on_ground=ground.set_result)
        return replace(result, snapshot=self._lidar.snapshot()) if has_snapshot else result

    def _run_camera_stages(self, frame: Frame, arrival_s: float, lidar: LidarFutures) -> Result:
        """Run maps, detectors, fusion and DepthCN; then, as the LiDAR stages' results come, location and vehicles."""
        clock = StageClock(self._camera_worker.name, arrival_s)
        result = self._camera.step(frame, lidar, clock)
        snapshot = lidar.result.result().snapshot
        if snapshot is None:
            return result
        return replace(result, snapshot=PipelineSnapshot(snapshot, self._camera.snapshot()))

    def _submit_reset(self) -> "Future[None]":
        self._camera_worker.submit(self._camera.reset)
        return self._lidar_worker.submit(self._lidar.reset)


def _give_up(ground: "Future[PosedGround | None]", result: "Future[LidarResult]") -> None:
    """Let nothing wait for the ground of a scan that ended without one."""
    del result
    if not ground.done():
        ground.set_result(None)


def frames_in_flight() -> int:
    """Return how many frames are worked on at a time: a frame for each two cores, at most one for each worker.

    Measured on two cores: with two frames, as many a second, each in 1.4 times the time of one.
    """
    return 2 if usable_cores() > 3 else 1
