"""`trifuse train detector`: an image detector of one modality (6.2.3, 7.2.2)."""

from pathlib import Path
from typing import TYPE_CHECKING

from data.samples.images.config import ImageDataConfig
from perception.cli.parser import defaults_by
from perception.cli.training import TrainingFlags, import_trainer
from perception.evaluation.report import Column, Table
from perception.types import Modality
from train.config import OptimizerConfig, TrainerConfig
from train.detector.config import (
    DETECTOR_PRESETS,
    DetectionLossConfig,
    DetectorExperiment,
    DetectorModelConfig,
    InitialWeights,
    Preset,
)

if TYPE_CHECKING:
    from train.detector.run import TrainedDetector

_MODEL, _DATA, _LOSS, _WEIGHTS = (
    DetectorModelConfig(),
    ImageDataConfig(),
    DetectionLossConfig(),
    InitialWeights(),
)
_OPTIMIZER, _TRAINER = DETECTOR_PRESETS["default"].optimizer, TrainerConfig(precision="auto")


@defaults_by(
    "preset",
    {
        name: {
            "optimizer": one.optimizer,
            "loss": one.loss,
            "data.batch_size": one.batch_size,
        }
        for name, one in DETECTOR_PRESETS.items()
    },
)
def train_detector(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    modality: Modality,
    training: TrainingFlags,
    preset: Preset = "default",
    epochs: int = 40,
    out: Path = Path("results") / "detector",
    model: DetectorModelConfig = _MODEL,
    data: ImageDataConfig = _DATA,
    optimizer: OptimizerConfig = _OPTIMIZER,
    loss: DetectionLossConfig = _LOSS,
    weights: InitialWeights = _WEIGHTS,
    trainer: TrainerConfig = _TRAINER,
) -> None:
    """Train an image detector of one modality; watch it with: tensorboard --logdir OUT.

    It writes best.ckpt, of the highest moderate AP on the validation set, last.ckpt to resume from, config.yaml and
    metrics.json. Make a model file of the best one with: trifuse export OUT/best.ckpt --out dm.onnx

    Example: trifuse train detector synth/train --modality dm --validation synth/val --out results/dm

    Args:
        drives: Labelled drives of any layout; of a folder of several, all are taken.
        modality: Camera image, rgb; depth map, dm; or reflectance map, rm.
        preset: Defaults of optimizer, loss and batch size: default, or those of 7.2.2, thesis, for yolov2.
        epochs: Number of epochs.
        out: Folder of the results.
        model: Network and its input.
        data: Split, batches and augmentation.
        optimizer: Optimizer and learning rate.
        loss: Terms of the loss.
        weights: Initial weights.
        trainer: Devices and precision.
    """
    from data.results.documents import write_json
    from perception.cli.progress import frame_progress_bar

    run = import_trainer("train.detector.run")
    trained = run.run_experiment(
        DetectorExperiment(
            training.drives(drives), modality, model, data, optimizer, loss, weights
        ),
        training.run(epochs, trainer),
        out,
        training.resume,
        frame_progress_bar("images"),
    )
    if trained is None:
        return
    write_json(out / "metrics.json", trained)
    print(precision_table(f"{model.network} on {modality}", trained).text())
    print(f"\n{trained.checkpoint}\n{out / 'metrics.json'}")


def precision_table(name: str, trained: "TrainedDetector") -> Table[dict[str, float]]:
    """Return average precision of the best epoch as a table."""
    frames = trained.counts["validation_frames"]
    columns = [
        Column[dict[str, float]](level, lambda row, level=level: row[level], ".2f", level)  # type: ignore[misc]
        for level in ("easy", "moderate", "hard")
    ]
    title = f"{name}, epoch {trained.epoch}: AP [%] on {frames} validation frames"
    return Table(title, columns, trained.precision, heading="class, min IoU")
