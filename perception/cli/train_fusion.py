"""`trifuse train fusion`: the network that rescores detections of three modalities together (6.2.4)."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from data.detections.config import DetectorModelPaths, FusionDataConfig
from perception.cli.parser import defaults_by
from perception.cli.training import TrainingFlags, import_trainer
from perception.detection.config import FusionVariant
from perception.evaluation.report import Column, Table
from train.config import TrainerConfig
from train.fusion.config import FUSION_VARIANTS, FusionFitConfig

if TYPE_CHECKING:
    from export.trained_fusion import TrainedFusion
    from perception.evaluation.detection.precision_curve import PrecisionCurve

Curves = Mapping[str, Mapping[str, "PrecisionCurve"]]

_MODELS, _DATA, _FIT, _TRAINER = (
    DetectorModelPaths(),
    FusionDataConfig(),
    FUSION_VARIANTS["default"],
    TrainerConfig(accelerator="cpu"),
)


@defaults_by("variant", {name: {"fit": one} for name, one in FUSION_VARIANTS.items()})
def train_fusion(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    training: TrainingFlags,
    variant: FusionVariant = "default",
    epochs: int = 4,
    sweep: tuple[int, ...] = (),
    sweep_two: tuple[int, ...] = (),
    out: Path = Path("results") / "fusion",
    models: DetectorModelPaths = _MODELS,
    data: FusionDataConfig = _DATA,
    fit: FusionFitConfig = _FIT,
) -> None:
    """Fit the fusion to drives that no detector was trained on; watch it with: tensorboard --logdir OUT.

    The detectors run once on every frame; their detections are cached. It writes fusion.onnx, best.ckpt, last.ckpt to
    resume from, config.yaml, metrics.json, and plots: rescoring.png (Fig. 7.12), steps.png (7.14), reliability.png, and
    with a sweep sizes.png (7.13).

    Example: trifuse train fusion synth/fusion --variant features --sweep 5,10,20,40 --out results/fusion

    Args:
        drives: Labelled drives of any layout; of a folder of several, all are taken.
        variant: Features and defaults of the fit: default, with distances, overlaps and missing detectors;
            features or scores, as in the thesis.
        epochs: Number of epochs of AdamW; more fit synthetic drives better, and real ones worse.
        sweep: Numbers of neurons of one hidden layer to try; the best of all sizes is taken.
        sweep_two: Numbers of neurons of two hidden layers, of which all falling pairs are tried.
        out: Folder of the results.
        models: Model files of the detectors; else those that ship.
        data: Split and cache.
        fit: Hidden layers, and how they are fitted.
    """
    from data.detections.fused_frames import curves_by_detector, fuse_frames
    from data.results.documents import write_json
    from perception.cli.progress import frame_progress_bar, progress_bar
    from perception.detection.fusion.rescoring import Fusion

    trainer = import_trainer("export.trained_fusion")
    plots = import_trainer("train.fusion.plots")
    trained, detections = trainer.run_experiment(
        trainer.FusionExperiment(
            training.drives(drives), fit.training(variant), models, data, sweep, sweep_two
        ),
        training.run(epochs, _TRAINER),
        out,
        training.resume,
        frame_progress_bar("detections"),
        partial(progress_bar, description="sizes", unit="network", delay_s=2),
    )
    network, frames = Fusion(trained.file), detections.test
    fused = fuse_frames(frames.scenes, network)
    curves = curves_by_detector(frames, fused)
    plots.plot_fusion_rescoring(out / "rescoring.png", frames, network)
    plots.plot_fusion_steps(out / "steps.png", frames, fused)
    reliability = plots.plot_fusion_reliability(
        out / "reliability.png", frames, fused, detections.class_names
    )
    if trained.swept:
        plots.plot_fusion_sizes(out / "sizes.png", trained.swept)
    table = precision_table(trained, len(frames), curves)
    document = {
        "trained": trained,
        "test_ap_percent": table.to_json(),
        "expected_calibration_error": {
            name: one.expected_calibration_error for name, one in reliability.items()
        },
        "reliability": reliability,
    }
    write_json(out / "metrics.json", document)
    print(f"{table.text()}\n\n{trained.file}\n{out / 'metrics.json'}")


def precision_table(
    trained: "TrainedFusion", frames: int, curves: Curves
) -> Table[Mapping[str, float]]:
    """Return average precision of each modality and of the fusion as a table."""
    from perception.evaluation.detection.protocol import DIFFICULTIES

    rows = {
        name: {difficulty: curve.ap() for difficulty, curve in found.items()}
        for name, found in curves.items()
    }
    columns = [
        Column[Mapping[str, float]](name, lambda row, name=name: row.get(name), ".2f", name)  # type: ignore[misc]
        for name in (level.name for level in DIFFICULTIES)
    ]
    title = (
        f"Fusion, {trained.metadata['variant']}, {trained.metadata['hidden']} neurons, mean square error "
        f"{trained.fitted.validation:.4f}: AP [%] on {frames} test frames"
    )
    return Table(title, columns, rows, heading="Car, min IoU 0.7")
