"""`trifuse train detector`: a detector of one modality (6.2.3, 7.2.2)."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from data.frames import OnBadFrame
from data.results.documents import write_json
from data.splitting import SplitBy
from perception.cli.table import Cell, format_table
from perception.cli.training.detector_plan import (
    DetectorDataConfig,
    DetectorModelConfig,
    InitialWeightsConfig,
    run_training,
)
from perception.cli.training.trainer_choice import as_path_tuple, trainer_config
from perception.detection.detectors.modalities import MapFilling
from perception.types import Modality

if TYPE_CHECKING:
    from train.detector.run import TrainedDetector


def detector(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    modality: Modality,
    network: str = "compact",
    size: str = "192x640",
    classes: str = "Car",
    filling: MapFilling = "default",
    jpeg: int | None = None,
    validation: Path | list[Path] | None = None,
    validation_fraction: float = 0.2,
    test_fraction: float = 0.0,
    split: SplitBy = "frames",
    lists: tuple[Path, Path] | None = None,
    augment: bool = True,
    preset: Literal["default", "thesis"] = "default",
    box_loss: Literal["squared", "ciou"] | None = None,
    objectness: Literal["squared", "focal"] | None = None,
    learning_rate: float | None = None,
    anchors: Literal["auto", "default"] = "auto",
    epochs: int = 40,
    batch: int | None = None,
    patience: int | None = None,
    start: Path | None = None,
    darknet_weights: Path | None = None,
    backbone_weights: str | None = None,
    resume: str | None = None,
    out: Path = Path("results") / "detector",
    accelerator: Literal["auto", "cpu", "gpu"] = "auto",
    devices: int = 1,
    nodes: int = 1,
    precision: Literal["auto", "32-true", "16-mixed", "bf16-mixed"] = "auto",
    seed: int = 0,
    workers: int = 0,
    on_bad_frame: OnBadFrame = "stop",
    cache: Path | None = None,
) -> None:
    """Train the detector of one view of the road; follow it with: tensorboard --logdir OUT.

    It leaves best.ckpt (of the best moderate AP on the validation set), last.ckpt to go on from, config.yaml
    and figures.json. Write the best one as a model file with: trifuse export OUT/best.ckpt --out dm.onnx

    Example: trifuse train detector synth/train --modality dm --validation synth/val --out results/dm

    Args:
        drives: labelled drives of any layout; of a folder of several, all are taken.
        modality: rgb, the camera's image; dm, depth map; rm, reflectance map.
        network: compact, the one that ships; yolov2; or a classifier of torchvision as trunk, such as resnet18.
        size: height and width of the input, multiples of 32; the thesis' is 416x416.
        classes: what is detected, with commas between them, as labels spell it.
        filling: how maps are made dense; sparse leaves the returns alone (Table B.2).
        jpeg: quality of the JPEG that pictures are pressed through; 75 in the thesis.
        validation: drives to judge by, one or [several]; without, a share is kept back.
        validation_fraction: of the frames or drives.
        test_fraction: of them, kept out of both; the thesis' is 0.2.
        split: keep single frames back, or whole drives.
        lists: instead of shares, two files of frame numbers, to learn from and to judge by: "[train.txt, val.txt]".
        augment: whether pictures are changed at every look.
        preset: default; or thesis, the figures of 7.2.2, for yolov2.
        box_loss: squared, as published, or ciou; else that of the preset.
        objectness: squared, as published, or focal; else that of the preset.
        learning_rate: the highest; else that of the preset.
        anchors: auto fits them to the training labels; default takes those that the network comes with, as
            with the weights of a whole Darknet detector. A training that starts from a checkpoint keeps its own.
        epochs: in all.
        batch: pictures a step; else that of the preset.
        patience: end after so many epochs without a better one.
        start: checkpoint of a training on other pictures, to go on from with these.
        darknet_weights: darknet19_448.conv.23 or weights of a whole detector, for yolov2.
        backbone_weights: file of a torchvision classifier's weights, or the word download.
        resume: a checkpoint to go on from, or the word last for that of the folder.
        out: folder of the results.
        accelerator: auto takes a GPU where there is one.
        devices: GPUs, or processes on a CPU.
        nodes: machines with as many each.
        precision: of the numbers; auto takes bf16-mixed where the device has instructions for it.
        seed: of every choice.
        workers: processes that make samples; 0 makes them where the network is trained.
        on_bad_frame: stop at a damaged frame, or leave it out and say so.
        cache: folder for the pictures; else the user's cache folder.
    """
    config = trainer_config(
        epochs=epochs,
        accelerator=accelerator,
        devices=devices,
        nodes=nodes,
        precision=precision,
        seed=seed,
        monitor="validation/moderate",
        patience=patience,
    )
    images = DetectorDataConfig(
        tuple(drives),
        as_path_tuple(validation),
        validation_fraction,
        test_fraction,
        split,
        lists,
        jpeg,
        augment,
        batch,
        workers,
        on_bad_frame,
        cache,
    )
    model = DetectorModelConfig(
        modality,
        network,
        size,
        classes,
        filling,
        preset,
        box_loss,
        objectness,
        learning_rate,
        anchors,
    )
    initial = InitialWeightsConfig(start, darknet_weights, backbone_weights)
    trained = run_training(images, model, initial, config, out, resume)
    if trained is None:
        return
    write_json(out / "figures.json", trained)
    print(f"{metrics_table(model, trained)}\n\n{trained.checkpoint}\n{out / 'figures.json'}")


def metrics_table(model: DetectorModelConfig, trained: "TrainedDetector") -> str:
    """Return average precision of the best epoch as a table."""
    frames = trained.counts["validation_frames"]
    rows: list[list[Cell]] = [
        [name, *(f"{of_difficulty[column]:.2f}" for column in ("easy", "moderate", "hard"))]
        for name, of_difficulty in trained.precision.items()
    ]
    title = (
        f"{model.network} on {model.modality}, epoch {trained.epoch}: "
        f"AP in percent on {frames} validation frames"
    )
    return format_table(title, ("class, IoU over", "easy", "moderate", "hard"), rows)
