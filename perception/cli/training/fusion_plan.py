"""From the flags of a command to a fitted fusion; what needs torch is imported here."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from data.detections.detected_frames import DetectedFrames
from data.detections.gathering import MarkedLooker, detect_drives, models_mark, require_unseen
from data.frames import OnBadFrame
from data.splitting import SplitBy, validation_frames
from data.training_drives import Sources, open_drives
from data.whole_file import write_whole
from perception.cli.training.trainer_choice import frame_bar, write_training_configuration
from perception.detection.fusion.features import Variant
from perception.detection.modality_detector import ModalityDetector
from perception.detection.multimodal import MultimodalDetector
from perception.detection.session import shipped_model
from perception.errors import UsageError
from perception.types import MODALITIES, Modality

if TYPE_CHECKING:
    from train.fusion.sweep import SweptSize
    from train.fusion.training import FittedFusion, FusionPlan, FusionSets
    from train.trainer import TrainerPlan

Optimiser = Literal["lm", "adamw"]


@dataclass(frozen=True)
class DetectorFiles:
    """Which detectors are fused; those that ship where no file is named.

    Attributes:
        rgb: detector of the camera's image.
        dm: of the depth map.
        rm: of the reflectance map.
    """

    rgb: Path | None = None
    dm: Path | None = None
    rm: Path | None = None

    def open(self) -> dict[Modality, ModalityDetector]:
        """Open all three.

        Raises:
            ModelError: there is no such file, or it holds no detector.
        """
        named = {name: getattr(self, name) or name for name in MODALITIES}
        return {name: ModalityDetector(file, threads=1) for name, file in named.items()}

    def mark(self) -> str:
        """Return what tells these files from others."""
        files = {
            name: getattr(self, name) or shipped_model(f"{name}_compact") for name in MODALITIES
        }
        return models_mark({name: file.read_bytes() for name, file in files.items()})


@dataclass(frozen=True)
class FusionData:
    """What a fusion learns from.

    Attributes:
        drives: labelled drives.
        validation: drives that it is judged by; none keeps a share of the frames back.
        validation_share: of the frames or drives.
        split: keep single frames back, or whole drives.
        models: the detectors.
        on_bad_frame: stop at a damaged frame, or leave it out.
        cache: folder for what the detectors see; else the user's cache folder.
    """

    drives: tuple[Path, ...]
    validation: tuple[Path, ...] = ()
    validation_share: float = 0.25
    split: SplitBy = "frames"
    models: DetectorFiles = DetectorFiles()
    on_bad_frame: OnBadFrame = "stop"
    cache: Path | None = None

    def __post_init__(self) -> None:
        """Refuse nothing to learn from."""
        if not self.drives:
            raise UsageError("drives", expected="at least one", found="none")


@dataclass(frozen=True)
class FusionChoice:
    """Which network, and how it is fitted; None takes what its variant has.

    Attributes:
        variant: what it is told of a combination.
        hidden: neurons of its layers.
        optimiser: lm or adamw.
        sweep: sizes of one layer that are tried first, the best of which is taken.
        sweep_two: sizes of two layers, likewise.
    """

    variant: Variant = "default"
    hidden: tuple[int, ...] | None = None
    optimiser: Optimiser | None = None
    sweep: tuple[int, ...] = ()
    sweep_two: tuple[int, ...] = ()


# The thesis' own: 41 neurons on scores, 23 on all features, by Levenberg-Marquardt (7.2.2).
_USUAL: Mapping[Variant, tuple[tuple[int, ...], Optimiser]] = {
    "scores": ((41,), "lm"),
    "features": ((23,), "lm"),
    "default": ((32, 16), "adamw"),
}


@dataclass(frozen=True)
class SplitDetections:
    """What the detectors saw, and what they detect."""

    training: DetectedFrames
    validation: DetectedFrames
    class_names: tuple[str, ...]


@dataclass(frozen=True)
class TrainedFusion:
    """What a training leaves.

    Attributes:
        file: the model.
        facts: what it says of itself.
        fitted: its errors.
        swept: sizes that were tried.
        counts: frames and combinations of both parts.
    """

    file: Path
    facts: dict[str, str]
    fitted: "FittedFusion"
    swept: tuple["SweptSize", ...]
    counts: dict[str, int]


def split_detections(data: FusionData, seed: int) -> SplitDetections:
    """Let the detectors look at all frames, or read what they saw; keep some frames back.

    Raises:
        UsageError: a detector learned from one of the drives, or nothing is left of a part.
        PerceptionError: a drive, a frame or a model cannot be read or used.
    """
    detectors = data.models.open()
    marked = MarkedLooker(MultimodalDetector(detectors), data.models.mark())
    sources = Sources(data.drives, data.validation, data.cache)
    parts = []
    for paths in filter(None, (sources.training, sources.validation)):
        drives = open_drives(paths)
        require_unseen(drives, detectors)
        bar = frame_bar("detections")
        parts.append(detect_drives(drives, marked, sources.store, data.on_bad_frame, bar))
    names = next(iter(detectors.values())).class_names
    if len(parts) == 2:
        return SplitDetections(parts[0], parts[1], names)
    whole, rng = parts[0], np.random.default_rng([seed, 0xF])
    is_kept = validation_frames(whole.drive_numbers, data.validation_share, data.split, rng)
    return SplitDetections(whole[np.flatnonzero(~is_kept)], whole[np.flatnonzero(is_kept)], names)


def run_training(
    data: FusionData,
    choice: FusionChoice,
    found: SplitDetections,
    trainer: "TrainerPlan",
    out: Path,
) -> "TrainedFusion":
    """Fit a fusion in a folder, and write it as a model file whose scores are calibrated."""
    from export.exported import ExportOrder
    from export.fusion import export_fusion
    from train.fusion.targets import fusion_rows
    from train.fusion.training import FusionSets, fit_fusion

    sets = FusionSets(
        fusion_rows(found.training, choice.variant), fusion_rows(found.validation, choice.variant)
    )
    plan, swept = _swept(choice, sets, fusion_plan(data, choice, trainer.seed))
    write_training_configuration(out, data=data, network=plan, trainer=trainer)
    fitted = fit_fusion(sets, plan, out, trainer)
    exported = export_fusion(ExportOrder(fitted.checkpoint))
    file = out / "fusion.onnx"
    exported.require_parity(file.name)
    write_whole(file, exported.models["fp32"])
    counts: dict[str, int] = {}
    for name, frames, rows in (
        ("training", found.training, sets.training),
        ("validation", found.validation, sets.validation),
    ):
        counts |= {f"{name}_frames": len(frames), f"{name}_combinations": len(rows)}
    facts = exported.facts
    if choice.variant == "default":  # the thesis' scores stay as they are printed
        facts = facts | {"calibration": _calibrate(file, found)}
    return TrainedFusion(file, facts, fitted, swept, counts)


def fusion_plan(data: FusionData, choice: FusionChoice, seed: int) -> "FusionPlan":
    """Return which network, and how it is fitted."""
    from train.fusion.mlp import MlpForm
    from train.fusion.training import FusionPlan
    from train.revision import program_revision

    hidden, optimiser = _USUAL[choice.variant]
    return FusionPlan(
        MlpForm(choice.variant, choice.hidden or hidden),
        choice.optimiser or optimiser,
        seed=seed,
        training_data=", ".join(str(path) for path in data.drives),
        revision=program_revision(),
    )


def _swept(
    choice: FusionChoice, sets: "FusionSets", plan: "FusionPlan"
) -> tuple["FusionPlan", tuple["SweptSize", ...]]:
    """Return the plan with the best of the sizes to be tried."""
    from train.fusion.sweep import hidden_sizes, sweep

    swept = sweep(sets, plan, hidden_sizes(choice.sweep, choice.sweep_two))
    if not swept:
        return plan, ()
    best = min(swept, key=lambda one: one.validation)
    return replace(plan, form=replace(plan.form, hidden=best.hidden)), tuple(swept)


def _calibrate(file: Path, found: SplitDetections) -> str:
    """Write the curve from scores to probabilities into a model file, and return it."""
    from data.detections.fused_frames import fuse_frames, judged
    from export.fusion import with_calibration
    from perception.detection.fusion.rescoring import Fusion
    from train.fusion.calibration import fit_calibration

    boxes = fuse_frames(found.validation.scenes, Fusion(file)).boxes
    curve = fit_calibration(judged(found.validation, boxes, found.class_names))
    write_whole(file, with_calibration(file.read_bytes(), curve))
    return str(curve)
