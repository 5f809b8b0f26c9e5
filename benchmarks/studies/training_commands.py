"""`trifuse study`: the studies that train detectors, as commands."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

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
from perception.cli.flags import require_positive
from perception.cli.training.detector_plan import DetectorDataConfig, DetectorModelConfig
from perception.cli.training.trainer_choice import as_path_tuple
from perception.cli.training.verifier_plan import VerifierDataConfig
from perception.evaluation.detection.config import PrecisionConfig
from perception.types import Method, Modality

_OVERLAPS = (0.7, 0.5)


@dataclass(frozen=True)
class TrainingFlags:
    """What all studies that train detectors ask; each hands its `**training` flags on to this.

    Attributes:
        epochs: of each training; of one with all frames, where trainings differ in these.
        batch: pictures a step; else that of the preset.
        bootstrap: so many choices of frames give intervals; 0 for none.
        seed: of all.
        workers: processes that make samples.
        accelerator: auto takes a GPU where there is one.
        cache: folder for the pictures; else the user's cache folder.
    """

    epochs: int = 20
    batch: int | None = None
    bootstrap: int = 0
    seed: int = 0
    workers: int = 0
    accelerator: Literal["auto", "cpu", "gpu"] = "auto"
    cache: Path | None = None

    def __post_init__(self) -> None:
        """Refuse no training at all."""
        require_positive("--epochs", self.epochs)

    @property
    def conditions(self) -> VariantTrainingConfig:
        """What is the same for all variants."""
        return VariantTrainingConfig(self.seed, self.accelerator)

    def base(
        self, detector: DetectorModelConfig, drives: list[Path], validation: Path | list[Path]
    ) -> DetectorVariant:
        """Return what the variants are changes of."""
        images = DetectorDataConfig(
            tuple(drives),
            as_path_tuple(validation),
            batch=self.batch,
            workers=self.workers,
            cache=self.cache,
        )
        return DetectorVariant("", detector, images, self.epochs)

    def evaluation(self, *drives: Path) -> VariantEvaluationConfig:
        """Return by what the variants are measured."""
        return VariantEvaluationConfig(
            drives, PrecisionConfig(_OVERLAPS, bootstrap=self.bootstrap, seed=self.seed)
        )


def augmentation(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    validation: Path | list[Path] | None = None,
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
        drives: labelled drives that it learns from.
        validation: drives to judge by, one or [several]; without, a fifth of the frames is kept back.
        method: thesis, the network of Fig. 6.5 with its own schedule, or default.
        epochs: of each of the two trainings.
        batch: samples a step.
        seed: of both.
        workers: processes that make samples.
        resume: go on where this study ended before.
        cache: folder for pictures and candidates of the frames; else the user's cache folder.
        out: the picture; the numbers and both trainings are written beside it.
    """
    data = VerifierDataConfig(
        tuple(drives), as_path_tuple(validation), batch, workers=workers, cache=cache
    )
    publish(
        study_augmentation(data, out, AugmentationStudyConfig(method, epochs, seed, resume)), out
    )


def reflectance_maps(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    validation: Path | list[Path],
    network: str = "compact",
    size: str = "416x416",
    wide_size: str = "352x1216",
    preset: Literal["default", "thesis"] = "default",
    out: Path = RESULTS / "reflectance-maps.png",
    **training: Any,  # noqa: ANN401 - fields of TrainingFlags
) -> None:
    """Train a detector on sparse, interpolated and wide reflectance maps (Tables B.1, B.2 and B.3).

    A map whose training is done is not trained again: the same command goes on where it was stopped.

    Example: trifuse study reflectance-maps synth/train --validation synth/val --epochs 20

    Args:
        drives: labelled drives that they learn from.
        validation: drives by which the best epoch is chosen and all are measured, one or [several].
        network: compact; yolov2, as in the thesis; or a classifier of torchvision as trunk.
        size: height and width of the input.
        wide_size: of the one that Table B.2 calls RM*.
        preset: default; or thesis, the figures of 7.2.2, for yolov2.
        out: the picture; the numbers and all trainings are written beside it.
        training: as TrainingFlags says.
    """
    flags = TrainingFlags(**training)
    choice = DetectorModelConfig("rm", network, size, preset=preset)
    variants = map_variants(flags.base(choice, drives, validation), wide_size)
    evaluation = flags.evaluation(*as_path_tuple(validation))
    publish(study_reflectance_maps(variants, flags.conditions, evaluation, out), out)


def detector_losses(
    drives: list[Path],
    *,
    validation: Path | list[Path],
    modality: Modality = "dm",
    network: str = "compact",
    size: str = "192x640",
    out: Path = RESULTS / "detector-losses.png",
    **training: Any,  # noqa: ANN401 - fields of TrainingFlags
) -> None:
    """Train a detector by the published loss, and with CIoU of boxes, focal objectness, and both.

    A loss whose training is done is not trained again: the same command goes on where it was stopped.

    Example: trifuse study detector-losses synth/train --validation synth/val --modality rgb

    Args:
        drives: labelled drives that they learn from.
        validation: drives by which the best epoch is chosen and all are measured, one or [several].
        modality: rgb, the camera's image; dm, depth map; rm, reflectance map.
        network: compact, yolov2, or a classifier of torchvision as trunk.
        size: height and width of the input.
        out: the picture; the numbers and all trainings are written beside it.
        training: as TrainingFlags says.
    """
    flags = TrainingFlags(**training)
    base = flags.base(DetectorModelConfig(modality, network, size), drives, validation)
    evaluation = flags.evaluation(*as_path_tuple(validation))
    publish(study_detector_losses(loss_variants(base), flags.conditions, evaluation, out), out)


def sim_to_real(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    validation: Path | list[Path],
    real: Path | list[Path] | None = None,
    modality: Modality = "dm",
    network: str = "compact",
    size: str = "192x640",
    shares: tuple[float, ...] = (0.125, 0.25, 0.5, 1.0),
    out: Path = RESULTS / "sim-to-real.png",
    **training: Any,  # noqa: ANN401 - fields of TrainingFlags
) -> None:
    """Train a detector on ever more synthetic frames; measure it on held-out and on real drives.

    Those of fewer frames see them more often, so that all are trained for as many steps. A share whose
    training is done is not trained again: the same command goes on where it was stopped.

    Example: trifuse study sim-to-real synth/train --validation synth/val --real kitti/object

    Args:
        drives: synthetic drives that they learn from; shares take their first frames.
        validation: drives by which the best epoch is chosen, one or [several].
        real: other labelled drives to measure on, one or [several].
        modality: rgb, the camera's image; dm, depth map; rm, reflectance map.
        network: compact, yolov2, or a classifier of torchvision as trunk.
        size: height and width of the input.
        shares: of the frames; one more training takes all, without changing them.
        out: the picture; the numbers and all trainings are written beside it.
        training: as TrainingFlags says.
    """
    flags = TrainingFlags(**training)
    base = flags.base(DetectorModelConfig(modality, network, size), drives, validation)
    evaluation = flags.evaluation(*as_path_tuple(validation), *as_path_tuple(real))
    publish(study_sim_to_real(share_variants(base, shares), flags.conditions, evaluation, out), out)


COMMANDS = {
    "augmentation": augmentation,
    "reflectance-maps": reflectance_maps,
    "detector-losses": detector_losses,
    "sim-to-real": sim_to_real,
}
