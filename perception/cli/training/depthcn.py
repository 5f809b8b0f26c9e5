"""`trifuse train depthcn`: the network that tells vehicles among candidates (6.1.3, 6.1.4)."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from data.frames import OnBadFrame
from data.results.documents import write_json
from perception.cli.table import Cell, format_table
from perception.cli.training.trainer_choice import as_path_tuple, trainer_config
from perception.cli.training.verifier_plan import VerifierDataConfig, run_training
from perception.types import Method

if TYPE_CHECKING:
    from train.verifier.run import TrainedVerifier

_COLUMNS = ("accuracy", "balanced", "precision", "recall", "box_iou", "box_iou_70")


def depthcn(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    validation: Path | list[Path] | None = None,
    method: Method = "default",
    augment: bool = True,
    epochs: int = 40,
    batch: int = 128,
    resume: str | None = None,
    out: Path = Path("results") / "depthcn",
    accelerator: Literal["auto", "cpu", "gpu"] = "auto",
    devices: int = 1,
    precision: Literal["32-true", "16-mixed", "bf16-mixed"] = "32-true",
    seed: int = 0,
    workers: int = 0,
    on_bad_frame: OnBadFrame = "stop",
    cache: Path | None = None,
) -> None:
    """Train the network that verifies proposals; follow it with: tensorboard --logdir OUT.

    It leaves best.ckpt (of the best accuracy on the validation set, vehicles and others counting alike),
    last.ckpt to go on from, config.yaml and figures.json. Write the best one as a model file with: trifuse export OUT/best.ckpt --out depthcn.onnx

    Example: trifuse train depthcn synth/train --validation synth/val --out results/depthcn

    Args:
        drives: labelled drives of any layout; of a folder of several, all are taken.
        validation: drives to judge by, one or [several]; without, a fifth of the frames is kept back.
        method: default, the network that ships; thesis, that of Fig. 6.5 with its own schedule.
        augment: whether samples are changed at every look (6.1.4).
        epochs: in all, each as long as there are candidates.
        batch: samples a step.
        resume: a checkpoint to go on from, or the word last for that of the folder.
        out: folder of the results.
        accelerator: auto takes a GPU where there is one.
        devices: GPUs, or processes on a CPU.
        precision: of the numbers; 16-mixed or bf16-mixed on a GPU.
        seed: of every choice.
        workers: processes that make samples; 0 makes them where the network is trained.
        on_bad_frame: stop at a damaged frame, or leave it out and say so.
        cache: folder for pictures and candidates of the frames; else the user's cache folder.
    """
    data = VerifierDataConfig(
        tuple(drives), as_path_tuple(validation), batch, augment, workers, on_bad_frame, cache
    )
    config = trainer_config(
        epochs=epochs, accelerator=accelerator, devices=devices, precision=precision, seed=seed
    )
    trained = run_training(data, method, config, out, resume)
    if trained is None:
        return
    write_json(out / "figures.json", trained)
    print(f"{metrics_table(method, trained)}\n\n{trained.checkpoint}\n{out / 'figures.json'}")


def metrics_table(method: Method, trained: "TrainedVerifier") -> str:
    """Return the figures of both parts as a table."""
    counts = trained.counts
    rows: list[list[Cell]] = [
        [
            part,
            counts[f"{part}_candidates"],
            counts[f"{part}_vehicles"],
            *(f"{100 * metrics[name]:.2f}" for name in _COLUMNS),
        ]
        for part, metrics in (("training", trained.training), ("validation", trained.validation))
    ]
    title = f"DepthCN, {method}, epoch {trained.epoch}: accuracies, recall and IoU in percent"
    header = (
        "set",
        "candidates",
        "vehicles",
        "accuracy",
        "of classes",
        "precision",
        "recall",
        "box IoU",
        "IoU > 0.7",
    )
    return format_table(title, header, rows)
