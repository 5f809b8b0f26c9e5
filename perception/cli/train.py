"""`trifuse train detector|depthcn|fusion`: Lightning's command line, with short names for what is typed every day.

Words are read as those of every command, short names and those of shipped configurations replaced; `train.cli` parses
and runs the rest. Torch is imported only then.
"""

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_type_hints

from data.results.command_config import read_config
from perception.cli.parser import nested_types
from perception.cli.trainings import FULL_NAMES, TRAININGS, EverydayFlags, help_text
from perception.cli.words import read_words, usage_error
from perception.errors import UsageError, WriteError

if TYPE_CHECKING:
    from train.cli import Stage, TrainingCLI, TrainingKind

_STAGES = ("fit", "validate", "test")
_CHECKPOINT = ("resume", "ckpt_path")
_GROUP_HELP = {"--trainer.help", "--model.help", "--data.help"}
_PRINT_CONFIG = {"--print-config", "--print_config"}


def train(name: str, words: Sequence[str]) -> None:
    """Train or evaluate as the words of a command line say, and print the metrics.

    Raises:
        PerceptionError: The user has to act.
        KeyboardInterrupt: The training is stopped; the message says how to go on.
    """
    asked = [word for word in words if word not in _PRINT_CONFIG]
    if set(words) & _GROUP_HELP:
        print(help_text(name, everything=True))
        return
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
    full = [f"--{FULL_NAMES.get(key, key)}={value}" for key, value in flags]
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
