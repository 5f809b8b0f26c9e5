"""`trifuse evaluate robustness`: average precision under sensor corruptions."""

from dataclasses import dataclass
from pathlib import Path

from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluationDocument
from perception.cli.evaluate_detection import PrecisionFlags
from perception.cli.flags import LabelledDriveFlags, ReportFlags
from perception.detection.config import DetectionConfig
from perception.evaluation.detection.config import CorruptionLevels
from perception.evaluation.detection.protocol import kitti_class

_DETECTION, _LEVELS = DetectionConfig(), CorruptionLevels()


@dataclass(frozen=True)
class CorruptionPrecisionFlags(PrecisionFlags):
    """Metric.

    Attributes:
        iou: IoU that a detection must exceed to match an object, several with commas; the tables show the first.
        seed: Seed of the corruptions and of the resamples.
    """

    iou: tuple[float, ...] = (0.7,)
    bootstrap: int = 0


def evaluate_robustness(
    root: Path,
    *,
    drive: LabelledDriveFlags,
    metric: CorruptionPrecisionFlags,
    report: ReportFlags,
    config: CommandConfig,
    class_name: str = "Car",
    plot: Path | None = None,
    faults: tuple[str, ...] = (),
    runs: Path | None = None,
    levels: CorruptionLevels = _LEVELS,
    detection: DetectionConfig = _DETECTION,
) -> None:
    """Measure detectors and fusion under sensor corruptions, or all stages under faults that begin in the drive.

    Corruptions are darkness, point dropout and calibration errors of single frames. With --faults the whole pipeline
    runs over the drive once for each fault and size: ground, moving points, detections and tracks.

    Example: trifuse evaluate robustness kitti/object --levels.darkness 2,4,6 --plot robustness.png

    Args:
        root: Object folder, tracking folder with --sequence, or synthetic drive.
        class_name: Class to measure.
        plot: PNG file for average precision over the levels, or the metrics over the sizes of the faults.
        faults: Kinds of faults for all stages, such as camera-dark,lidar-fog:0.1, or all; without a size all sizes.
        runs: JSON file that keeps the metrics of each finished run with a fault; the same command goes on from it.
        levels: Levels of each corruption.
        detection: Detectors: networks and suppression.
    """
    reader = drive.reader()
    if faults:
        from data.faults.fault_runs import FaultRuns

        # Further kinds go on from the file of those before.
        values = {name: value for name, value in config.values.items() if name != "faults"}
        opened = reader.open(root, images=True)
        fault_runs = FaultRuns(opened, reader, detection, metric.seed)
        costs, document, heading = fault_runs.measure(faults, values, runs)
        report.publish(heading, costs, document, config)
        title, panels = f"{opened.name}: cost of faults", costs.panels()
    else:
        from data.detections.corrupted_drive import measure_corruptions

        classes = [kitti_class(class_name)]
        measured, networks = measure_corruptions(root, reader, classes, metric, levels, detection)
        document = EvaluationDocument.of_networks(
            "robustness", measured.data, metric.protocol(levels=levels), networks
        )
        heading = f"{class_name}, IoU over {metric.iou[0]:g}"
        report.publish(f"{heading}\n{measured.seen_in_training}", measured, document, config)
        info, robustness = measured.drives[0]
        title, panels = f"{info.title}, {heading}", robustness.panels()
    if plot is not None:
        from perception.render.curve_plots import plot_curves

        plot_curves(plot, title, panels, columns=4, share_y="all")
