"""From the flags of a command to a training of DepthCN's network; what needs torch is imported here."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from data.frames import OnBadFrame
from perception.cli.flags import require_drives
from perception.cli.progress import frame_bar
from perception.cli.training.trainer_choice import write_training_configuration
from perception.types import Method

if TYPE_CHECKING:
    from data.candidates.module import CandidateData
    from train.trainer import TrainerPlan
    from train.verifier.run import TrainedVerifier


@dataclass(frozen=True)
class VerifierData:
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
    data: VerifierData,
    method: Method,
    trainer: "TrainerPlan",
    out: Path,
    resume: str | None = None,
) -> "TrainedVerifier | None":
    """Train a network in a folder; return what came of it, in the first process only."""
    from train.revision import program_revision
    from train.trainer import checkpoint_to_resume
    from train.verifier.run import train_verifier
    from train.verifier.training import PLANS

    checkpoint = checkpoint_to_resume(out, resume)
    plan = replace(PLANS[method], training_data=data.names, revision=program_revision())
    write_training_configuration(
        out, data=data, network=plan, trainer=trainer, resumed_from=checkpoint
    )
    module = candidate_data(data, method, trainer.seed)
    return train_verifier(module, plan, trainer, out, checkpoint)


def candidate_data(data: VerifierData, method: Method, seed: int) -> "CandidateData":
    """Return the batches of one of the networks."""
    from data.candidates.augmentation import Augmentation
    from data.candidates.gathering import GatheringRules
    from data.candidates.labelled_frames import FrameRules
    from data.candidates.module import CandidateData, CandidateRules, Loading
    from data.training_drives import Sources
    from train.networks.depthcn import FORMS

    form = FORMS[method]
    gathering = GatheringRules(window=form.window, on_bad_frame=data.on_bad_frame, seed=seed)
    return CandidateData(
        Sources(data.drives, data.validation, data.cache),
        CandidateRules(FrameRules(method), gathering),
        Augmentation() if data.augment else None,
        Loading(form.channels, data.batch, data.workers, seed=seed),
        frame_bar("candidates"),
    )
