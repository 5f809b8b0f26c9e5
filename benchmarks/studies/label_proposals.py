"""Proposals of labels beside those of people: which are right, and how much is left for a person to do."""

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.report import RESULTS, publish
from data.label_proposals.config import ProposedLabelConfig
from perception.cli.flags import DriveFlags, require_positive
from perception.cli.parser import FlagGroup
from perception.evaluation.nuscenes.protocol import CLASSES
from perception.evaluation.report import Metric, Metrics, Table
from perception.geometry.box_overlap import center_distances_m, iou_bev
from perception.pipeline import PipelineConfig
from perception.render.curve_plots import Curve, CurvePanel, plot_curves
from perception.types import ArrayTable, Bool, Boxes3D, Float64, Int

if TYPE_CHECKING:
    from data.label_proposals.proposals import ProposalFile
    from data.nuscenes.samples import Sample
    from data.recorded_drive import RecordedDrive
    from perception.evaluation.nuscenes.boxes import TaskDetections

_PIPELINE = PipelineConfig()
_MARGIN_M = 0.1  # by which labels are grown where their returns are counted
_RANGES_M = ((0, 20), (20, 35), (35, 50))
_MAX_M, _MIN_IOU = 2.0, 0.5
# Overlap from above from which a person leaves a box as it is.
_UNTOUCHED_IOU, _UNTOUCHED_PERSON_IOU = 0.7, 0.5
_WITH_SIDES = ("car", "truck", "bus", "trailer", "construction_vehicle")
_RECALL = 0.9
_CONFIDENCES = np.linspace(0, 1, 101)


@dataclass(frozen=True)
class ProposalsConfig(FlagGroup):
    """What is measured.

    Attributes:
        match: A proposal is right where it is nearer than 2 m to a label of its class, or overlaps one by 0.5 from above.
        min_returns: Number of returns from which a label counts, and a proposal that has none.
        min_confidence: Confidence from which proposals are labels.
    """

    match: Literal["distance", "iou"] = "distance"
    min_returns: int = 1
    min_confidence: float = ProposedLabelConfig.min_confidence

    def __post_init__(self) -> None:
        """Validate the number of returns."""
        require_positive("--min-returns", self.min_returns)


@dataclass(frozen=True)
class LabelledBoxes(ArrayTable):
    """G labels that count.

    Attributes:
        types: (G,) classes of nuScenes' detection task.
        ranges_m: (G,) distances from the LiDAR over the ground.
    """

    types: NDArray[np.str_]
    ranges_m: Float64


@dataclass(frozen=True)
class ProposedBoxes(ArrayTable):
    """D proposed boxes that count.

    Attributes:
        types: (D,) classes of nuScenes' detection task.
        ranges_m: (D,) distances over the ground, of a right one that of its label.
        confidences: (D,) confidences, 0 to 1.
        is_right: (D,) whether they are at a label of their class that no surer one has.
        ious: (D,) overlap with the label from above, 0 without one.
        numbers: (D,) numbers of the objects.
    """

    types: NDArray[np.str_]
    ranges_m: Float64
    confidences: Float64
    is_right: Bool
    ious: Float64
    numbers: Int


@dataclass(frozen=True)
class ProposalMetrics(Metrics):
    """Proposals of a class, at all distances or some.

    Attributes:
        labels: Number of labels that count.
        precision: Share of proposals that are right, 0 to 1.
        confirmed: Share of proposals of objects that are right in this frame or another: cameras lose what LiDARs see.
        recall: Share of labels that are proposed, 0 to 1.
        iou: Mean overlap from above of right proposals with their labels.
        untouched: Share of labels of which the proposed box can stay as it is.
        at_recall: Highest precision at a recall of 0.9 or more, NaN where it is not reached.
        best: Highest F1 over all confidences.
        best_confidence: Confidence at which it is reached.
    """

    labels: Annotated[int, Metric("labels")]
    precision: Annotated[float, Metric("precision", ".3f")]
    confirmed: Annotated[float, Metric("confirmed", ".3f")]
    recall: Annotated[float, Metric("recall", ".3f")]
    iou: Annotated[float, Metric("IoU", ".2f")]
    untouched: Annotated[float, Metric("untouched [%]", ".1%")]
    at_recall: Annotated[float, Metric("precision at recall 0.9", ".3f")]
    best: Annotated[float, Metric("best F1", ".3f")]
    best_confidence: Annotated[float, Metric("at confidence", ".2f")]

    @property
    def f1(self) -> Annotated[float, Metric("F1", ".3f")]:
        """Harmonic mean of precision and recall."""
        return _f1(self.precision, self.recall)


