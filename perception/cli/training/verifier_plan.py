"""From the flags of a command to a training of DepthCN's network; what needs torch is imported here."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from data.frames import OnBadFrame
from perception.cli.flags import require_drives
from perception.cli.progress import frame_progress_bar
from perception.cli.training.trainer_choice import write_training_configuration
from perception.types import Method

if TYPE_CHECKING:
    from data.crops.datamodule import CropDataModule
    from train.trainer import TrainerConfig
    from train.verifier.run import TrainedVerifier


@dataclass(frozen=True)
class VerifierDataConfig:
    """What a network is shown.

    Attributes:
        drives: labelled drives that it learns from.
        validation: drives that it is judged by; none keeps a fifth of the frames back.
        batch: samples a step, half of them vehicles.
        augment: whether samples are changed at every look.
        workers: processes that make samples.
        on_bad_frame: stop at a damaged frame, or leave it out.
        cache: folder for what is made of the frames; else the user's cache folder.
    """

    drives: tuple[Path, ...]
    validation: tuple[Path, ...]
    batch: int = 128
    augment: bool = True
    workers: int = 0
    on_bad_frame: OnBadFrame = "stop"
    cache: Path | None = None

    def __post_init__(self) -> None:
        """Refuse nothing to learn from."""
        require_drives(self.drives)

    @property
    def names(self) -> str:
        """What the model file says that it learned from."""
        return ", ".join(str(path) for path in self.drives)


def run_training(
    data: VerifierDataConfig,
    method: Method,
    trainer: "TrainerConfig",
    out: Path,
    resume: str | None = None,
) -> "TrainedVerifier | None":
    """Train a network in a folder; return what came of it, in the first process only."""
    from train.revision import program_revision
    from train.trainer import checkpoint_to_resume
    from train.verifier.run import train_verifier
    from train.verifier.training import VERIFIER_CONFIGS

    checkpoint = checkpoint_to_resume(out, resume)
    config = replace(
        VERIFIER_CONFIGS[method], training_data=data.names, revision=program_revision()
    )
    write_training_configuration(
        out, data=data, network=config, trainer=trainer, resumed_from=checkpoint
    )
    module = crop_data(data, method, trainer.seed)
    return train_verifier(module, config, trainer, out, checkpoint)


def crop_data(data: VerifierDataConfig, method: Method, seed: int) -> "CropDataModule":
    """Return the batches of one of the networks."""
    from data.crops.augmentation import CropAugmentationConfig
    from data.crops.datamodule import CropConfig, CropDataModule, CropLoadingConfig
    from data.crops.labelled_frames import FrameConfig
    from data.crops.sampling import CropSamplingConfig
    from data.training_drives import TrainingDrives
    from train.networks.depthcn import VERIFIER_INPUTS

    input_config = VERIFIER_INPUTS[method]
    sampling = CropSamplingConfig(
        window=input_config.window, on_bad_frame=data.on_bad_frame, seed=seed
    )
    return CropDataModule(
        TrainingDrives(data.drives, data.validation, data.cache),
        CropConfig(FrameConfig(method), sampling),
        CropAugmentationConfig() if data.augment else None,
        CropLoadingConfig(input_config.channels, data.batch, data.workers, seed=seed),
        frame_progress_bar("candidates"),
    )
