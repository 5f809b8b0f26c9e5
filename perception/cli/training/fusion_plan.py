"""From the flags of a command to a fitted fusion; what needs torch is imported here."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from data.atomic_file import write_atomically
from perception.cli.progress import progress_bar
from perception.cli.training.fusion_data import FusionDataConfig, SplitDetections
from perception.cli.training.trainer_choice import write_training_configuration
from perception.detection.config import FusionVariant
from perception.types import MODALITIES

if TYPE_CHECKING:
    from train.fusion.config import FusionSets, FusionTrainingConfig
    from train.fusion.sweep import SweptSize
    from train.fusion.training import FittedFusion
    from train.trainer import TrainerConfig

Optimiser = Literal["lm", "adamw"]


@dataclass(frozen=True)
class FusionModelConfig:
    """Which network, and how it is fitted; None takes what its variant has.

    Attributes:
        variant: what it is told of a combination.
        hidden: neurons of its layers.
        optimiser: lm or adamw.
        sweep: sizes of one layer that are tried first, the best of which is taken.
        sweep_two: sizes of two layers, likewise.
    """

    variant: FusionVariant = "default"
    hidden: tuple[int, ...] | None = None
    optimiser: Optimiser | None = None
    sweep: tuple[int, ...] = ()
    sweep_two: tuple[int, ...] = ()


_SCORE_JITTERS = 2  # of every frame, for the default
# The thesis' own: 41 neurons on scores, 23 on all features, by Levenberg-Marquardt (7.2.2).
_USUAL: Mapping[FusionVariant, tuple[tuple[int, ...], Optimiser]] = {
    "scores": ((41,), "lm"),
    "features": ((23,), "lm"),
    "default": ((32, 16), "adamw"),
}


@dataclass(frozen=True)
class TrainingFolder:
    """Where a training is.

    Attributes:
        out: the folder.
        resumed: the checkpoint that it goes on from.
    """

    out: Path
    resumed: Path | None = None

    @classmethod
    def of_flags(cls, out: Path, resume: str | None) -> "TrainingFolder":
        """Find the checkpoint, and refuse to begin where another training lies, before any work is done.

        Raises:
            UsageError: there is a training, and it is not to be gone on with.
        """
        from train.trainer import checkpoint_to_resume

        return cls(out, checkpoint_to_resume(out, resume))


@dataclass(frozen=True)
class TrainedFusion:
    """What a training leaves.

    Attributes:
        file: the model.
        metadata: what it says of itself.
        fitted: its errors.
        swept: sizes that were tried.
        counts: frames and combinations of both parts.
    """

    file: Path
    metadata: dict[str, str]
    fitted: "FittedFusion"
    swept: tuple["SweptSize", ...]
    counts: dict[str, int]


def run_training(
    data: FusionDataConfig,
    model: FusionModelConfig,
    found: SplitDetections,
    trainer: "TrainerConfig",
    place: TrainingFolder,
) -> "TrainedFusion":
    """Fit a fusion in a folder, and write it as a model file whose scores are calibrated.

    Raises:
        ModelError: a checkpoint to go on from is damaged, or of another training.
    """
    from export.fusion import export_fusion
    from export.result import ExportConfig
    from train.fusion.config import FusionSets
    from train.fusion.targets import fusion_rows
    from train.fusion.training import fit_fusion

    sets = FusionSets(
        fusion_rows(found.training, model.variant, score_jitters=_SCORE_JITTERS),
        fusion_rows(found.validation, model.variant),
    )
    asked = replace(fusion_training_config(data, model, trainer.seed), detectors=found.detectors)
    config, swept = _swept(model, sets, asked)
    write_training_configuration(
        place.out, data=data, network=config, trainer=trainer, resumed_from=place.resumed
    )
    fitted = fit_fusion(sets, config, place.out, trainer, place.resumed)
    exported = export_fusion(ExportConfig(fitted.checkpoint))
    file = place.out / "fusion.onnx"
    exported.require_parity(file.name)
    write_atomically(file, exported.models["fp32"])
    counts: dict[str, int] = {}
    for name, frames, rows in (
        ("training", found.training, sets.training),
        ("validation", found.validation, sets.validation),
    ):
        counts |= {f"{name}_frames": len(frames), f"{name}_combinations": len(rows)}
    counts["judged_frames"] = len(found.judged)
    metadata = exported.metadata
    if model.variant == "default":  # the thesis' scores stay as they are printed
        metadata = metadata | {"calibration": _calibrate(file, fitted.checkpoint, found)}
    return TrainedFusion(file, metadata, fitted, swept, counts)


def fusion_training_config(
    data: FusionDataConfig, model: FusionModelConfig, seed: int
) -> "FusionTrainingConfig":
    """Return which network, and how it is fitted."""
    from train.fusion.config import FusionTrainingConfig
    from train.fusion.mlp import MlpConfig
    from train.revision import program_revision

    hidden, optimiser = _USUAL[model.variant]
    return FusionTrainingConfig(
        MlpConfig(model.variant, model.hidden or hidden),
        model.optimiser or optimiser,
        seed=seed,
        training_data=", ".join(str(path) for path in data.drives),
        revision=program_revision(),
    )


def _swept(
    model: FusionModelConfig, sets: "FusionSets", config: "FusionTrainingConfig"
) -> tuple["FusionTrainingConfig", tuple["SweptSize", ...]]:
    """Return the plan with the best of the sizes to be tried."""
    from train.fusion.sweep import hidden_sizes, sweep

    sizes = hidden_sizes(model.sweep, model.sweep_two)
    swept = sweep(
        sets, config, sizes, partial(progress_bar, description="sizes", unit="network", delay_s=2)
    )
    if not swept:
        return config, ()
    best = min(swept, key=lambda one: one.validation)
    return replace(
        config, network_config=replace(config.network_config, hidden=best.hidden)
    ), tuple(swept)


def _calibrate(file: Path, checkpoint: Path, found: SplitDetections) -> str:
    """Write the curves from scores to probabilities into a model file and its checkpoint, and return them."""
    from data.detections.fused_frames import boxes_beside, fuse_frames, judged
    from export.fusion import with_calibrations
    from perception.detection.fusion.rescoring import Fusion
    from perception.detection.fusion.score_calibration import FusionCalibration
    from train.fusion.calibration import fit_calibration
    from train.fusion.training import write_calibrations

    frames = found.validation
    boxes = boxes_beside(frames, fuse_frames(frames.scenes, Fusion(file)))
    curves = {
        name: fit_calibration(judged(frames, of_one, found.class_names))
        for name, of_one in boxes.items()
    }
    calibrations = FusionCalibration(
        joint=curves["fusion"], alone={name: curves[name] for name in MODALITIES if name in curves}
    )
    write_atomically(file, with_calibrations(file.read_bytes(), calibrations))
    write_calibrations(checkpoint, calibrations)
    return str(calibrations)
