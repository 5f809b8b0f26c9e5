"""What all commands ask that measure a detector on labelled drives."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from data.frames import OnBadFrame
from perception.cli.evaluations.class_precision import MetricConfig
from perception.cli.evaluations.detection import BootstrapConfig
from perception.cli.evaluations.labelled_drives import ReadingConfig
from perception.evaluation.detection.precision_curve import RecallPoints

RecallOption = Literal["11", "40"]
_AVERAGED: Mapping[RecallOption, RecallPoints] = {"11": 11, "40": 40}


@dataclass(frozen=True)
class DetectionEvaluationConfig:
    """Which frames are looked at, and how detections are measured; commands hand their `**flags` on to this.

    Attributes:
        sequence: which one of a tracking folder; else each of them for itself.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        frames: of each drive only so many from the start; else all.
        iou: overlap that a detection must exceed; several as [0.7,0.5]. KITTI asks for 0.7 of cars.
        recall_points: 11, as the thesis had, or 40: over how many points precision is averaged.
        bootstrap: so many choices of frames give intervals; 0 for none.
        seed: of these choices, and of what is disturbed at random.
        on_bad_frame: stop at a damaged frame, or skip it and say so.
    """

    sequence: str | None = None
    sensor: str | None = None
    frames: int | None = None
    iou: float | tuple[float, ...] = (0.7, 0.5)
    recall_points: RecallOption = "40"
    bootstrap: int = 0
    seed: int = 0
    on_bad_frame: OnBadFrame = "stop"

    @property
    def reading(self) -> ReadingConfig:
        """How drives are read."""
        return ReadingConfig(self.sequence, self.sensor, self.frames, self.on_bad_frame)

    @property
    def measuring(self) -> MetricConfig:
        """How detections are measured."""
        iou_thresholds = (self.iou,) if isinstance(self.iou, float | int) else tuple(self.iou)
        resampling = BootstrapConfig(self.bootstrap, self.seed)
        return MetricConfig(iou_thresholds, _AVERAGED[self.recall_points], resampling)
