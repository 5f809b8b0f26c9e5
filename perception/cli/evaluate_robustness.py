"""`trifuse evaluate robustness`: average precision under sensor corruptions."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from perception.cli.evaluate_detection import (
    DriveReport,
    DriveSource,
    DrivesReport,
    PrecisionFlags,
    feed_measure,
)
from perception.cli.evaluation import EvaluationDocument, publish_report
from perception.cli.flags import DriveFlags, ReportFlags
from perception.detection.config import DetectionConfig
from perception.errors import UsageError
from perception.evaluation.detection.config import CorruptionLevels
from perception.evaluation.detection.protocol import DIFFICULTIES, kitti_class

if TYPE_CHECKING:
    from perception.evaluation.detection.robustness_measure import Corruption

_DETECTION, _LEVELS = DetectionConfig(), CorruptionLevels()
_PROTOCOL = {
    "darkness": (
        "half the light a stop, without gain to compensate, with shot and read noise: 10,000 electrons are "
        "white, read noise is 5 electrons"
    ),
    "point dropout": "LiDAR points are dropped independently with equal probability",
    "calibration": (
        "the scan is projected by a calibration that is rotated about a random axis through the camera, or shifted in "
        "a random direction of the image; labels stay"
    ),
}


@dataclass(frozen=True)
class CorruptionPrecisionFlags(PrecisionFlags):
    """Metric.

    Attributes:
        iou: IoU that a detection must exceed to match an object, several with commas; the tables show the first.
        recall_points: Number of recall points over which precision is averaged: 40 or 11.
        bootstrap: Number of bootstrap resamples of the frames for 95 % intervals; 0 for none.
        seed: Seed of the corruptions and of the resamples.
    """

    iou: tuple[float, ...] = (0.7,)


def evaluate_robustness(  # noqa: PLR0913 - flags of a command
    root: Path,
    *,
    drive: DriveFlags,
    metric: CorruptionPrecisionFlags,
    report: ReportFlags,
    class_name: str = "Car",
    plot: Path | None = None,
    levels: CorruptionLevels = _LEVELS,
    detection: DetectionConfig = _DETECTION,
) -> None:
    """Measure detectors and fusion under sensor corruptions: darkness, point dropout, calibration errors.

    Example: trifuse evaluate robustness kitti/object --levels.darkness 2,4,6 --plot robustness.png

    Args:
        root: Object folder, tracking folder with --sequence, or synthetic drive.
        class_name: Class to measure.
        plot: PNG file for average precision over the levels.
        levels: Levels of each corruption.
        detection: Detectors: networks and suppression.
    """
    from perception.cli.detectors import open_fusions, open_modalities
    from perception.evaluation.detection.class_precision import PROTOCOL
    from perception.evaluation.detection.robustness_measure import (
        CorruptedDetector,
        RobustnessMeasure,
    )

    source = DriveSource(root, drive.sequence)
    frames = source.open(drive)
    corruptions = _corruptions(levels, has_images=frames.has_images)
    detector = open_modalities(detection)
    fusion = open_fusions(detection, (), detector)["default"]
    measure = RobustnessMeasure(
        [kitti_class(class_name)], metric, corruptions=corruptions, fusion=fusion
    )
    corrupted = CorruptedDetector(detector, corruptions, metric.seed)
    data = feed_measure(source, frames, drive, corrupted.detect, measure)
    computed = measure.compute()
    networks = {str(name): dict(one.metadata) for name, one in detector.detectors.items()}
    document = EvaluationDocument(
        "robustness",
        data,
        {
            **PROTOCOL,
            **_PROTOCOL,
            "values": {"difficulties": DIFFICULTIES, "levels": levels, **asdict(metric)},
        },
        {"detection": detection, "networks": networks},
    )
    heading = f"{class_name}, IoU over {metric.iou[0]:g}"
    publish_report(heading, DrivesReport([DriveReport(data, computed)]), document, report.json)
    if plot is not None:
        from perception.render.curve_plots import plot_curves

        title, panels = f"{data.title}, {heading}", computed.panels()
        plot_curves(plot, title, panels, columns=len(panels), share_y="all")


def _corruptions(levels: CorruptionLevels, *, has_images: bool) -> "list[Corruption]":
    """Return the corruptions that have levels; darkness only of drives with images.

    Raises:
        UsageError: there is none.
    """
    from data.corruptions import darken, drop_points, rotate_calibration, shift_calibration
    from perception.evaluation.detection.robustness_measure import Corruption

    darkness = levels.darkness if has_images else ()
    known = (
        Corruption("darkness of the camera [stops]", darken, ("rgb",), darkness),
        Corruption("LiDAR point dropout [share]", drop_points, ("dm", "rm"), levels.point_dropout),
        Corruption(
            "calibration rotated [degrees]", rotate_calibration, ("dm", "rm"), levels.rotation
        ),
        Corruption("calibration shifted [pixels]", shift_calibration, ("dm", "rm"), levels.shift),
    )
    used = [one for one in known if one.levels]
    if not used:
        raise UsageError("--levels", expected="levels of one corruption or more", found="none")
    return used