def label_proposals(
    root: Path,
    *,
    drive: DriveFlags,
    config: ProposalsConfig,
    proposals: Path | None = None,
    pipeline: PipelineConfig = _PIPELINE,
    out: Path = RESULTS / "label_proposals.png",
) -> None:
    """Measure the proposals of `trifuse label` against the labels of a drive, by class and distance.

    Example: trifuse study label-proposals nuscenes --sequence scene-0916

    Args:
        root: Folder of a labelled drive.
        proposals: Folder of `trifuse label` with the proposals of that drive; else they are made.
        pipeline: Pipeline configuration of those that are made.
        out: Figure; a JSON file with the numbers is written beside it.
    """
    from data.label_proposals.proposals import ProposalFile
    from data.open_drive import open_drive

    opened = open_drive(root, sequence=drive.sequence, config=drive.reading)
    if proposals is None:
        with tempfile.TemporaryDirectory() as folder:
            _propose(opened, drive, pipeline, Path(folder))
            file = ProposalFile.read(Path(folder))
    else:
        file = ProposalFile.read(proposals)
    labels, found = match_proposals(opened, file, config)
    rows = proposal_metrics(labels, found, config.min_confidence)
    title = f"Proposals of {opened.name} from confidence {config.min_confidence:g}"
    plot_curves(out, title, _panels(labels, found))
    table = Table(title, ProposalMetrics.columns(), rows, "class")
    conditions = {"drive": root, "config": config, "pipeline": pipeline, "proposals": proposals}
    publish(out, "none: the thesis proposes no labels", {"proposals": table}, conditions)


def _propose(
    opened: "RecordedDrive", flags: DriveFlags, pipeline: PipelineConfig, folder: Path
) -> None:
    from data.label_proposals.label_drive import proposal_pipeline
    from data.label_proposals.proposal_writer import ProposalWriter
    from data.pipeline_results import pipeline_results
    from perception.cli.progress import progress_bar

    writer = ProposalWriter(folder, opened)
    chosen = proposal_pipeline(pipeline, opened)
    for result in pipeline_results(opened, chosen, limit=flags.frames, progress=progress_bar):
        writer.add(result, None)
    writer.close(is_complete=True)


def match_proposals(
    drive: "RecordedDrive", file: "ProposalFile", config: ProposalsConfig
) -> tuple[LabelledBoxes, ProposedBoxes]:
    """Return the labels of a drive that count, and the proposals beside them.

    Args:
        drive: Labelled drive.
        file: Proposals.
        config: What is right.
    """
    from data.nuscenes.samples import read_samples

    indices = [index for index in file.poses if drive.sample_token(index) is not None]
    labels, found = [LabelledBoxes.empty()], [ProposedBoxes.empty()]
    for index, sample in zip(indices, read_samples(drive, indices), strict=True):
        of_frame = _matched(drive, index, sample, file, config)
        labels.append(of_frame[0])
        found.append(of_frame[1])
    return LabelledBoxes.concatenate(labels), ProposedBoxes.concatenate(found)


def _matched(
    drive: "RecordedDrive",
    index: int,
    sample: "Sample",
    file: "ProposalFile",
    config: ProposalsConfig,
) -> tuple[LabelledBoxes, ProposedBoxes]:
    from perception.geometry.boxes import points_inside, transform_boxes
    from perception.geometry.se3 import inverse

    map_SE3_velo = drive.map_SE3_velo(index)
    around, truths = sample.surroundings, sample.truths
    boxes_map = truths.boxes
    inside = points_inside(
        transform_boxes(inverse(map_SE3_velo), boxes_map), drive.points_velo(index), _MARGIN_M
    )
    counts = around.count(truths) & (inside.sum(axis=1) >= config.min_returns)
    counts &= around.reach_into_view(truths)
    found, points, numbers = _proposed(file, index, map_SE3_velo)
    found_map = found.boxes
    overlaps, away_m = iou_bev(found_map, boxes_map), center_distances_m(found_map, boxes_map)
    cost = away_m / _MAX_M if config.match == "distance" else (1 - overlaps) / (1 - _MIN_IOU)
    cost[found.types[:, None] != truths.types] = np.inf
    ranges_m = np.linalg.norm(truths.centers_m[:, :2] - around.vehicle_m, axis=1)
    found_m = np.linalg.norm(found.centers_m[:, :2] - around.vehicle_m, axis=1)
    matches = _matches(cost, counts)
    is_right = (matches >= 0) & np.append(counts, False)[matches]
    # One that is at a label that does not count, is none that counts either.
    is_counted = (matches < 0) & around.count(found) & around.are_in_view(found)
    is_counted &= points >= config.min_returns
    rows = np.flatnonzero(is_right | is_counted)
    proposed = ProposedBoxes(
        types=found.types,
        ranges_m=np.where(is_right, np.append(ranges_m, 0.0)[matches], found_m),
        confidences=found.scores,
        is_right=is_right,
        ious=is_right
        * np.column_stack([overlaps, np.zeros(len(found))])[range(len(found)), matches],
        numbers=numbers,
    )
    return LabelledBoxes(truths.types[counts], ranges_m[counts]), proposed[rows]


def _matches(cost: Float64, counts: Bool) -> Int:
    """Return the free label of the least cost up to 1 of each proposal, the surest first; -1 without one.

    Labels that do not count are the last choice.
    """
    cost = np.where(cost <= 1, cost + np.where(counts, 0.0, 10.0), np.inf)
    matches = []
    for one in cost:
        best = int(one.argmin()) if np.isfinite(one).any() else -1
        cost[:, best] = np.inf if best >= 0 and counts[best] else cost[:, best]
        matches.append(best)
    return np.array(matches, np.int64)


