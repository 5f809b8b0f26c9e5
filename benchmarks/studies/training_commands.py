"""`trifuse study`: the studies that train networks, as commands."""

from dataclasses import dataclass
from pathlib import Path

from benchmarks.studies.augmentation import AugmentationStudyConfig, study_augmentation
from benchmarks.studies.detector_losses import loss_variants, study_detector_losses
from benchmarks.studies.detector_variants import (
    DetectorVariant,
    VariantEvaluationConfig,
    VariantTrainingConfig,
)
from benchmarks.studies.reflectance_maps import map_variants, study_reflectance_maps
from benchmarks.studies.report import RESULTS, publish
from benchmarks.studies.sim_to_real import share_variants, study_sim_to_real
from data.samples.config import TrainingDrives
from data.samples.crops.config import CropDataConfig
from data.samples.images.config import ImageDataConfig
from perception.cli.flags import require_drives, require_positive
from perception.cli.parser import FlagGroup
from perception.evaluation.detection.config import PrecisionConfig
from perception.types import Method, Modality
from train.config import Accelerator
from train.detector.config import (
    DETECTOR_PRESETS,
    DetectorExperiment,
    DetectorModelConfig,
    Preset,
)
from train.verifier.config import VERIFIER_CONFIGS, VerifierExperiment

_IOUS = (0.7, 0.5)


@dataclass(frozen=True)
class DetectorStudyFlags(FlagGroup):
    """Training of each detector.

    Attributes:
        validation: Labelled drives that choose the best epoch and measure all detectors, with commas between them.
        network: Network: compact, yolov2, or the torchvision classifier of its backbone.
        preset: Optimizer, loss and batch size: default, or thesis for those of 7.2.2.
        epochs: Epochs of each training; with all frames, where trainings differ in these.
        batch: Images per batch; else that of the preset.
        bootstrap: Number of bootstrap samples of the intervals; 0 for none.
        seed: Seed of all trainings.
        workers: Processes that load samples.
        accelerator: Device; auto uses a GPU where there is one.
        cache: Cache folder of the images; else the user's cache folder.
    """

    validation: list[Path] | None = None
    network: str = "compact"
    preset: Preset = "default"
    epochs: int = 20
    batch: int | None = None
    bootstrap: int = 0
    seed: int = 0
    workers: int = 0
    accelerator: Accelerator = "auto"
    cache: Path | None = None

    def __post_init__(self) -> None:
        """Validate the number of epochs."""
        require_positive("--epochs", self.epochs)

    @property
    def conditions(self) -> VariantTrainingConfig:
        """Settings that all variants share."""
        return VariantTrainingConfig(self.seed, self.accelerator)

    def base(self, drives: list[Path], modality: Modality, size: str) -> DetectorVariant:
        """Return the variant that the others are changes of."""
        require_drives(drives)
        preset = DETECTOR_PRESETS[self.preset]
        experiment = DetectorExperiment(
            TrainingDrives(tuple(drives), tuple(self.validation or ())),
            modality,
            DetectorModelConfig(self.network, size=size),
            ImageDataConfig(
                batch_size=self.batch or preset.batch_size, workers=self.workers, cache=self.cache
            ),
            preset.optimizer,
            preset.loss,
        )
        return DetectorVariant("", experiment, self.epochs)

    def evaluation(self, real: list[Path] | None = None) -> VariantEvaluationConfig:
        """Return the drives and the metric of the evaluation."""
        return VariantEvaluationConfig(
            (*(self.validation or ()), *(real or ())),
            PrecisionConfig(_IOUS, bootstrap=self.bootstrap, seed=self.seed),
        )


