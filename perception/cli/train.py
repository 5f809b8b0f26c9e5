"""`trifuse train detector|depthcn|fusion`: Lightning's command line, with short names for what is typed every day.

Words are read as those of every command, short names and those of shipped configurations replaced; `train.cli` parses
and runs the rest. Torch is imported only then.
"""

import argparse
import importlib
import inspect
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_type_hints

from jsonargparse import ArgumentParser

from data.results.command_config import read_config
from perception.cli.help import help_formatter
from perception.cli.parser import nested_types
from perception.cli.words import read_words, usage_error
from perception.detection.config import FusionVariant
from perception.errors import MissingDependencyError, UsageError, WriteError
from perception.types import Modality

if TYPE_CHECKING:
    from train.cli import Stage, TrainingCLI, TrainingKind

_STAGES = ("fit", "validate", "test")
_CHECKPOINT = ("resume", "ckpt_path")
_PRINT_CONFIG = {"--print-config", "--print_config"}
# Full names of the flags of `EverydayFlags`, but for --resume.
_FULL_NAMES = {
    "drives": "data.drives",
    "validation": "data.validation",
    "split": "data.split",
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
_GROUPS = """\
Groups of Lightning's command line, of which --help-all lists every flag:
  --trainer.*             Lightning's Trainer: accelerator, devices, strategy, precision, gradient_clip_val, ...
  --model.*               Network, its input and its loss.
  --data.*                Drives, batches, augmentation and cache.
  --optimizer CLASS       Optimizer of torch; with its parameters: --optimizer SGD --optimizer.lr 0.001
  --lr_scheduler CLASS    WarmupCosine, StepDecay, DarknetSteps or a schedule of torch, with its parameters.
  --early_stopping.*      Patience: epochs without a better one after which training stops.
  --ema.*                 Decay of an exponential moving average of the weights.
  --config FILE           YAML file with such groups, or the word default or thesis; several are read in turn.
  --print-config          Print the effective configuration as YAML and exit."""


@dataclass(frozen=True)
class EverydayFlags:
    """Everyday flags.

    Attributes:
        drives: Labelled drives of any layout; of a folder of several, all are taken.
        validation: Labelled drives for validation, with commas between them; else a part of the frames.
        split: File of `trifuse split` that says which frames train, validate and test.
        modality: Camera image, rgb; depth map, dm; or reflectance map, rm; of a detector.
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
    modality: Modality | None = None
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
    """One of the trainings.

    Attributes:
        kind: Module and name of its `TrainingKind`, `module:NAME`.
        reads: What it reads with a progress bar.
        text: Summary and example for the help.
    """

    kind: str
    reads: str
    text: str

    def load(self) -> "TrainingKind":
        """Import the kind, which needs torch and Lightning.

        Raises:
            MissingDependencyError: they are not installed.
        """
        module, _, name = self.kind.partition(":")
        try:
            return cast("TrainingKind", getattr(importlib.import_module(module), name))
        except ImportError as error:
            package = "torch, lightning and tensorboard"
            raise MissingDependencyError(
                package, needed_for="training", extra="train", reason=error
            ) from error


TRAININGS: Mapping[str, Training] = {
    "detector": Training(
        "train.detector.kind:DETECTOR",
        "images",
        """Train an image detector of one modality; watch it with: tensorboard --logdir OUT.

It writes best.ckpt, of the highest moderate AP on the validation part, last.ckpt to resume from, config.yaml and
metrics.json. validate and test evaluate best.ckpt, or the one of --resume, on the part of that name. Make a model file of
the best one with: trifuse export OUT/best.ckpt --out dm.onnx

Example: trifuse train detector synth/train --modality dm --validation synth/val --out results/dm""",
    ),
    "depthcn": Training(
        "train.verifier.kind:DEPTHCN",
        "proposals",
        """Train the network that verifies DepthCN's proposals; watch it with: tensorboard --logdir OUT.

It writes best.ckpt, of the highest balanced accuracy on the validation part, last.ckpt to resume from, config.yaml and
metrics.json. validate and test evaluate best.ckpt, or the one of --resume, on the part of that name. Make a model file of
the best one with: trifuse export OUT/best.ckpt --out depthcn.onnx

Example: trifuse train depthcn synth/train --validation synth/val --out results/depthcn""",
    ),
    "fusion": Training(
        "export.trained_fusion:FUSION",
        "detections",
        """Train the fusion of the three modalities' detections; watch it with: tensorboard --logdir OUT.

The detectors run once on every frame; their detections are cached. It writes fusion.onnx and best.ckpt, of the lowest
error on the validation part, last.ckpt to resume from, config.yaml, metrics.json, and figures of the test part:
rescoring.png (Fig. 7.12), steps.png (7.14), precision.png, reliability.png, and with --model.sweep.one 5,10,20 sizes.png
(7.13). validate and test evaluate best.ckpt, or the one of --resume, on the part of that name.

Example: trifuse train fusion synth/fusion --config thesis --out results/fusion""",
    ),
}


def help_text(name: str, *, everything: bool = False) -> str:
    """Return the help of a training; all groups need torch and Lightning."""
    if everything:
        kind = TRAININGS[name].load()
        from train.cli import TrainingCLI

        return TrainingCLI(kind).parser.format_help().rstrip()
    text, _, example = TRAININGS[name].text.partition("\n\nExample: ")
    summary = "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))
    types = dict(nested_types(get_type_hints(EverydayFlags)))
    parser = ArgumentParser(
        prog=f"trifuse train {name}",
        usage=f"trifuse train {name} [fit|validate|test] DRIVES ... [flags]",
        description=summary,
        epilog=f"{_GROUPS}\n\nExample: {example}",
        formatter_class=help_formatter(types, ("drives",), ""),
        add_help=False,
    )
    parser.add_class_arguments(EverydayFlags)
    return parser.format_help().rstrip()


def train(name: str, words: Sequence[str]) -> None:
    """Train or evaluate as the words of a command line say, and print the metrics.

    Raises:
        PerceptionError: The user has to act.
        KeyboardInterrupt: The training is stopped; the message says how to go on.
    """
    asked = [word for word in words if word not in _PRINT_CONFIG]
    stage, checkpoint, cli = parse(name, asked)
    if len(asked) < len(words):
        print(cli.command_config.text(), end="")
        return
    result = run(name, cli, stage, checkpoint)
    if result is not None:
        from train.cli import METRICS

        metrics = cli.folder.out / METRICS[stage]
        print(f"{result.table.text()}\n\n{result.checkpoint}\n{metrics}")


def parse(name: str, words: Sequence[str]) -> "tuple[Stage, str | None, TrainingCLI]":
    """Return the subcommand, the checkpoint and the command line that the words call.

    Raises:
        UsageError: A flag is unknown, or its value is not of its type.
    """
    kind, prog = TRAININGS[name].load(), f"trifuse train {name}"
    from train.cli import TrainingCLI

    types = dict(_types(kind))
    stage, rest = (words[0], words[1:]) if words[:1] and words[0] in _STAGES else ("fit", words)
    given = read_words(prog, rest, types, ["drives"])
    files = [_config_file(name, value) for key, value in given if key == "config"]
    flags = [(key, value) for key, value in given if key not in ("config", *_CHECKPOINT)]
    typed, checkpoint = dict(flags), next((v for key, v in given if key in _CHECKPOINT), None)
    if "steps" in typed and "epochs" not in typed:
        flags.append(("epochs", "-1"))
    if checkpoint not in (None, "last") and stage != "fit" and "out" not in typed:
        flags.append(("out", str(Path(str(checkpoint)).parent)))
    configs = [read_config(file) for file in [*_config_beside(checkpoint, typed), *files]]
    full = [f"--{_FULL_NAMES.get(key, key)}={value}" for key, value in flags]
    try:
        cli = TrainingCLI(kind, [*(f"--config={json.dumps(one)}" for one in configs), *full])
    except argparse.ArgumentError as error:
        raise usage_error(prog, str(error), types, ["drives"]) from error
    return cast("Stage", stage), checkpoint, cli


def run(
    name: str, cli: "TrainingCLI", stage: "Stage" = "fit", checkpoint: str | None = None
) -> Any:  # noqa: ANN401 - of the kind
    """Run a training; an interrupt or a full disk says how to go on.

    Raises:
        PerceptionError: The user has to act.
        KeyboardInterrupt: The training is stopped.
    """
    from perception.cli.progress import frame_progress_bar

    try:
        return cli.run(stage, checkpoint, frame_progress_bar(TRAININGS[name].reads))
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(_how_to_go_on(cli)) from error
    except WriteError as error:
        advice = f"make room, then {_how_to_go_on(cli)}"
        raise WriteError(
            error.where, expected=error.expected, found=error.found, advice=advice
        ) from error


def fit(name: str, arguments: Mapping[str, object], out: Path) -> Any:  # noqa: ANN401 - of the kind
    """Train by arguments, such as those of a study; resume where `out` holds the same training.

    Args:
        name: Name of the training, such as detector.
        arguments: Values by full name, such as `trainer.max_epochs`; `config` names a configuration.
        out: Folder of the training.

    Raises:
        PerceptionError: Settings, drives or a checkpoint cannot be used, or the folder is of other settings.
    """
    from train.cli import as_words

    _, _, cli = parse(name, as_words({**arguments, "trainer.default_root_dir": out}))
    if not cli.folder.last.exists():
        return run(name, cli)
    if read_config(out / "config.yaml") != cli.command_config.values:
        raise UsageError(
            out,
            expected="a training with the same settings, or none",
            found="others in config.yaml",
            advice="choose another --out",
        )
    return run(name, cli, "fit", "last")


def _types(kind: "TrainingKind") -> Iterator[tuple[str, Any]]:
    """Yield the type of each flag by its full name, and of each short one."""
    from lightning.pytorch import Trainer

    from train.best_epoch import BestEpoch
    from train.trainer import exponential_moving_average

    made = {"model.seed", "data.seed", "model.optimizer", "model.lr_scheduler"}
    made |= {f"data.{name}" for name in kind.links.values()}
    full: dict[str, Any] = {"seed_everything": int, "optimizer": Any, "lr_scheduler": Any}
    for section, function in (
        ("model", kind.module.__init__),
        ("data", kind.data.__init__),
        ("early_stopping", BestEpoch.__init__),
        ("ema", exponential_moving_average),
        ("trainer", inspect.unwrap(Trainer.__init__)),
    ):
        hints = {key: hint for key, hint in get_type_hints(function).items() if key != "return"}
        if section == "data":  # the fields of its configuration stand for **config
            hints.pop("config", None)
            hints |= get_type_hints(get_type_hints(kind.data).get("config", object))
        full |= {key: hint for key, hint in nested_types(hints, f"{section}.") if key not in made}
    short = dict(nested_types(get_type_hints(EverydayFlags)))
    is_known = {key: _FULL_NAMES.get(key, "") in full for key in short}
    yield from ((key, hint) for key, hint in short.items() if is_known[key])
    yield from {"lr": float, "resume": str, "ckpt_path": str}.items()
    yield from full.items()


def _config_file(name: str, given: str) -> Path:
    """Return the file of a configuration that is shipped or named by its path."""
    from train.cli import config_file

    return config_file(name, given) or Path(given)


def _config_beside(checkpoint: str | None, flags: Mapping[str, str]) -> list[Path]:
    """Return the configuration that a training has left beside the checkpoint."""
    if checkpoint is None:
        return []
    out = Path(flags["out"]) if checkpoint == "last" and "out" in flags else None
    file = (out or Path(checkpoint).parent) / "config.yaml"
    return [file] if file.exists() else []


def _how_to_go_on(cli: "TrainingCLI") -> str:
    if not cli.folder.last.exists():
        return "start again with the same command, as no epoch is complete"
    out = cli.folder.out
    flags = f"--config {out / 'config.yaml'} --out {out} --resume last"
    return f"go on with: trifuse train {cli.kind.name} {flags}"
