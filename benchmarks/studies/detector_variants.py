"""Detectors that differ in one thing: each is trained, written as a model file, and measured on the same drives.

OUT/NAME/settings.json   what it was trained with; a folder of other settings is refused
         best.ckpt ...   as `trifuse train detector` leaves them
         trained.json    there once the training is done, which is then never repeated
         detector.onnx
         figures.json    what it comes to on the drives asked for
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from data.atomic_file import write_atomically
from data.results.documents import to_serializable, write_json
from perception.cli.detectors import measured_network
from perception.cli.evaluate_detection import DriveReport, measure_drives
from perception.cli.flags import DriveFlags
from perception.cli.progress import frame_progress_bar
from perception.cli.training import import_trainer
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.errors import UsageError
from perception.evaluation.detection.config import PrecisionConfig
from train.config import Accelerator, TrainingRun
from train.detector.config import DetectorExperiment

if TYPE_CHECKING:
    from train.detector.run import TrainedDetector


@dataclass(frozen=True)
class DetectorVariant:
    """One of the detectors that a study compares.

    Attributes:
        name: Name in tables, and of its folder.
        experiment: Settings of the training.
        epochs: Number of epochs.
    """

    name: str
    experiment: DetectorExperiment
    epochs: int


@dataclass(frozen=True)
class VariantTrainingConfig:
    """What is the same for all variants of a study.

    Attributes:
        seed: of every choice.
        accelerator: auto takes a GPU where there is one.
    """

    seed: int = 0
    accelerator: Accelerator = "auto"


@dataclass(frozen=True)
class VariantEvaluationConfig:
    """By what the variants are measured.

    Attributes:
        drives: each has its own figures.
        metric: Metric configuration.
    """

    drives: tuple[Path, ...]
    metric: PrecisionConfig

    def __post_init__(self) -> None:
        """Refuse no drive to measure on."""
        if not self.drives:
            raise UsageError("--validation", expected="at least one drive", found="none")


@dataclass(frozen=True)
class VariantMetrics:
    """What came of a variant.

    Attributes:
        epoch: the best, from 1.
        training_frames: that it learned from.
        maps_ms: in the median, to make its picture of a scan, on the first drive; 0 for the camera's image.
        network_ms: in the median, for the network on the CPU.
        drives: for each drive whether it is real, how many frames it has, and by IoU and difficulty what
            `PrecisionReport.to_json` states.
    """

    epoch: int
    training_frames: int
    maps_ms: float
    network_ms: float
    drives: Mapping[str, Any]

    def detections(self, drive: str, iou: float, difficulty: str) -> Mapping[str, Any] | None:
        """Return the figures of what was detected, or None where nothing was."""
        found: Mapping[str, Any] = self.drives[drive]["iou"][f"{iou:g}"][difficulty]
        return None if found["ap_r40_percent"] is None else found

    def ap(self, drive: str, iou: float, difficulty: str) -> float:
        """Return average precision in percent, 0 where nothing was detected, over 40 points."""
        found = self.detections(drive, iou, difficulty)
        return 0.0 if found is None else float(found["ap_r40_percent"])


def study_variants(
    variants: Sequence[DetectorVariant],
    conditions: VariantTrainingConfig,
    evaluation: VariantEvaluationConfig,
    out: Path,
) -> dict[str, VariantMetrics]:
    """Train and measure all variants, in their order; those that are done are not done again.

    Raises:
        UsageError: the folder holds variants of other settings.
        PerceptionError: a drive cannot be read or used.
    """
    metrics = {}
    for variant in variants:
        folder = out / variant.name.replace(" ", "-").replace("/", "-")
        trained = _trained(variant, conditions, folder)
        metrics[variant.name] = _evaluated(trained, evaluation, folder)
    return metrics


def _trained(
    variant: DetectorVariant, conditions: VariantTrainingConfig, folder: Path
) -> Mapping[str, Any]:
    """Train, go on, or read what is done."""
    settings = to_serializable({"variant": asdict(variant), "conditions": conditions})
    known = _read(folder / "settings.json")
    if known is not None and known != settings:
        raise UsageError(
            folder,
            expected="a training with the same settings, or none",
            found="others in settings.json",
            advice="name another --out",
        )
    write_json(folder / "settings.json", settings)
    done = _read(folder / "trained.json")
    if done is None:
        trained = _train(variant, conditions, folder)
        write_json(folder / "trained.json", trained)
        done = to_serializable(trained)
    found: Mapping[str, Any] = done
    return found


def _train(
    variant: DetectorVariant, conditions: VariantTrainingConfig, folder: Path
) -> "TrainedDetector":
    run = TrainingRun(
        epochs=variant.epochs,
        accelerator=conditions.accelerator,
        precision="auto",
        seed=conditions.seed,
    )
    resume = "last" if (folder / "last.ckpt").exists() else None
    trainer = import_trainer("train.detector.run")
    trained: TrainedDetector = trainer.run_experiment(
        variant.experiment, run, folder, resume, frame_progress_bar("images")
    )
    return trained


def _evaluated(
    trained: Mapping[str, Any], evaluation: VariantEvaluationConfig, folder: Path
) -> VariantMetrics:
    """Measure, or read what was measured on the same drives by the same rules."""
    asked = to_serializable(asdict(evaluation))
    known = _read(folder / "figures.json")
    if known is not None and known["judging"] == asked:
        return VariantMetrics(**known["figures"])
    network = ModalityDetector(_model_file(folder))
    detector = measured_network(network, network.class_names[:1], evaluation.metric)
    measured = measure_drives(detector, evaluation.drives, DriveFlags(), evaluation.metric)
    first = measured[0].report
    metrics = VariantMetrics(
        epoch=trained["epoch"],
        training_frames=trained["counts"]["training_frames"],
        maps_ms=first.median_ms("maps"),
        network_ms=first.median_ms(network.modality),
        drives=to_serializable({one.data.path: _of_drive(one) for one in measured}),
    )
    write_json(folder / "figures.json", {"judging": asked, "figures": metrics})
    return metrics


def _of_drive(measured: DriveReport) -> dict[str, Any]:
    data, (precision,) = measured.data, measured.report.precision.to_json().values()
    return {"data": data.kind, "frames": data.frames_evaluated, "iou": precision}


def _model_file(folder: Path) -> Path:
    """Return the model file of the best epoch, made where it is not there."""
    from export.detector import exportable_detector
    from export.onnx import to_onnx

    file = folder / "detector.onnx"
    if not file.exists():
        write_atomically(file, to_onnx(exportable_detector(folder / "best.ckpt")))
    return file


def _read(file: Path) -> Any:  # noqa: ANN401 - what we wrote as JSON
    return json.loads(file.read_text()) if file.exists() else None