def augmentation(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    validation: list[Path] | None = None,
    method: Method = "thesis",
    epochs: int = 40,
    batch: int = 128,
    seed: int = 0,
    workers: int = 0,
    resume: bool = False,
    cache: Path | None = None,
    out: Path = RESULTS / "augmentation.png",
) -> None:
    """Train DepthCN's network without and with augmentation; accuracies beside Table 7.8's.

    Example: trifuse study augmentation synth/train --validation synth/val

    Args:
        drives: Labelled drives for training.
        validation: Labelled drives for validation; else a fifth of the frames is kept back.
        method: Network and optimizer: thesis, Fig. 6.5, or default.
        epochs: Epochs of each of the two trainings.
        batch: Crops per batch.
        seed: Seed of both trainings.
        workers: Processes that load samples.
        resume: Resume an earlier study of the same folder.
        cache: Cache folder of images and proposals; else the user's cache folder.
        out: Plot; the numbers and both trainings are written beside it.
    """
    require_drives(drives)
    experiment = VerifierExperiment(
        TrainingDrives(tuple(drives), tuple(validation or ())),
        method,
        CropDataConfig(batch_size=batch, workers=workers, cache=cache),
        VERIFIER_CONFIGS[method].optimizer,
    )
    publish(study_augmentation(experiment, out, AugmentationStudyConfig(epochs, seed, resume)), out)


def reflectance_maps(
    drives: list[Path],
    *,
    training: DetectorStudyFlags,
    size: str = "416x416",
    wide_size: str = "352x1216",
    out: Path = RESULTS / "reflectance-maps.png",
) -> None:
    """Train a detector on sparse, interpolated and wide reflectance maps (Tables B.1, B.2 and B.3).

    A finished training is not repeated: the same command continues where it was stopped.

    Example: trifuse study reflectance-maps synth/train --validation synth/val --epochs 20

    Args:
        drives: Labelled drives for training.
        size: Height and width of the input.
        wide_size: Height and width of the wide input, RM* of Table B.2.
        out: Plot; the numbers and all trainings are written beside it.
    """
    variants = map_variants(training.base(drives, "rm", size), wide_size)
    publish(study_reflectance_maps(variants, training.conditions, training.evaluation(), out), out)


def detector_losses(
    drives: list[Path],
    *,
    training: DetectorStudyFlags,
    modality: Modality = "dm",
    size: str = "192x640",
    out: Path = RESULTS / "detector-losses.png",
) -> None:
    """Train a detector with the published loss, with CIoU of boxes, with focal objectness, and with both.

    A finished training is not repeated: the same command continues where it was stopped.

    Example: trifuse study detector-losses synth/train --validation synth/val --modality rgb

    Args:
        drives: Labelled drives for training.
        modality: Camera image, rgb; depth map, dm; or reflectance map, rm.
        size: Height and width of the input.
        out: Plot; the numbers and all trainings are written beside it.
    """
    variants = loss_variants(training.base(drives, modality, size))
    publish(study_detector_losses(variants, training.conditions, training.evaluation(), out), out)


def sim_to_real(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    training: DetectorStudyFlags,
    real: list[Path] | None = None,
    modality: Modality = "dm",
    size: str = "192x640",
    shares: tuple[float, ...] = (0.125, 0.25, 0.5, 1.0),
    out: Path = RESULTS / "sim-to-real.png",
) -> None:
    """Train a detector on more and more synthetic frames; measure it on held-out and on real drives.

    Trainings on fewer frames have more epochs, so that all have as many steps. A finished training is not repeated:
    the same command continues where it was stopped.

    Example: trifuse study sim-to-real synth/train --validation synth/val --real kitti/object

    Args:
        drives: Synthetic drives for training.
        real: Other labelled drives to measure on.
        modality: Camera image, rgb; depth map, dm; or reflectance map, rm.
        size: Height and width of the input.
        shares: Fractions of the frames, the first ones; one more training takes all without augmentation.
        out: Plot; the numbers and all trainings are written beside it.
    """
    variants = share_variants(training.base(drives, modality, size), shares)
    evaluation = training.evaluation(real)
    publish(study_sim_to_real(variants, training.conditions, evaluation, out), out)
