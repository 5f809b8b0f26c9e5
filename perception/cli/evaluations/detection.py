"""`trifuse evaluate detection`: result files of any detector against labels, by KITTI's 2D protocol."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from data.kitti.detection_rows import DetectionSet, read_detection_set, read_frame_list
from perception.cli.evaluations.detection_figures import (
    CONFIDENCE,
    DetectionReport,
    detection_panels,
    detection_results,
    detection_table,
)
from perception.cli.evaluations.document import Evaluation, write_evaluation
from perception.cli.progress import frame_progress_bar, progress_bar
from perception.errors import UsageError
from perception.evaluation.detection.average_precision import match_detections
from perception.evaluation.detection.bootstrap import PrecisionSamples, resample_precision
from perception.evaluation.detection.precision_curve import RecallPoints
from perception.evaluation.detection.protocol import DIFFICULTIES, KITTI_CLASSES, DetectionClass
from perception.render.curve_plots import plot_curves

RecallOption = Literal["11", "40", "both"]

_AVERAGED: dict[RecallOption, tuple[RecallPoints, ...]] = {
    "11": (11,),
    "40": (40,),
    "both": (11, 40),
}
_SPLIT = "the frames counted under data; what the detector was trained on is not known here"
DETECTION_PROTOCOL = {
    "name": "KITTI object benchmark, boxes in the image",
    "similarity": "intersection over union, areas without + 1 pixel, above the class' own",
    "truths": (
        "of the class, as high, free and whole as the difficulty asks; the others of the class and those "
        "of a neighbour are neither missed nor found"
    ),
    "detections": (
        "lower ones than the difficulty asks are ignored, of whatever class; unmatched ones with more "
        "than the IoU's share in one DontCare region are not wrong"
    ),
    "precision": "at up to 41 scores of found truths, each the best of its own and all later ones",
    "averages": "R11: recall 0, 0.1 .. 1 (before October 2019); R40: recall 1/40 .. 1 (since then)",
    "intervals": "percentiles over frames drawn with replacement",
}


def detection(  # noqa: PLR0913 - flags of a command
    results: Path,
    *,
    labels: Path,
    frames_list: Path | None = None,
    classes: str | tuple[str, ...] = ("Car", "Pedestrian", "Cyclist"),
    iou: float | None = None,
    recall_points: RecallOption = "both",
    bootstrap: int = 0,
    seed: int = 0,
    plot: Path | None = None,
    json: Path | None = None,
) -> None:
    """Measure the result files of any detector by KITTI's 2D protocol: average precision, easy to hard.

    A result file that is empty or missing says that nothing was detected in its frame.

    Example: trifuse evaluate detection results/boxes --labels kitti/object --plot precision.png

    Args:
        results: a folder of 000000.txt with 16 columns each, the last the score.
        labels: a folder of 000000.txt, or the root of KITTI's object data.
        frames_list: a file of frame numbers, one a row; else all frames that have labels.
        classes: Car, Pedestrian, Cyclist, or with --iou any other; several as [Car,Van].
        iou: overlap that a detection must exceed; else KITTI's, 0.7 for Car and 0.5 for the others.
        recall_points: 11, 40 or both: over how many points precision is averaged.
        bootstrap: so many choices of frames give intervals; 0 for none.
        seed: of these choices.
        plot: gets the precision-recall curves as PNG.
        json: gets the same figures with protocol and data.
    """
    names = (classes,) if isinstance(classes, str) else classes
    chosen = tuple(_parse_class(name, iou) for name in names)
    numbers = None if frames_list is None else read_frame_list(frames_list)
    found = read_detection_set(results, labels, numbers, frame_progress_bar("reading"))
    resampling = BootstrapConfig(bootstrap, seed)
    report = measure_detections(found, chosen, _AVERAGED[recall_points], resampling)
    print(f"{_describe(results, found)}\n\n{detection_table(report)}")
    if plot is not None:
        title = f"{results}: {len(found.numbers)} frames"
        plot_curves(plot, title, detection_panels(report))
    if json is not None:
        data = DetectionsUsed(
            results=results.resolve(),
            labels=labels.resolve(),
            frames_list=frames_list and frames_list.resolve(),
            frames=len(found.numbers),
            frames_without_result=found.missing_results,
            detections=len(found.detections),
        )
        metrics = Evaluation("detection", _protocol(chosen, resampling), detection_results(report))
        write_evaluation(json, data, None, metrics, _SPLIT)


@dataclass(frozen=True)
class DetectionsUsed:
    """Which files the figures are of.

    Attributes:
        results: folder of the results.
        labels: folder of the labels.
        frames_list: that named the frames, if one did.
        frames: how many there are.
        frames_without_result: which of them have no result file, where nothing was detected.
        detections: rows of all classes.
    """

    results: Path
    labels: Path
    frames_list: Path | None
    frames: int
    frames_without_result: tuple[int, ...]
    detections: int


@dataclass(frozen=True)
class BootstrapConfig:
    """How intervals are found.

    Attributes:
        choices: of frames; 0 for no intervals.
        seed: of the choices.
    """

    choices: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse fewer choices than none."""
        if self.choices < 0:
            raise UsageError("--bootstrap", expected="0 or more", found=str(self.choices))


def measure_detections(
    found: DetectionSet,
    classes: tuple[DetectionClass, ...] = KITTI_CLASSES,
    recall_points: tuple[RecallPoints, ...] = (11, 40),
    resampling: BootstrapConfig = BootstrapConfig(),
) -> DetectionReport:
    """Match once, and measure all frames and what other choices of them would have given."""
    statistics = match_detections(found.truths, found.detections, len(found.numbers), classes)
    samples: tuple[dict[str, PrecisionSamples], ...] = ()
    if resampling.choices:
        generator = np.random.default_rng(resampling.seed)
        shown = partial(progress_bar, description="bootstrap", unit="choice", delay_s=2)
        samples = resample_precision(statistics, resampling.choices, generator, shown)
    return DetectionReport(statistics.metrics(), samples, recall_points)


def _protocol(classes: tuple[DetectionClass, ...], resampling: BootstrapConfig) -> dict[str, Any]:
    values = {
        "classes": classes,
        "difficulties": DIFFICULTIES,
        "resampling": resampling,
        "confidence": CONFIDENCE,
    }
    return {**DETECTION_PROTOCOL, "values": values}


def _parse_class(name: str, iou: float | None) -> DetectionClass:
    for known in KITTI_CLASSES:
        if known.name.lower() == name.lower():
            return known if iou is None else known.at_iou(iou)
    if iou is None:
        names = ", ".join(known.name for known in KITTI_CLASSES)
        raise UsageError(
            "--classes",
            expected=names,
            found=name,
            advice="name any other class together with --iou",
        )
    return DetectionClass(name, iou)


def _describe(results: Path, found: DetectionSet) -> str:
    """Name what was read, and what was not there."""
    lines = [f"{results}: {len(found.detections)} detections in {len(found.numbers)} frames"]
    if found.missing_results:
        lines.append(
            f"{len(found.missing_results)} frames have no result file, the first "
            f"{found.missing_results[0]:06d}: counted as nothing detected"
        )
    if found.extra_results:
        lines.append(
            f"{len(found.extra_results)} result files are of none of these frames, the first "
            f"{found.extra_results[0]:06d}: not read"
        )
    return "\n".join(lines)
