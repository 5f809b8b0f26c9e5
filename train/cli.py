"""Every training through Lightning's own command line, with what all trainings of this package share.

`TrainingCLI` is `LightningCLI`: groups `--trainer.*`, `--model.*`, `--data.*`, `--optimizer.*` and `--lr_scheduler.*`, YAML files
and `--seed_everything`, and two groups more, `--early_stopping.*` and `--ema.*`. A `TrainingKind` says which module and data
module it drives. A training writes into its `default_root_dir`:

best.ckpt                checkpoint of the best epoch
last.ckpt                checkpoint of the last whole epoch, to resume from
config.yaml              configuration, for --config
metrics.json             metrics of the best epoch; those of the subcommand test in metrics_test.json
events.out.tfevents...   TensorBoard events
report.html              curves, metrics and configuration; only with the extra report
"""

import inspect
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_type_hints

from jsonargparse.typing import class_from_function
from lightning.fabric.utilities.exceptions import MisconfigurationException
from lightning.pytorch import LightningDataModule, LightningModule, Trainer
from lightning.pytorch.callbacks import LambdaCallback, LearningRateMonitor
from lightning.pytorch.cli import (
    LightningArgumentParser,
    LightningCLI,
    LRSchedulerCallable,
    OptimizerCallable,
)

from data.report.page import can_write_report
from data.report.report_file import write_report
from data.results.command_config import CommandConfig, read_config
from data.results.documents import to_serializable, write_json
from perception.errors import UsageError, WriteError
from perception.types import Progress
from perception.yaml_text import read_yaml
from train.best_epoch import BestEpoch
from train.checkpoint_writer import AtomicCheckpointIO, require_same_training
from train.events import TrainingStatistics, event_logger, writing_events
from train.folder import CONFIG, TrainingFolder
from train.progress import TrainingBar
from train.trainer import (
    SeedEachStep,
    exponential_moving_average,
    fastest_precision,
    interruptible,
    require_devices,
    silence_lightning,
)

# Made once: jsonargparse searches all loaded modules for it.
_EMA = class_from_function(exponential_moving_average)

Stage = Literal["fit", "validate", "test"]
Report = Callable[[Any, Any, Stage, Path], Any]
METRICS: Mapping[Stage, str] = {
    "fit": "metrics.json",
    "validate": "metrics_validate.json",
    "test": "metrics_test.json",
}
_TRAINER_DEFAULTS: Mapping[str, object] = {
    "max_epochs": 40,
    "deterministic": "warn",
    "num_sanity_val_steps": 0,
    "log_every_n_steps": 10,
    "enable_model_summary": False,
    # Data modules distribute their samples themselves.
    "use_distributed_sampler": False,
}


@dataclass(frozen=True)
class TrainingKind:
    """What one kind of training adds to what all share.

    Attributes:
        name: Word of the command line, such as detector.
        module: Module whose constructor parameters are the flags `--model.*`; it has a `ranking` of its epochs.
        data: Data module whose constructor parameters are the flags `--data.*`.
        report: Function from module, data module, subcommand and checkpoint to a result with a `table`; it is
            called in the first process after the subcommand.
        defaults: Defaults of other groups that differ from those of all trainings, by full name.
        links: Parameters of the data module by the attribute of the module that they are.
        before_fit: Function called with the command line before a training is made; it may change `config`.
    """

    name: str
    module: type[LightningModule]
    data: type[LightningDataModule]
    report: Report
    defaults: Mapping[str, object] = field(default_factory=dict)
    links: Mapping[str, str] = field(default_factory=dict)
    before_fit: Callable[["TrainingCLI"], None] | None = None

    @property
    def out(self) -> Path:
        """Folder of the results where none is given."""
        return Path("results") / self.name


