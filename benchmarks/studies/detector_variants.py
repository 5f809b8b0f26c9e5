"""Detectors that differ in one setting: each is trained, written as a model file, and measured on the same drives.

OUT/NAME/config.yaml ...  files of `trifuse train detector`; a folder of another configuration is an error
         metrics.json     written when the training is done, which is then not repeated
         detector.onnx
         measured.json    metrics on the drives
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from data.results.documents import to_serializable, write_json
from perception.atomic_file import write_atomically
from perception.cli.flags import require_positive
from perception.cli.parser import FlagGroup
from perception.cli.progress import frame_progress_bar, progress_bar
from perception.detection.config import DetectionConfig
from perception.errors import UsageError
from perception.evaluation.detection.config import PrecisionConfig
from perception.types import Modality
from train.trainings import TRAININGS

if TYPE_CHECKING:
    from data.detections.measured_drives import DriveInfo
    from perception.evaluation.detection.detector_measure import DetectorReport

IOU = (0.7, 0.5)


@dataclass(frozen=True)
class DetectorVariant:
    """One of the detectors that a study compares.

    Attributes:
        arguments: Flags of `trifuse train detector` by full name, and their values.
        config: Configuration that they change: default or thesis.
    """

    arguments: Mapping[str, object]
    config: str = "default"

    def but(self, **changes: object) -> "DetectorVariant":
        """Return the variant with other values; a flag's dot is written as two underscores."""
        named = {name.replace("__", "."): value for name, value in changes.items()}
        return replace(self, arguments={**self.arguments, **named})


@dataclass(frozen=True)
class VariantFlags(FlagGroup):
    """Training and evaluation of all variants.

    Attributes:
        validation: Drives on which the best epoch is chosen and all variants are measured, with commas between them.
        network: Network: compact; yolov2, as in the thesis; or a torchvision classifier as backbone.
        epochs: Number of epochs of each training; with all frames, where the variants differ in these.
        batch: Images per batch; else that of the configuration.
        bootstrap: Number of bootstrap samples of the frames for confidence intervals; 0 for none.
        seed: Seed of trainings and bootstrap.
        workers: Number of processes that load samples.
        accelerator: Device: auto takes a GPU where there is one.
        cache: Folder for cached images; else the user's cache folder.
    """

    validation: list[Path]
    network: str = "compact"
    epochs: int = 20
    batch: int | None = None
    bootstrap: int = 0
    seed: int = 0
    workers: int = 0
    accelerator: Literal["auto", "cpu", "gpu"] = "auto"
    cache: Path | None = None

    def __post_init__(self) -> None:
        """Validate the number of epochs and of drives."""
        require_positive("--epochs", self.epochs)
        if not self.validation:
            raise UsageError("--validation", expected="at least one drive", found="none")

    def variant(
        self, drives: Sequence[Path], modality: Modality, size: str, config: str = "default"
    ) -> DetectorVariant:
        """Return the variant from which the others differ.

        Args:
            drives: Training drives.
            modality: Modality of the detector.
            size: Height and width of the input, such as 192x640.
            config: Configuration of the training: default or thesis.
        """
        batch = {} if self.batch is None else {"data.batch_size": self.batch}
        return DetectorVariant(
            {
                "data.drives": list(drives),
                "data.validation": list(self.validation),
                "data.workers": self.workers,
                "data.cache": self.cache,
                **batch,
                "model.modality": modality,
                "model.network": self.network,
                "model.size": size,
                "trainer.max_epochs": self.epochs,
                "trainer.accelerator": self.accelerator,
                "seed_everything": self.seed,
            },
            config,
        )


@dataclass(frozen=True)
class VariantMetrics:
    """Metrics of a variant.

    Attributes:
        epoch: Number of the best epoch, from 1.
        training_frames: Number of training frames.
        maps_ms: Median time to make its map of a scan in milliseconds, on the first drive; 0 for the camera image.
        network_ms: Median time of the network on the CPU in milliseconds.
        drives: For each drive the kind of its data, its number of frames, and by IoU and difficulty the values of
            `PrecisionReport.to_json`.
    """

    epoch: int
    training_frames: int
    maps_ms: float
    network_ms: float
    drives: Mapping[str, Any]

    def detections(self, drive: str, iou: float, difficulty: str) -> Mapping[str, Any] | None:
        """Return the values of one drive, IoU and difficulty, or None without detections."""
        found: Mapping[str, Any] = self.drives[drive]["iou"][f"{iou:g}"][difficulty]
        return None if found["ap_r40_percent"] is None else found

    def ap(self, drive: str, iou: float, difficulty: str) -> float:
        """Return average precision over 40 recall points in percent, 0 without detections."""
        found = self.detections(drive, iou, difficulty)
        return 0.0 if found is None else float(found["ap_r40_percent"])


