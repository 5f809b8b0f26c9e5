"""`trifuse evaluate tracks`: result files of any tracker against labels, by KITTI's 2D protocol."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from data.kitti.tracker_files import (
    TrackedSequenceFiles,
    label_folder,
    pair_with_labels,
    sequences_in,
)
from perception.cli.evaluations.document import Evaluation, write_evaluation
from perception.cli.evaluations.mot_results import mot_results, mot_table
from perception.cli.progress import progress_bar
from perception.errors import UsageError
from perception.evaluation.config import KittiTrackingConfig
from perception.evaluation.multi_object.hota import ALPHAS
from perception.evaluation.multi_object.kitti_protocol import NEIGHBOURS, KittiClass, kitti_frames
from perception.evaluation.multi_object.mot_metrics import MotMetrics, evaluate_tracks

_COMBINED = "COMBINED"
_SPLIT = "the sequences named under data; what the tracker was trained on is not known here"
_PROTOCOL_WORDS = {
    "name": "KITTI tracking benchmark, boxes in the image",
    "similarity": "intersection over union, areas without + 1 pixel",
    "HOTA": "mean over the thresholds alphas, matched once for all of them",
    "CLEAR and identity": "at the threshold",
    "left out": (
        "labels of a neighbour class, truncated or occluded beyond the rules, and the answers matched to "
        "them; unmatched answers that are too low or mostly in one DontCare region; rows with an id "
        "below 0; scores are not read"
    ),
    "neighbours": NEIGHBOURS,
    _COMBINED: "counts and sums over all sequences, not a mean of their ratios",
}


def tracks(
    results: Path,
    *,
    labels: Path,
    classes: str = "car,pedestrian",
    seqmap: Path | None = None,
    json: Path | None = None,
) -> None:
    """Measure the result files of any tracker by KITTI's 2D protocol: HOTA, CLEAR and identity.

    Without a seqmap, the sequences are those that have a result file, and each ends with the last row
    of its labels or results.

    Example: trifuse evaluate tracks results/tracks --labels kitti/tracking --json tracks.json

    Args:
        results: a folder of SSSS.txt with 18 columns each; an empty file says that nothing was found.
        labels: a folder of SSSS.txt, or the root of KITTI's tracking data.
        classes: which of car, pedestrian and cyclist, with commas between.
        seqmap: a file that names the sequences and their numbers of frames.
        json: gets the same figures with protocol and data.
    """
    folder, chosen = label_folder(labels), _parse_classes(classes)
    report = measure_tracks(pair_with_labels(results, folder, seqmap), chosen)
    print(
        f"{results}: {len(report.frame_counts)} of {len(sequences_in(folder))} labelled sequences, "
        f"{sum(report.frame_counts.values())} frames\n\n{tracks_tables(report)}"
    )
    if json is not None:
        data = TrackFilesInfo(
            results.resolve(), folder.resolve(), seqmap and seqmap.resolve(), report.frame_counts
        )
        evaluation = Evaluation("tracks", _protocol(report), tracks_results(report))
        write_evaluation(json, data, {"classes": chosen}, evaluation, _SPLIT)


@dataclass(frozen=True)
class TrackFilesInfo:
    """Which files the figures are of.

    Attributes:
        results: folder of the results.
        labels: folder of the labels.
        seqmap: that named the sequences, if one did.
        frames: of each sequence.
    """

    results: Path
    labels: Path
    seqmap: Path | None
    frames: dict[str, int]


@dataclass(frozen=True)
class TracksReport:
    """What the tracks of all sequences are worth.

    Attributes:
        frame_counts: of each sequence.
        by_class: scores by class, then by sequence.
        config: of the benchmark.
        threshold: of CLEAR and identity.
    """

    frame_counts: dict[str, int]
    by_class: dict[str, dict[str, MotMetrics]]
    config: KittiTrackingConfig
    threshold: float

    def combined(self, class_name: str) -> MotMetrics:
        """Return the scores of all sequences together."""
        return sum(self.by_class[class_name].values(), MotMetrics())


def measure_tracks(
    sequences: Sequence[TrackedSequenceFiles],
    classes: Sequence[KittiClass],
    config: KittiTrackingConfig | None = None,
) -> TracksReport:
    """Read and measure sequence after sequence.

    Raises:
        LabelError: a file cannot be used.
    """
    config, frame_counts = config or KittiTrackingConfig(), {}
    by_class: dict[str, dict[str, MotMetrics]] = {name: {} for name in classes}
    for files in progress_bar(sequences, "tracks", unit="sequence", delay_s=2):
        rows = files.read()
        frame_counts[files.name] = rows.frame_count
        for name in classes:
            frames = kitti_frames(rows.labels, rows.results, name, rows.frame_count, config)
            by_class[name][files.name] = evaluate_tracks(frames, config.min_iou)
    return TracksReport(frame_counts, by_class, config, config.min_iou)


def tracks_tables(report: TracksReport) -> str:
    """Return a table for each class."""
    return "\n\n".join(
        mot_table(
            f"{name}: KITTI 2D boxes, CLEAR and identity at IoU {report.threshold:g}; ratios in percent",
            {**by_sequence, _COMBINED: report.combined(name)},
        )
        for name, by_sequence in report.by_class.items()
    )


def tracks_results(report: TracksReport) -> dict[str, dict[str, Any]]:
    """Return the figures for programs: by sequence and COMBINED, then by class."""
    results: dict[str, dict[str, Any]] = {
        sequence: {
            name: mot_results(by_sequence[sequence])
            for name, by_sequence in report.by_class.items()
        }
        for sequence in report.frame_counts
    }
    results[_COMBINED] = {name: mot_results(report.combined(name)) for name in report.by_class}
    return results


def _parse_classes(words: str) -> list[KittiClass]:
    """Split names at commas, each taken once."""
    requested = {word.strip().lower() for word in words.split(",")}
    if not requested <= set(NEIGHBOURS):
        known = ", ".join(NEIGHBOURS)
        raise UsageError("--classes", expected=f"some of {known}, with commas", found=repr(words))
    return [name for name in NEIGHBOURS if name in requested]


def _protocol(report: TracksReport) -> dict[str, Any]:
    values = {"rules": report.config, "threshold": report.threshold, "alphas": ALPHAS}
    return {**_PROTOCOL_WORDS, "values": values}
