"""`trifuse train detector|depthcn|fusion`: Lightning's command line, with short names for what is typed every day.

Words are read as those of every command, short names and those of shipped configurations replaced; `train.cli` parses
and runs the rest. Torch is imported only then.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_type_hints

from jsonargparse import ArgumentParser

from data.results.command_config import read_config
from perception.cli.help import help_formatter
from perception.cli.parser import PRINT_CONFIG, nested_types
from perception.cli.words import read_words, usage_error
from train.trainings import FULL_NAMES, TRAININGS, EverydayFlags

if TYPE_CHECKING:
    from train.cli import Stage, TrainingCLI, TrainingKind

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
_STAGES = ("fit", "validate", "test")
_CHECKPOINT = ("resume", "ckpt_path")
_GROUP_HELP = {"--trainer.help", "--model.help", "--data.help"}


def train(name: str, words: Sequence[str]) -> None:
    """Train or evaluate as the words of a command line say, and print the metrics.

    Raises:
        PerceptionError: The user has to act.
        KeyboardInterrupt: The training is stopped; the message says how to go on.
    """
    asked = [word for word in words if word not in PRINT_CONFIG]
    if set(words) & _GROUP_HELP:
        print(help_text(name, everything=True))
        return
    stage, checkpoint, cli = parse(name, asked)
    if len(asked) < len(words):
        print(cli.command_config.text(), end="")
        return
    from perception.cli.progress import frame_progress_bar

    result = cli.run(stage, checkpoint, frame_progress_bar(TRAININGS[name].reads))
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
    from train.cli import TrainingCLI, config_file
    from train.folder import config_beside

    types = dict(_types(kind))
    stage, rest = (words[0], words[1:]) if words[:1] and words[0] in _STAGES else ("fit", words)
    given = read_words(prog, rest, types, ["drives"])
    files = [config_file(name, value) for key, value in given if key == "config"]
    flags = [(key, value) for key, value in given if key not in ("config", *_CHECKPOINT)]
    typed, checkpoint = dict(flags), next((v for key, v in given if key in _CHECKPOINT), None)
    if "steps" in typed and "epochs" not in typed:
        flags.append(("epochs", "-1"))
    if checkpoint not in (None, "last") and stage != "fit" and "out" not in typed:
        flags.append(("out", str(Path(str(checkpoint)).parent)))
    beside = config_beside(checkpoint, typed.get("out", kind.out))
    configs = [read_config(file) for file in [*beside, *files]]
    full = [f"--{FULL_NAMES.get(key, key)}={value}" for key, value in flags]
    try:
        cli = TrainingCLI(kind, [*(f"--config={json.dumps(one)}" for one in configs), *full])
    except argparse.ArgumentError as error:
        raise usage_error(prog, str(error), types, ["drives"]) from error
    return cast("Stage", stage), checkpoint, cli


def _types(kind: "TrainingKind") -> Iterator[tuple[str, Any]]:
    """Yield the type of each flag by its full name, and of each short one that the training has."""
    from train.cli import group_hints

    full: dict[str, Any] = {}
    for section, hints in group_hints(kind).items():
        full |= dict(nested_types(hints, f"{section}."))
    full |= {"seed_everything": int, "optimizer": object, "lr_scheduler": object}
    for key, hint in nested_types(get_type_hints(EverydayFlags)):
        if FULL_NAMES.get(key, "optimizer.lr") in {*full, "optimizer.lr"}:
            yield key, hint
    yield from {"ckpt_path": str, **full}.items()


def help_text(name: str, *, everything: bool = False) -> str:
    """Return the help of a training: its short flags and the groups, or every flag, which needs torch and Lightning."""
    training, prog = TRAININGS[name], f"trifuse train {name}"
    if everything:
        kind = training.load()
        from train.cli import TrainingCLI

        return TrainingCLI(kind).parser.format_help().rstrip()
    types = dict(nested_types(get_type_hints(EverydayFlags)))
    usage = f"{prog} [fit|validate|test] DRIVES ... [flags]"
    parser = ArgumentParser(
        prog=prog, usage=usage, description=training.description,
        epilog=f"{_GROUPS}\n\nExample: {training.example}",
        formatter_class=help_formatter(types, ("drives",), ""), add_help=False,
    )  # fmt: skip
    parser.add_class_arguments(EverydayFlags)
    return parser.format_help().rstrip()