class TrainingCLI(LightningCLI):
    """Lightning's command line for one kind of training: parse at construction, then `run`."""

    def __init__(self, kind: TrainingKind, words: Iterable[str] = ()) -> None:
        """Parse the words of a command line.

        Args:
            kind: Kind of training.
            words: Flags by their full names, such as `--trainer.max_epochs=3`.

        Raises:
            ArgumentError: A flag is unknown, or its value is not of its type.
        """
        silence_lightning()
        self.kind, self.words = kind, tuple(words)
        super().__init__(
            kind.module,
            kind.data,
            save_config_callback=None,
            trainer_defaults={**_TRAINER_DEFAULTS, "default_root_dir": str(kind.out)},
            seed_everything_default=0,
            parser_kwargs={"exit_on_error": False, "prog": f"trifuse train {kind.name}"},
            args=list(self.words),
            run=False,
            auto_configure_optimizers=False,
            load_from_checkpoint_support=False,
        )

    def add_arguments_to_parser(self, parser: LightningArgumentParser) -> None:
        """Add the groups that Lightning leaves to its users, and link what is said once."""
        parser.add_lightning_class_args(BestEpoch, "early_stopping")
        parser.add_lightning_class_args(_EMA, "ema")
        for name, kind in (
            ("optimizer", OptimizerCallable),
            ("lr_scheduler", LRSchedulerCallable | None),
        ):
            parser.add_argument(
                f"--{name}",
                type=kind,
                default=parser.get_default(f"model.{name}"),
                help=_HELP[name],
            )
            parser.link_arguments(name, f"model.{name}")
        for section in ("model", "data"):
            parser.link_arguments("seed_everything", f"{section}.seed")
        for attribute, parameter in self.kind.links.items():
            parser.link_arguments(f"model.{attribute}", f"data.{parameter}", apply_on="instantiate")
        parser.set_defaults(dict(self.kind.defaults))

    def instantiate_classes(self) -> None:
        """Wait for `run`: until then nothing is made, and nothing needs the files that are named."""

    @property
    def command_config(self) -> CommandConfig:
        """Effective configuration but for the folder of the results, as `--config` reads it."""
        text = self.parser.dump(self.config, skip_unset=False)
        values = read_yaml(text)
        del values["trainer"]["default_root_dir"]
        return CommandConfig(f"train {self.kind.name}", values)

    @property
    def folder(self) -> TrainingFolder:
        """Folder of the training."""
        return TrainingFolder(Path(self.config["trainer"]["default_root_dir"]))

    def run(
        self,
        stage: Stage = "fit",
        checkpoint: str | Path | None = None,
        progress: Progress = iter,
    ) -> Any:  # noqa: ANN401 - of the kind's own report
        """Train, resume, or evaluate a checkpoint; return the kind's result.

        All processes but the first return None, and so does a `fast_dev_run`.

        Args:
            stage: Subcommand: fit, validate or test.
            checkpoint: Checkpoint to resume from, or to evaluate; last is that of the folder. Without one a
                training is new, and an evaluation takes the best one of the folder.
            progress: Wrapper of the loop over frames that may show its progress.

        Raises:
            PerceptionError: settings, devices, drives or a checkpoint cannot be used.
            KeyboardInterrupt: the training is stopped; what was written is kept, and the message says how to go on.
        """
        self._require_duration()
        path = self.folder.checkpoint(stage, checkpoint)
        self._stage: Stage = stage
        if stage == "fit" and self.kind.before_fit is not None:
            self.kind.before_fit(self)
        super().instantiate_classes()
        self.model.save_hyperparameters({**self.model.hparams, **self._hyperparameters()})
        self.datamodule.progress = progress
        if path is not None:
            require_same_training(path, self.model, is_resumed=stage == "fit")
        with (
            self._resumable(),
            _settings_checked(),
            interruptible(),
            writing_events(self.folder.out),
        ):
            self._run_stage(stage, path)
        if not self.trainer.is_global_zero or self.trainer.fast_dev_run:  # type: ignore[attr-defined]
            return None
        evaluated = self.folder.best if stage == "fit" or path is None else path
        result = self.kind.report(self.model, self.datamodule, stage, evaluated)
        write_json(self.folder.out / METRICS[stage], result)
        if can_write_report():
            write_report(self.folder.out)
        return result

    def instantiate_trainer(self, **settings: Any) -> Trainer:  # noqa: ANN401 - of Lightning's Trainer
        """Return the trainer, with our callbacks and logger before those that are asked for.

        Raises:
            UsageError: a setting does not fit another, or the devices are not there.
        """
        given = self.config_init["trainer"]
        require_devices(given["accelerator"], given["devices"])
        if given["precision"] is None:
            settings["precision"] = fastest_precision(given["accelerator"])
        loggers = self._loggers(given["logger"])
        callbacks = [
            SeedEachStep(self.config["seed_everything"]),
            LambdaCallback(on_train_start=self._on_train_start),
            TrainingStatistics(),
            *([LearningRateMonitor("epoch")] if loggers else []),
            *([] if given["enable_progress_bar"] is False else [TrainingBar()]),
            *_as_list(given["callbacks"]),
        ]
        plugins = [AtomicCheckpointIO(), *_as_list(given["plugins"])]
        with _settings_checked(TypeError, ValueError):
            return super().instantiate_trainer(
                logger=loggers or False, callbacks=callbacks, plugins=plugins, **settings
            )

    def _loggers(self, given: Any) -> list[Any]:  # noqa: ANN401 - as of Lightning's Trainer
        """Return TensorBoard's logger and those that are asked for; none for an evaluation."""
        if given is False or self._stage != "fit":
            return []
        return [event_logger(self.folder.out), *(one for one in _as_list(given) if one is not True)]

    @contextmanager
    def _resumable(self) -> Iterator[None]:
        """Say how to go on after an interrupt or a full disk."""
        try:
            yield
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt(self.folder.how_to_go_on(self.kind.name)) from error
        except WriteError as error:
            advice = f"make room, then {self.folder.how_to_go_on(self.kind.name)}"
            raise WriteError(
                error.where, expected=error.expected, found=error.found, advice=advice
            ) from error

    def _run_stage(self, stage: Stage, checkpoint: Path | None) -> None:
        run = {"datamodule": self.datamodule, "ckpt_path": checkpoint, "weights_only": True}
        if stage == "fit":
            self.trainer.fit(self.model, **run)
        elif stage == "validate":
            self.trainer.validate(self.model, **run, verbose=False)
        else:
            self.trainer.test(self.model, **run, verbose=False)

    def _on_train_start(self, trainer: Trainer, module: LightningModule) -> None:
        """Write the configuration, once nothing can be refused any more."""
        if trainer.is_global_zero and not trainer.fast_dev_run:  # type: ignore[attr-defined]
            self.command_config.write(self.folder.out)

    def _hyperparameters(self) -> dict[str, Any]:
        """Return what a checkpoint states beside the module's own hyperparameters."""
        values = self.command_config.values
        stated = {name: values[name] for name in ("optimizer", "lr_scheduler", "ema")}
        return stated | {"training_data": self.datamodule.training_data}

    def _require_duration(self) -> None:
        """Validate that there is something to train."""
        trainer = self.config["trainer"]
        for flag, name in (("--epochs", "max_epochs"), ("--steps", "max_steps")):
            count = trainer[name]
            if count is not None and (count == 0 or count < -1):
                raise UsageError(flag, expected="at least 1", found=str(count))


