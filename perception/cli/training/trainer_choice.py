"""What all commands that train share; what needs torch is imported here."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from data.results.documents import write_yaml
from perception import __version__
from perception.errors import MissingDependencyError

if TYPE_CHECKING:
    from train.trainer import TrainerConfig


def trainer_config(**choices: Any) -> "TrainerConfig":  # noqa: ANN401 - fields of the plan
    """Return how long and on what, or say what has to be installed first.

    Raises:
        MissingDependencyError: without the packages that train.
    """
    try:
        from train.trainer import TrainerConfig, fastest_precision
    except ImportError as error:
        raise MissingDependencyError(
            "torch, lightning and tensorboard",
            needed_for="training",
            extra="train",
            reason=error,
        ) from error
    if choices.get("precision") == "auto":
        choices["precision"] = fastest_precision(choices["accelerator"])
    return TrainerConfig(**choices)


def write_training_configuration(out: Path, **effective: object) -> None:
    """Write `config.yaml` into the folder of a training, in the first of its processes only."""
    from train.trainer import is_first_process

    if is_first_process():
        write_yaml(out / "config.yaml", {"program": f"trifuse {__version__}", **effective})


def as_path_tuple(paths: Path | list[Path] | None) -> tuple[Path, ...]:
    """Return the paths of a flag that takes one or several."""
    if paths is None:
        return ()
    return (paths,) if isinstance(paths, Path) else tuple(paths)
