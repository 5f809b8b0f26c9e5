"""`trifuse evaluate depthcn`: DepthCN on labelled drives, by KITTI's measure of boxes in the image."""

from pathlib import Path
from typing import Any

from perception.cli.evaluations.class_precision import PROTOCOL_WORDS, ClassPrecision, MetricConfig
from perception.cli.evaluations.depthcn_figures import (
    DepthCnMetrics,
    depthcn_panels,
    depthcn_results,
    depthcn_table,
)
from perception.cli.evaluations.depthcn_steps import DetectedCars, detect_cars
from perception.cli.evaluations.document import Evaluation, write_evaluation
from perception.cli.evaluations.labelled_drives import drive_sources, open_labelled
from perception.cli.evaluations.measure_flags import DetectionEvaluationConfig
from perception.cli.vehicle_detector import DepthCnConfig
from perception.detection.config import ProposalConfig
from perception.detection.depthcn.verifier import VEHICLE
from perception.evaluation.detection.proposal_recall import proposal_recall
from perception.evaluation.detection.protocol import DIFFICULTIES, KITTI_CLASSES
from perception.render.curve_plots import plot_curves
from perception.types import Method

_CAR = next(known for known in KITTI_CLASSES if known.name == VEHICLE)
_OWN_WORDS = {
    "proposals": "objects whose box some proposal's own box overlaps by the IoU, before verification",
    "thesis": "Table 7.9: the server's test set, whose labels are not public; other frames, other labels",
}


def depthcn(
    drives: list[Path],
    *,
    method: Method = "default",
    model: Path | None = None,
    rules: ProposalConfig | None = None,
    plot: Path | None = None,
    json: Path | None = None,
    **flags: Any,  # noqa: ANN401 - fields of DetectionEvaluationConfig
) -> None:
    """Detect cars by DepthCN in labelled drives and measure them by KITTI's 2D protocol.

    Each drive has its own figures: what was synthesised and what was recorded never share one.

    Example: trifuse evaluate depthcn synth/test kitti/object --bootstrap 1000 --plot precision.png

    Args:
        drives: object folder, tracking folder or synthetic drive; one or several.
        method: default, or thesis for its own network, of which --model has to name a file.
        model: a network that you trained and exported; goes before method.
        rules: how proposals are found; --rules.radius_m 0.6 for one of them.
        plot: gets the precision-recall curves as PNG.
        json: gets the same figures with protocol, data and configuration.
        flags: as DetectionEvaluationConfig says.
    """
    evaluation_config = DetectionEvaluationConfig(**flags)
    reading, measuring = evaluation_config.reading, evaluation_config.measuring
    detector_config = DepthCnConfig(method, model, rules)
    measured, metadata = [], {}
    for source in drive_sources(drives, reading.sequence):
        drive = open_labelled(source, reading)
        detector = detector_config.open(drive.sensor)
        metadata = dict(detector.metadata)
        found = detect_cars(source.name, drive, detector, reading)
        measured.append(measure_cars(found, measuring))
    print(depthcn_table(measured))
    if plot is not None:
        plot_curves(plot, f"DepthCN, {metadata.get('method', 'default')}", depthcn_panels(measured))
    if json is not None:
        configuration = {"detector": detector_config, "network": metadata}
        words = {**PROTOCOL_WORDS, **_OWN_WORDS}
        values = {"difficulties": DIFFICULTIES, **vars(measuring)}
        metrics = Evaluation("depthcn", {**words, "values": values}, depthcn_results(measured))
        split = f"the network was trained on: {metadata.get('training_data', 'not known')}"
        write_evaluation(json, [one.found.data for one in measured], configuration, metrics, split)


def measure_cars(found: DetectedCars, rules: MetricConfig) -> DepthCnMetrics:
    """Measure detections at every overlap, and what their proposals reach."""
    frames = found.data.frames_evaluated
    recall = proposal_recall(
        found.boxes.truths, found.proposals, frames, VEHICLE, rules.iou_thresholds
    )
    return DepthCnMetrics(found, ClassPrecision.of(found.boxes, _CAR, rules), recall)
