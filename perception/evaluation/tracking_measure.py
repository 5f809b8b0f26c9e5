"""Metrics of tracking result files by KITTI's 2D protocol, over the sequences of a benchmark."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from perception.evaluation.multi_object import ground_protocol, kitti_protocol
from perception.evaluation.multi_object.ground_protocol import (
    GROUND_CLASSES,
    GroundTracks,
    ground_frame,
)
from perception.evaluation.multi_object.hota import ALPHAS
from perception.evaluation.multi_object.kitti_protocol import (
    MIN_IOU,
    NEIGHBOURS,
    ImageBoxes,
    KittiClass,
    kitti_frames,
)
from perception.evaluation.multi_object.mot_metrics import MotMetrics, evaluate_tracks, mot_table
from perception.evaluation.nuscenes import tracking
from perception.evaluation.report import Report, Table
from perception.types import Labels

PROTOCOL = {
    "boxes": kitti_protocol.__doc__,
    "ground": ground_protocol.__doc__,
    "nuscenes": tracking.__doc__,
    "neighbours": NEIGHBOURS,
    "values": {"threshold": MIN_IOU, "alphas": ALPHAS},
}
_COMBINED = "COMBINED"
_NO_OBJECTS = (
    "The labels hold no object of this class that the protocol counts: its ratios state nothing."
)


@dataclass(frozen=True)
class TrackingReport(Report):
    """Metrics of the tracks of several sequences.

    Attributes:
        frame_counts: Number of frames of each sequence.
        by_class: Metrics by class, then by sequence.
        ground: Metrics of all sequences on the ground by class, where tracks have 3D boxes.
        task: Metrics of nuScenes' tracking task, where the tracks are of its scenes.
    """

    frame_counts: dict[str, int]
    by_class: dict[KittiClass, dict[str, MotMetrics]]
    ground: dict[str, MotMetrics] = field(default_factory=dict)
    task: Report | None = None

    def combined(self, class_name: KittiClass) -> MotMetrics:
        """Return the metrics of all sequences together."""
        return sum(self.by_class[class_name].values(), MotMetrics())

    def tables(self) -> list[Table[Any]]:
        """Return a table for each class, with a note where the labels hold none of it."""
        rule = f"KITTI 2D boxes, CLEAR and identity at IoU {MIN_IOU:g}; ratios in percent"
        tables = []
        for name, by_sequence in self.by_class.items():
            combined = self.combined(name)
            table = mot_table(f"{name}: {rule}", {**by_sequence, _COMBINED: combined})
            has_objects = combined.clear.true_positives + combined.clear.false_negatives > 0
            tables.append(table if has_objects else replace(table, notes=[_NO_OBJECTS]))
        if self.ground:
            tables.append(
                mot_table("tracks on the ground: boxes from above, ratios in percent", self.ground)
            )
        return [*(self.task.tables() if self.task else ()), *tables]

    def to_json(self) -> dict[str, Any]:
        """Return all metrics by sequence, COMBINED and ground, then by class."""
        document: dict[str, Any] = {
            sequence: {name: rows[sequence].to_json() for name, rows in self.by_class.items()}
            for sequence in self.frame_counts
        }
        document[_COMBINED] = {name: self.combined(name).to_json() for name in self.by_class}
        if self.ground:
            document["ground"] = {name: metrics.to_json() for name, metrics in self.ground.items()}
        if self.task:
            document["nuscenes"] = self.task.to_json()
        return document


class TrackingMeasure:
    """Accumulates the metrics of tracks in the image, sequence after sequence."""

    def __init__(self, classes: Sequence[KittiClass]) -> None:
        """Start without a sequence, for the classes that are evaluated."""
        self._by_class: dict[KittiClass, dict[str, MotMetrics]] = {name: {} for name in classes}
        self._frame_counts: dict[str, int] = {}
        self._ground: dict[str, MotMetrics] = {}

    def update(
        self, sequence: str, labels: ImageBoxes, results: ImageBoxes, frame_count: int
    ) -> None:
        """Add one sequence.

        Args:
            sequence: Name of the sequence.
            labels: Labels of all classes, with regions of type DontCare.
            results: Rows of a tracker.
            frame_count: Number of frames of the sequence.

        Raises:
            PerceptionError: a row is of a frame beyond the last.
        """
        self._frame_counts[sequence] = frame_count
        for name, metrics in self._by_class.items():
            frames = kitti_frames(labels, results, name, frame_count)
            metrics[sequence] = evaluate_tracks(frames, MIN_IOU)

    def update_ground(self, frames: Sequence[tuple[Labels, GroundTracks]]) -> None:
        """Add the labels and the tracks of a sequence as boxes from above, frame by frame."""
        for name, rule in GROUND_CLASSES.items():
            if name.lower() in self._by_class:
                sequence = [ground_frame(labels, tracks, name) for labels, tracks in frames]
                added = evaluate_tracks(sequence, rule.min_iou)
                self._ground[name] = self._ground.get(name, MotMetrics()) + added

    def compute(self) -> TrackingReport:
        """Return the metrics of all sequences so far."""
        return TrackingReport(self._frame_counts, self._by_class, self._ground)
