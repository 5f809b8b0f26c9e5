"""`trifuse evaluate detector`: a detector of one modality on labelled drives, by KITTI's measure."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from perception.cli.evaluations.class_precision import PROTOCOL_WORDS
from perception.cli.evaluations.detector_figures import (
    detector_panels,
    detector_results,
    detector_table,
)
from perception.cli.evaluations.detector_pictures import draw_worst_frames
from perception.cli.evaluations.detector_steps import measure_detector, open_detector, parse_classes
from perception.cli.evaluations.document import Evaluation, write_evaluation
from perception.cli.evaluations.labelled_drives import drive_sources, open_labelled
from perception.cli.evaluations.measure_flags import DetectionEvaluationConfig
from perception.errors import UsageError
from perception.evaluation.detection.protocol import DIFFICULTIES
from perception.render.curve_plots import plot_curves
from perception.types import Modality


def detector(  # noqa: PLR0913 - flags of a command
    drives: list[Path],
    *,
    model: Modality | Path,
    classes: str | tuple[str, ...] | None = None,
    pictures: Path | None = None,
    worst: int = 12,
    plot: Path | None = None,
    json: Path | None = None,
    **flags: Any,  # noqa: ANN401 - fields of DetectionEvaluationConfig
) -> None:
    """Detect by the network of one modality in labelled drives and measure it by KITTI's 2D protocol.

    Each drive has its own figures: what was synthesised and what was recorded never share one.

    Example: trifuse evaluate detector synth/test kitti/object --model rm --bootstrap 1000 --plot rm.png

    Args:
        drives: object folder, tracking folder or synthetic drive; one or several.
        model: an ONNX file, or rgb, dm or rm for the network that ships.
        classes: of those that the network knows; several as [Car,Van]; else all.
        pictures: folder for the frames with most mistakes, drawn.
        worst: how many of each drive and class are drawn.
        plot: gets the precision-recall curves as PNG.
        json: gets the same figures with protocol, data and configuration.
        flags: as DetectionEvaluationConfig says.
    """
    if worst < 1:
        raise UsageError("--worst", expected="at least 1", found=str(worst))
    evaluation_config = DetectionEvaluationConfig(**flags)
    reading, measuring = evaluation_config.reading, evaluation_config.measuring
    network = open_detector(model)
    target_classes = parse_classes(network, classes)
    measured = []
    for source in drive_sources(drives, reading.sequence):
        drive = open_labelled(source, reading)
        one = measure_detector(source.name, drive, network, target_classes, reading, measuring)
        measured.append(one)
        if pictures is not None:
            draw_worst_frames(pictures, drive, network, one, worst)
    title = f"{network.model.name}: {network.modality}, {network.size.height_px}x{network.size.width_px}"
    print(detector_table(title, measured))
    if plot is not None:
        plot_curves(plot, title, detector_panels(measured))
    if json is not None:
        metadata = dict(network.metadata)
        values = {"difficulties": DIFFICULTIES, **asdict(measuring)}
        metrics = Evaluation(
            "detector", {**PROTOCOL_WORDS, "values": values}, detector_results(measured)
        )
        split = f"the network was trained on: {metadata.get('training_data', 'not known')}"
        configuration = {"model": network.model.name, "network": metadata}
        write_evaluation(
            json, [one.detected.data for one in measured], configuration, metrics, split
        )