def fit(
    kind: TrainingKind,
    arguments: Mapping[str, object],
    out: Path,
    progress: Progress = iter,
    config: str | None = None,
) -> Any:  # noqa: ANN401 - as `run`
    """Train by arguments, such as those of a study; resume where `out` holds the same training.

    Args:
        kind: Kind of training.
        arguments: Values by full name, such as `trainer.max_epochs`.
        out: Folder of the training.
        progress: Wrapper of the loop over frames that may show its progress.
        config: Configuration that the arguments change: default, thesis, or a file.

    Raises:
        PerceptionError: settings, drives or a checkpoint cannot be used, or the folder is of other settings.
    """
    files = [] if config is None else [f"--config={config_file(kind.name, config)}"]
    words = [f"--{name}={_word(value)}" for name, value in arguments.items()]
    cli = TrainingCLI(kind, [*files, *words, f"--trainer.default_root_dir={out}"])
    if not cli.folder.last.exists():
        return cli.run("fit", None, progress)
    if read_config(out / CONFIG) != cli.command_config.values:
        raise UsageError(
            out,
            expected="a training with the same settings, or none",
            found=f"others in {CONFIG}",
            advice="choose another --out",
        )
    return cli.run("fit", "last", progress)


def group_hints(kind: TrainingKind) -> dict[str, dict[str, Any]]:
    """Return the type of each flag of each group by its name, but for those that are linked or classes of torch."""
    linked = {"return", "seed", "optimizer", "lr_scheduler"}
    hints = {
        "trainer": get_type_hints(inspect.unwrap(Trainer.__init__)),
        "model": get_type_hints(kind.module.__init__),
        # The fields of the data module's configuration stand for its **config.
        "data": get_type_hints(kind.data.__init__)
        | get_type_hints(get_type_hints(kind.data)["config"]),
        "early_stopping": get_type_hints(BestEpoch.__init__),
        "ema": get_type_hints(exponential_moving_average),
    }
    for name in ("config", *kind.links.values()):
        del hints["data"][name]
    return {
        group: {name: hint for name, hint in of_group.items() if name not in linked}
        for group, of_group in hints.items()
    }


@contextmanager
def _settings_checked(*kinds: type[Exception]) -> Iterator[None]:
    """Turn what Lightning says of its settings into a sentence.

    Args:
        kinds: Errors that only a setting can cause here, beside Lightning's own.

    Raises:
        UsageError: a setting does not fit another.
    """
    refusals: tuple[type[Exception], ...] = (MisconfigurationException, *kinds)
    try:
        yield
    except refusals as error:
        raise UsageError(
            "--trainer",
            expected="settings that Lightning takes together",
            found=" ".join(str(error).split()).rstrip("."),
        ) from error


def config_file(kind: str, given: str) -> Path:
    """Return the file of a configuration: one that is shipped, such as thesis, or one named by its path."""
    shipped = Path(__file__).parent / "configs" / kind / f"{given}.yaml"
    return shipped if shipped.exists() else Path(given)


_HELP = {
    "optimizer": "Optimizer: a class of torch.optim, such as AdamW or SGD, with its parameters.",
    "lr_scheduler": "Schedule of the learning rate: WarmupCosine, StepDecay, DarknetSteps or a class of torch.",
}


def _as_list(given: Any) -> list[Any]:  # noqa: ANN401 - one, several or none
    if given is None:
        return []
    return list(given) if isinstance(given, Sequence) and not isinstance(given, str) else [given]


def _word(value: object) -> str:
    if isinstance(value, str | Path):
        return str(value)
    return json.dumps(to_serializable(value))
