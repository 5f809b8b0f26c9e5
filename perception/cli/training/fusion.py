"""`trifuse train fusion`: the network that rescores detections of three modalities together (6.2.4)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from data.detections.fused_frames import curves_beside, fuse_frames
from data.frames import OnBadFrame
from data.results.documents import write_json
from data.splitting import SplitBy
from perception.cli.table import Cell, format_table
from perception.cli.training.fusion_data import (
    DetectorModelPaths,
    FusionDataConfig,
    split_detections,
)
from perception.cli.training.fusion_plan import (
    FusionModelConfig,
    TrainedFusion,
    TrainingFolder,
    run_training,
)
from perception.cli.training.fusion_plots import (
    draw_reliability,
    draw_rescoring,
    draw_sizes,
    draw_steps,
)
from perception.cli.training.trainer_choice import as_path_tuple, trainer_config
from perception.detection.config import FusionVariant
from perception.detection.fusion.rescoring import Fusion
from perception.evaluation.detection.precision_curve import PrecisionCurve
from perception.evaluation.detection.protocol import DIFFICULTIES

_SHIPPED = DetectorModelPaths()


def fusion(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    models: DetectorModelPaths = _SHIPPED,
    validation: Path | list[Path] | None = None,
    validation_fraction: float = 0.25,
    split: SplitBy = "frames",
    variant: FusionVariant = "default",
    hidden: int | tuple[int, ...] | None = None,
    optimiser: Literal["lm", "adamw"] | None = None,
    sweep: tuple[int, ...] = (),
    sweep_two: tuple[int, ...] = (),
    epochs: int = 4,
    seed: int = 0,
    on_bad_frame: OnBadFrame = "stop",
    cache: Path | None = None,
    resume: str | None = None,
    out: Path = Path("results") / "fusion",
) -> None:
    """Fit the fusion to drives that no detector learned from; follow it with: tensorboard --logdir OUT.

    The detectors look at every frame once; what they see is kept. It leaves fusion.onnx, best.ckpt, last.ckpt
    to go on from, config.yaml, figures.json, and pictures: rescoring.png (Fig. 7.12), steps.png (7.14), reliability.png,
    and with a sweep sizes.png (7.13).

    Example: trifuse train fusion synth/fusion --variant features --sweep [5,10,20,40] --out results/fusion

    Args:
        drives: labelled drives of any layout; of a folder of several, all are taken.
        models: detectors in place of those that ship; --models.rgb rgb.onnx for one of them.
        validation: drives to judge by, one or [several]; without, a share is kept back.
        validation_fraction: of the frames or drives; half of them end the training and calibrate its scores, by
            the other half the result is judged.
        split: keep single frames back, or whole drives.
        variant: default, with distances, overlaps and what is missing; features or scores, as in the thesis.
        hidden: neurons of one hidden layer, or of several as [15,7]; else those of the variant.
        optimiser: lm, Levenberg-Marquardt over all rows; or adamw; else that of the variant.
        sweep: sizes of one hidden layer to try; the best of all that are tried is taken.
        sweep_two: sizes of two hidden layers, of which all falling pairs are tried.
        epochs: of adamw; more of them fit synthetic drives better, and real ones worse.
        seed: of every choice.
        on_bad_frame: stop at a damaged frame, or leave it out and say so.
        cache: folder for what the detectors see; else the user's cache folder.
        resume: a checkpoint to go on from, or the word last for that of the folder.
        out: folder of the results.
    """
    trainer = trainer_config(
        epochs=epochs, accelerator="cpu", seed=seed, monitor="validation/explained"
    )
    place = TrainingFolder.of_flags(out, resume)
    data = FusionDataConfig(
        tuple(drives),
        as_path_tuple(validation),
        validation_fraction,
        split,
        models,
        on_bad_frame,
        cache,
    )
    sizes = (hidden,) if isinstance(hidden, int) else hidden
    model = FusionModelConfig(variant, sizes, optimiser, tuple(sweep), tuple(sweep_two))
    found = split_detections(data, seed)
    trained = run_training(data, model, found, trainer, place)
    network, frames = Fusion(trained.file), found.judged
    fused = fuse_frames(frames.scenes, network)
    curves = curves_beside(frames, fused)
    draw_rescoring(out / "rescoring.png", frames, network)
    draw_steps(out / "steps.png", frames, fused)
    reliability = draw_reliability(out / "reliability.png", frames, fused, found.class_names)
    if trained.swept:
        draw_sizes(out / "sizes.png", trained.swept)
    document = {
        "trained": trained,
        "judged_ap_percent": _averages(curves),
        "expected_calibration_error": {
            name: one.expected_calibration_error for name, one in reliability.items()
        },
        "reliability": reliability,
    }
    write_json(out / "figures.json", document)
    print(
        f"{metrics_table(trained, len(frames), curves)}\n\n{trained.file}\n{out / 'figures.json'}"
    )


def metrics_table(
    trained: TrainedFusion, frames: int, curves: Mapping[str, Mapping[str, PrecisionCurve]]
) -> str:
    """Return average precision of each modality and of the fusion as a table."""
    names = [one.name for one in DIFFICULTIES]
    rows: list[list[Cell]] = [
        [name, *(f"{found[d]:.2f}" if d in found else None for d in names)]
        for name, found in _averages(curves).items()
    ]
    title = (
        f"Fusion, {trained.metadata['variant']}, {trained.metadata['hidden']} neurons, mean square error "
        f"{trained.fitted.validation:.4f}: AP in percent on {frames} other frames"
    )
    return format_table(title, ("Car, IoU over 0.7", *names), rows)


def _averages(curves: Mapping[str, Mapping[str, PrecisionCurve]]) -> dict[str, dict[str, float]]:
    return {
        name: {difficulty: curve.ap() for difficulty, curve in found.items()}
        for name, found in curves.items()
    }
