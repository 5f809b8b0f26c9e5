"""`trifuse evaluate fusion`: what three detectors come to alone and together (Table 7.10)."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from data.array_store import ArrayStore
from data.detections.cached_detections import FingerprintedDetector, detected_scene
from perception.cli.evaluations.class_precision import PROTOCOL_WORDS, MetricConfig
from perception.cli.evaluations.document import Evaluation, write_evaluation
from perception.cli.evaluations.fusion_figures import fusion_panels, fusion_results, fusion_tables
from perception.cli.evaluations.fusion_measure import MeasuredFusion, measure_fusion
from perception.cli.evaluations.fusion_steps import FusionFiles
from perception.cli.evaluations.labelled_drives import detect_drive, drive_sources, open_labelled
from perception.cli.evaluations.measure_flags import DetectionEvaluationConfig
from perception.detection.fusion.detected_scene import DetectedScene
from perception.evaluation.detection.protocol import DIFFICULTIES, kitti_class
from perception.render.curve_plots import plot_curves
from perception.render.fusion_plots import plot_reliability
from perception.types import Drive, Frame

_OWN_WORDS = {
    "gain": (
        "average precision of a row less that of the best single modality; its interval is of the same "
        "choices of frames for both, each with the best modality of that choice"
    ),
    "calibration": (
        "detections in ten bins of score; expected calibration error is the mean difference of score and "
        "share that is right, of all labelled objects, at the first IoU"
    ),
    "thesis": "Table 7.10: 1496 frames of KITTI's training set, YOLOv2 at 416x416, 11 recall points",
}


def fusion(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    models: FusionFiles | None = None,
    class_name: str = "Car",
    bootstrap: int = 1000,
    cache: Path | None = None,
    plot: Path | None = None,
    reliability_plot: Path | None = None,
    json: Path | None = None,
    **flags: Any,  # noqa: ANN401 - fields of DetectionEvaluationConfig
) -> None:
    """Measure three detectors alone, merged and fused, and with modalities lost (Table 7.10).

    The detectors run once, and what they see is kept; every row rests on the same detections. Each drive
    has its own tables.

    Example: trifuse evaluate fusion synth/test kitti/object --plot fusion.png --json fusion.json

    Args:
        drives: object folder, tracking folder or synthetic drive; one or several.
        models: networks in the place of those that ship; --models.rgb FILE.onnx for one of them.
        class_name: what is looked for.
        bootstrap: so many choices of frames give intervals; 0 for none.
        cache: folder for what the detectors see; else the user's cache folder.
        plot: gets the precision-recall curves of the first drive as PNG, and those of Fig. 7.14.
        reliability_plot: gets how often detections of a score are right, as PNG.
        json: gets the same figures with protocol, data and configuration.
        flags: as DetectionEvaluationConfig says.
    """
    evaluation_config = DetectionEvaluationConfig(bootstrap=bootstrap, **flags)
    reading, measuring = evaluation_config.reading, evaluation_config.measuring
    files = models or FusionFiles()
    detector = files.open_detectors()
    fusions = files.open_fusions(detector)
    fingerprinted, store = FingerprintedDetector(detector, files.fingerprint()), ArrayStore(cache)
    measured: list[MeasuredFusion] = []
    for source in drive_sources(drives, reading.sequence):
        drive = open_labelled(source, reading)
        detected = detect_drive(
            source.name, drive, _SceneOfFrame(drive, fingerprinted, store), reading
        )
        measured.append(measure_fusion(detected, fusions, kitti_class(class_name), measuring))
        print(fusion_tables(measured[-1]))
    first = measured[0]
    if plot is not None:
        plot_curves(plot, f"{first.data.name} ({first.data.kind})", fusion_panels(first))
    if reliability_plot is not None:
        title = f"{first.data.name} ({first.data.kind}), IoU over {measuring.iou_thresholds[0]:g}"
        plot_reliability(reliability_plot, title, first.reliability)
    if json is not None:
        metadata = {str(name): one.metadata for name, one in detector.detectors.items()}
        metadata |= {str(name): one.metadata for name, one in fusions.items()}
        _write(json, measured, {"models": files, "networks": metadata}, measuring)


def _write(
    path: Path,
    measured: Sequence[MeasuredFusion],
    configuration: Mapping[str, Any],
    measuring: MetricConfig,
) -> None:
    """Write all figures with what they rest on."""
    values = {"difficulties": DIFFICULTIES, **asdict(measuring)}
    words = {**PROTOCOL_WORDS, **_OWN_WORDS, "values": values}
    metrics = Evaluation("fusion", words, {one.data.name: fusion_results(one) for one in measured})
    split = "; ".join(
        f"{name} was trained on: {of_one.get('training_data', 'not known')}"
        for name, of_one in configuration["networks"].items()
    )
    data = [one.data for one in measured]
    write_evaluation(path, data, configuration, metrics, split)


@dataclass(frozen=True)
class _SceneOfFrame:
    """Returns what detectors see in the frames of a drive, each looked at once for all times."""

    drive: Drive
    detectors: FingerprintedDetector
    store: ArrayStore

    def __call__(self, frame: Frame) -> DetectedScene:
        return detected_scene(self.drive, frame.index, self.detectors, self.store)