def study_variants(
    variants: Mapping[str, DetectorVariant],
    flags: VariantFlags,
    out: Path,
    others: Sequence[Path] = (),
) -> dict[str, VariantMetrics]:
    """Train and measure all variants; a training or measurement that is done is not repeated.

    Args:
        variants: Variants by name.
        flags: Settings of all trainings and of the evaluation.
        out: Folder with a folder for each variant.
        others: Drives to measure on beside the validation drives.

    Raises:
        UsageError: A folder holds a variant of other settings.
        PerceptionError: A drive cannot be read or used.
    """
    drives = (*flags.validation, *others)
    folders = {name: out / name.replace(" ", "-").replace("/", "-") for name in variants}
    return {
        name: _measured(
            trained("detector", variants[name].arguments, folder, variants[name].config),
            flags,
            drives,
            folder,
        )
        for name, folder in folders.items()
    }


def trained(
    kind: str, arguments: Mapping[str, object], folder: Path, config: str
) -> Mapping[str, Any]:
    """Train, resume, or read what is done; return the metrics.

    Args:
        kind: Kind of training: detector or depthcn.
        arguments: Flags by full name, and their values.
        folder: Folder of the training.
        config: Configuration that they change: default or thesis.
    """
    metrics = folder / "metrics.json"
    if not metrics.exists():
        training = TRAININGS[kind].load()
        from train.cli import fit

        fit(training, arguments, folder, frame_progress_bar(kind), config)
    done: Mapping[str, Any] = _read(metrics)
    return done


def _measured(
    trained: Mapping[str, Any], flags: VariantFlags, drives: Sequence[Path], folder: Path
) -> VariantMetrics:
    """Measure, or read what was measured on the same drives."""
    from data.detections.measured_detectors import DetectorOptions, measured_network
    from data.detections.measured_drives import DriveReader, measure_drives
    from perception.detection.detectors.modality_detector import ModalityDetector

    precision = PrecisionConfig(IOU, bootstrap=flags.bootstrap, seed=flags.seed)
    protocol = to_serializable({"drives": list(drives), "precision": asdict(precision)})
    known = _read(folder / "measured.json")
    if known is not None and known["protocol"] == protocol:
        return VariantMetrics(**known["metrics"])
    network = ModalityDetector(_model_file(folder))
    options = DetectorOptions(DetectionConfig(), network.class_names[:1], precision)
    detector, reader = measured_network(network, options), DriveReader(progress=progress_bar)
    measured = measure_drives(detector, drives, reader).drives
    _, first = measured[0]
    metrics = VariantMetrics(
        epoch=trained["epoch"],
        training_frames=trained["counts"]["training_frames"],
        maps_ms=first.median_ms("maps"),
        network_ms=first.median_ms(network.modality),
        drives=to_serializable({info.name: _of_drive(info, one) for info, one in measured}),
    )
    write_json(folder / "measured.json", {"protocol": protocol, "metrics": metrics})
    return metrics


def _of_drive(info: "DriveInfo", report: "DetectorReport") -> dict[str, Any]:
    (precision,) = report.to_json()["classes"].values()
    return {"data": info.kind, "frames": info.frames_evaluated, "iou": precision}


def _model_file(folder: Path) -> Path:
    """Return the model file of the best epoch, exported where it is missing."""
    from export.detector import exportable_detector
    from export.onnx import to_onnx

    file = folder / "detector.onnx"
    if not file.exists():
        write_atomically(file, to_onnx(exportable_detector(folder / "best.ckpt")))
    return file


def _read(file: Path) -> Any:  # noqa: ANN401 - JSON that was written here
    return json.loads(file.read_text()) if file.exists() else None