def _proposed(
    file: "ProposalFile", index: int, map_SE3_velo: Float64
) -> tuple["TaskDetections", Int, Int]:
    """Return the proposals of one frame with a class of the task, the surest first; their returns; their objects."""
    from data.labelled_objects import task_classes
    from perception.evaluation.nuscenes.boxes import TaskDetections
    from perception.geometry.boxes import transform_boxes
    from perception.geometry.se3 import inverse

    rows = [
        (one, int(row)) for one in file.proposals for row in np.flatnonzero(one.frames == index)
    ]
    rows.sort(key=lambda row: -row[0].box_confidences[row[1]])
    boxes_world = Boxes3D.concatenate(one.boxes_world[row : row + 1] for one, row in rows)
    boxes = transform_boxes(map_SE3_velo @ inverse(file.poses[index]), boxes_world)
    count = len(rows)
    found = TaskDetections(
        types=task_classes([one.kind for one, _ in rows]),
        centers_m=boxes.centers_m,
        size_m=boxes.size_m,
        yaw_rad=boxes.yaw_rad,
        velocities_m_s=np.full((count, 2), np.nan),
        attributes=np.full(count, ""),
        scores=np.array([one.box_confidences[row] for one, row in rows], np.float64),
    )
    points, numbers = (one.points[row] for one, row in rows), (one.number for one, _ in rows)
    return found, np.array([*points], np.int64), np.array([*numbers], np.int64)


def proposal_metrics(
    labels: LabelledBoxes, found: ProposedBoxes, min_confidence: float
) -> Mapping[str, ProposalMetrics]:
    """Return the metrics of each class with labels, and of it by distance.

    Args:
        labels: Labels.
        found: Proposals.
        min_confidence: Confidence from which they are labels.
    """
    result = {}
    confirmed = np.unique(found.numbers[found.is_right])
    for name, near_m, far_m, heading in _rows(labels):
        of_labels = (labels.types == name) & (near_m <= labels.ranges_m) & (labels.ranges_m < far_m)
        of_found = (found.types == name) & (near_m <= found.ranges_m) & (found.ranges_m < far_m)
        if of_labels.any():
            rows = found[of_found]
            used = rows[rows.confidences >= min_confidence]
            share = float(np.isin(used.numbers, confirmed).mean()) if len(used) else 1.0
            result[heading] = _metrics(name, int(of_labels.sum()), rows, min_confidence, share)
    return result


def _rows(labels: LabelledBoxes) -> Iterator[tuple[str, float, float, str]]:
    for name in CLASSES:
        if (labels.types == name).any():
            yield name, 0.0, np.inf, name
            for near_m, far_m in _RANGES_M:
                yield name, near_m, far_m, f"{name}, {near_m} to {far_m} m"


def _metrics(
    name: str, labels: int, found: ProposedBoxes, min_confidence: float, confirmed: float
) -> ProposalMetrics:
    precision, recall = _curve(labels, found, np.array([min_confidence]))
    used = found[found.is_right & (found.confidences >= min_confidence)]
    confidences = np.unique(found.confidences) if len(found) else np.zeros(1)
    curve = _curve(labels, found, confidences)
    scores = [_f1(*pair) for pair in curve.T.tolist()]
    min_iou = _UNTOUCHED_IOU if name in _WITH_SIDES else _UNTOUCHED_PERSON_IOU
    return ProposalMetrics(
        labels=labels,
        precision=float(precision[0]),
        confirmed=confirmed,
        recall=float(recall[0]),
        iou=float(used.ious.mean()) if len(used) else float("nan"),
        untouched=float((used.ious >= min_iou).sum() / labels),
        at_recall=max(curve[0, curve[1] >= _RECALL].tolist(), default=float("nan")),
        best=max(scores),
        best_confidence=float(confidences[int(np.argmax(scores))]),
    )


def _curve(labels: int, found: ProposedBoxes, confidences: Float64) -> Float64:
    """Return (2, C) precision and recall from each confidence on; precision 1 without a proposal."""
    is_used = found.confidences[None] >= confidences[:, None]
    right, used = (is_used & found.is_right).sum(axis=1), is_used.sum(axis=1)
    precision = np.divide(right, used, out=np.ones(len(confidences)), where=used > 0)
    return np.stack([precision, right / labels])


def _f1(precision: float, recall: float) -> float:
    return 2 * precision * recall / (precision + recall) if recall else 0.0


def _panels(labels: LabelledBoxes, found: ProposedBoxes) -> list[CurvePanel]:
    panels = []
    for name in CLASSES:
        if count := int((labels.types == name).sum()):
            both = _curve(count, found[found.types == name], _CONFIDENCES)
            curves = [
                Curve(kind, _CONFIDENCES, one)
                for kind, one in zip(("precision", "recall"), both, strict=True)
            ]
            panels.append(
                CurvePanel(f"{name}, {count} labels", "confidence", "share", curves, (0, 1), (0, 1))
            )
    return panels
