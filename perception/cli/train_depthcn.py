"""`trifuse train depthcn`: the network that verifies DepthCN's proposals (6.1.3, 6.1.4)."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from data.samples.crops.config import CropDataConfig
from perception.cli.parser import defaults_by
from perception.cli.training import TrainingFlags, import_trainer
from perception.evaluation.report import Column, Table
from perception.types import Method
from train.config import OptimizerConfig, TrainerConfig
from train.verifier.config import VERIFIER_CONFIGS, VerifierExperiment

if TYPE_CHECKING:
    from train.verifier.run import TrainedVerifier

_DATA, _OPTIMIZER, _TRAINER = (
    CropDataConfig(),
    VERIFIER_CONFIGS["default"].optimizer,
    TrainerConfig(),
)


@defaults_by(
    "method", {name: {"optimizer": one.optimizer} for name, one in VERIFIER_CONFIGS.items()}
)
def train_depthcn(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    training: TrainingFlags,
    method: Method = "default",
    epochs: int = 40,
    out: Path = Path("results") / "depthcn",
    data: CropDataConfig = _DATA,
    optimizer: OptimizerConfig = _OPTIMIZER,
    trainer: TrainerConfig = _TRAINER,
) -> None:
    """Train the network that verifies proposals; watch it with: tensorboard --logdir OUT.

    It writes best.ckpt, of the highest balanced accuracy on the validation set, last.ckpt to resume from, config.yaml
    and metrics.json. Make a model file of the best one with: trifuse export OUT/best.ckpt --out depthcn.onnx

    Example: trifuse train depthcn synth/train --validation synth/val --out results/depthcn

    Args:
        drives: Labelled drives of any layout; of a folder of several, all are taken.
        method: Network, its input and its optimizer: default, the one that ships; or thesis, Fig. 6.5.
        epochs: Number of epochs, each with as many samples as there are crops.
        out: Folder of the results.
        data: Split, batches, sampling and augmentation.
        optimizer: Optimizer and learning rate.
        trainer: Devices and precision.
    """
    from data.results.documents import write_json
    from perception.cli.progress import frame_progress_bar

    run = import_trainer("train.verifier.run")
    trained = run.run_experiment(
        VerifierExperiment(training.drives(drives), method, data, optimizer),
        training.run(epochs, trainer),
        out,
        training.resume,
        frame_progress_bar("proposals"),
    )
    if trained is None:
        return
    write_json(out / "metrics.json", trained)
    print(metrics_table(method, trained).text())
    print(f"\n{trained.checkpoint}\n{out / 'metrics.json'}")


@dataclass(frozen=True)
class _Part:
    crops: int
    vehicles: int
    metrics: dict[str, float]


def metrics_table(method: Method, trained: "TrainedVerifier") -> Table[_Part]:
    """Return the metrics on the training and the validation set as a table."""
    rows = {
        name: _Part(trained.counts[f"{name}_crops"], trained.counts[f"{name}_vehicles"], metrics)
        for name, metrics in (("training", trained.training), ("validation", trained.validation))
    }
    percent = {
        "accuracy": "accuracy",
        "balanced accuracy": "balanced",
        "precision": "precision",
        "recall": "recall",
        "box IoU": "box_iou",
        "IoU > 0.7": "box_iou_70",
    }
    columns = [
        Column[_Part]("crops", lambda row: row.crops),
        Column[_Part]("vehicles", lambda row: row.vehicles),
        *(
            Column[_Part](name, lambda row, key=key: 100 * row.metrics[key], ".2f")  # type: ignore[misc]
            for name, key in percent.items()
        ),
    ]
    return Table(f"DepthCN, {method}, epoch {trained.epoch}: metrics in %", columns, rows, "set")
