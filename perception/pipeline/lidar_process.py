"""The LiDAR stages in a process of their own."""

from dataclasses import replace
from functools import partial

from perception.kernels.compiled import load_compiled
from perception.pipeline.config import PipelineConfig
from perception.pipeline.lidar_stages import LidarResult, LidarStages
from perception.pipeline.remote_object import RemoteObject
from perception.pipeline.workers import StageClock
from perception.sensor import LidarModel
from perception.types import Frame


class LidarProcess:
    """The interface of `LidarStages` to another process; one thread at a time may call it."""

    def __init__(self, sensor: LidarModel, config: PipelineConfig) -> None:
        """Start the process; it gets ready in the background.

        Args:
            sensor: LiDAR model of the scans.
            config: Pipeline configuration.

        Raises:
            PerceptionError: no process can be started.
        """
        self._stages = RemoteObject(
            "the LiDAR stages",
            partial(_make_stages, sensor, config),
            advice="pass --pipeline.no-parallel",
        )

    @property
    def process_id(self) -> int:
        """Process id."""
        return self._stages.process_id

    def step(self, frame: Frame, clock: StageClock) -> LidarResult:
        """Run the LiDAR stages on a frame, which need no image.

        Raises:
            PerceptionError: the error of `LidarStages.step`, or the process has ended.
        """
        return self._stages.call(_step, replace(frame, image=None), clock)

    def reset(self) -> None:
        """Forget the drive so far."""
        self._stages.call(LidarStages.reset)

    def close(self) -> None:
        """End the process after the running call."""
        self._stages.close()


def _make_stages(sensor: LidarModel, config: PipelineConfig) -> LidarStages:
    """Return the stages, ready for the first frame."""
    load_compiled()
    return LidarStages(sensor, config)


def _step(stages: LidarStages, frame: Frame, clock: StageClock) -> LidarResult:
    """Return the result without the scan, which repeats the points of the frame."""
    return replace(stages.step(frame, clock), scan=None)
