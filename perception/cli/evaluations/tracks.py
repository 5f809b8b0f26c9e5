"""`trifuse evaluate tracks`: result files of any tracker against labels, by KITTI's 2D protocol."""

from dataclasses import dataclass
from pathlib import Path

from data.kitti.tracker_files import label_folder, pair_with_labels, sequences_in
from perception.cli.evaluation import EvaluationDocument, publish_report
from perception.cli.progress import progress_bar
from perception.errors import UsageError
from perception.evaluation.multi_object.kitti_protocol import NEIGHBOURS, KittiClass
from perception.evaluation.tracking_measure import TrackingMeasure

_SPLIT = "the sequences named under data; what the tracker was trained on is not known here"


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
    measure = TrackingMeasure(chosen)
    for files in progress_bar(
        pair_with_labels(results, folder, seqmap), "tracks", unit="sequence", delay_s=2
    ):
        rows = files.read()
        measure.update(files.name, rows.labels, rows.results, rows.frame_count)
    report = measure.compute()
    publish_report(
        f"{results}: {len(report.frame_counts)} of {len(sequences_in(folder))} labelled sequences, "
        f"{report.frames} frames",
        report,
        EvaluationDocument(
            "tracks",
            TrackFilesInfo(
                results.resolve(),
                folder.resolve(),
                seqmap and seqmap.resolve(),
                report.frame_counts,
            ),
            report.protocol(),
            {"classes": chosen},
            _SPLIT,
        ),
        json,
    )


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


def _parse_classes(words: str) -> list[KittiClass]:
    """Split names at commas, each taken once."""
    requested = {word.strip().lower() for word in words.split(",")}
    if not requested <= set(NEIGHBOURS):
        known = ", ".join(NEIGHBOURS)
        raise UsageError("--classes", expected=f"some of {known}, with commas", found=repr(words))
    return [name for name in NEIGHBOURS if name in requested]
