"""The trainings by name, and the short names of flags that are typed every day; imports no torch."""

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

from perception.detection.config import FusionVariant
from perception.errors import optional_package

if TYPE_CHECKING:
    from train.cli import TrainingKind

# Full names of the flags of `EverydayFlags`, but for --resume.
FULL_NAMES = {
    "drives": "data.drives",
    "validation": "data.validation",
    "split": "data.split",
    "shards": "data.shards",
    "modality": "model.modality",
    "variant": "model.variant",
    "epochs": "trainer.max_epochs",
    "steps": "trainer.max_steps",
    "batch_size": "data.batch_size",
    "workers": "data.workers",
    "lr": "optimizer.lr",
    "out": "trainer.default_root_dir",
    "seed": "seed_everything",
}


@dataclass(frozen=True)
class EverydayFlags:
    """Everyday flags.

    Attributes:
        drives: Labelled drives of any layout; of a folder of several, all are taken.
        validation: Labelled drives for validation, with commas between them; else a part of the frames.
        split: File of `trifuse split` that says which frames train, validate and test.
        shards: Folders or URLs of `trifuse shards` that train in place of drives, with commas between them; of a detector.
        modality: Camera image, rgb; depth map, dm; reflectance map, rm; or bird's-eye view, bev; of a detector.
        variant: Features of a combination of boxes: default, features or scores; of the fusion.
        epochs: Number of epochs.
        steps: Number of steps, in place of any number of epochs that is not given beside it.
        batch_size: Samples per batch.
        workers: Processes that load samples; 0 loads them in the training process. Else 0 where a CPU trains, and one
            a core, up to 8, where a GPU does.
        lr: Largest learning rate.
        out: Folder of the results; else results/ and the name of the training.
        resume: Checkpoint to resume from or to evaluate, or the word last for that of the folder.
        seed: Seed of weights, split, order and augmentation.
    """

    drives: list[Path] | None = None
    validation: list[Path] | None = None
    split: Path | None = None
    shards: list[str] | None = None
    modality: Literal["rgb", "dm", "rm", "bev"] | None = None
    variant: FusionVariant | None = None
    epochs: int | None = None
    steps: int | None = None
    batch_size: int | None = None
    workers: int | None = None
    lr: float | None = None
    out: Path | None = None
    resume: str | None = None
    seed: int | None = None


@dataclass(frozen=True)
class Training:
    """One of the trainings, and what its help says.

    Attributes:
        kind: Module and name of its `TrainingKind`, `module:NAME`.
        reads: What it reads with a progress bar.
        summary: First sentence, without its full stop.
        best: What the checkpoint of the best epoch has.
        more: What else there is to know.
        example: Example command.
    """

    kind: str
    reads: str
    summary: str
    best: str
    more: str
    example: str

    @property
    def description(self) -> str:
        """Text above the flags."""
        return (
            f"{self.summary}; watch it with: tensorboard --logdir OUT.\n\n"
            f"It writes best.ckpt, of the {self.best} on the validation part, last.ckpt to resume from, config.yaml and "
            "metrics.json. validate and test evaluate best.ckpt, or the one of --resume, on the part of that name. "
            f"{self.more}"
        )

    def load(self) -> "TrainingKind":
        """Import the kind, which needs torch and Lightning.

        Raises:
            MissingDependencyError: they are not installed.
        """
        module, _, name = self.kind.partition(":")
        package = "torch, lightning and tensorboard"
        with optional_package(package, needed_for="training", extra="train"):
            return cast("TrainingKind", getattr(importlib.import_module(module), name))


TRAININGS: Mapping[str, Training] = {
    "detector": Training(
        "train.detector.kind:DETECTOR",
        "images",
        "Train an image detector of one modality",
        "highest moderate AP",
        "Make a model file of the best one with: trifuse export OUT/best.ckpt --out dm.onnx",
        "trifuse train detector synth/train --modality dm --validation synth/val --out results/dm",
    ),
    "bev": Training(
        "train.bev.kind:BEV",
        "scans",
        "Train the detector of the bird's-eye view, which sees a scan from above",
        "highest AP of centres within 2 m",
        "`trifuse train detector --modality bev` is the same. Make a model file with: trifuse export OUT/best.ckpt --out bev.onnx",
        "trifuse train bev synth/train --validation synth/val --out results/bev",
    ),
    "depthcn": Training(
        "train.verifier.kind:DEPTHCN",
        "proposals",
        "Train the network that verifies DepthCN's proposals",
        "highest balanced accuracy",
        "Make a model file of the best one with: trifuse export OUT/best.ckpt --out depthcn.onnx",
        "trifuse train depthcn synth/train --validation synth/val --out results/depthcn",
    ),
    "fusion": Training(
        "export.trained_fusion:FUSION",
        "detections",
        "Train the fusion of the three modalities' detections",
        "lowest error",
        "The detectors run once on every frame; their detections are cached. fusion.onnx is the model file of the best "
        "one; figures of the test part are rescoring.png (Fig. 7.12), steps.png (7.14), precision.png, reliability.png, "
        "and with --model.sweep.one 5,10,20 sizes.png (7.13).",
        "trifuse train fusion synth/fusion --config thesis --out results/fusion",
    ),
}


def training_of(name: str, words: Sequence[str]) -> str:
    """Return the training that the words of a command line call: the bird's-eye view has one of its own."""
    is_bev = " --modality bev " in f" {' '.join(words)} ".replace("=", " ")
    return "bev" if name == "detector" and is_bev else name
