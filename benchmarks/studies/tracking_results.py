"""Tracks of the thesis' sequences in the image and in 3D at several instants (Figs 7.7, 7.8)."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.studies.report import RESULTS, publish
from perception.atomic_file import write_jpeg
from perception.cli.evaluate_stages import ObjectSet
from perception.cli.flags import DriveFlags, require_positive
from perception.cli.parser import FlagGroup
from perception.cli.progress import progress_bar
from perception.evaluation.report import Table
from perception.tracking.single_object.config import TrackerName
from perception.types import Drive

if TYPE_CHECKING:
    from perception.evaluation.single_object.metrics import SingleObjectMetrics
    from perception.evaluation.single_object.track import TargetObject
    from perception.render.tracked_object_views import TrackedObjectScene


@dataclass(frozen=True)
class TrackingResultsConfig(FlagGroup):
    """Objects and instants.

    Attributes:
        set: Set of objects: table-3.2 (8 sequences), 3d-otd (Table A.1, 50), both, or every labelled track of 15 frames.
        track_id: Track id of the only object; else all.
        tracker: Name of the tracker.
        instants: Number of instants of each object, evenly spaced.
    """

    set: ObjectSet = "table-3.2"
    track_id: int | None = None
    tracker: TrackerName = "h-fus"
    instants: int = 4

    def __post_init__(self) -> None:
        """Validate the number of instants."""
        require_positive("--instants", self.instants)


def tracking_results(
    root: Path,
    *,
    source: DriveFlags,
    config: TrackingResultsConfig,
    out: Path = RESULTS / "tracking-results.jpg",
) -> None:
    """Draw tracked objects in the image and in 3D over time, a row for each sequence (Figs 7.7, 7.8).

    Example: trifuse study tracking-results kitti/tracking --sequence 0000

    Args:
        root: KITTI's tracking data, or a synthetic drive.
        out: Figure; a JSON file with the errors is written beside it.
    """
    from data.derived.otd_objects import ObjectSetConfig, find_objects
    from perception.evaluation.single_object.metrics import SingleObjectMetrics
    from perception.render.tracked_object_grid import draw_tracked_objects

    objects = ObjectSetConfig(
        root,
        config.set,
        source.sequence,
        config.track_id,
        frames=source.frames,
        reading=source.reading,
    )
    found = find_objects(objects)
    tracks = {
        target.sequence.name: _track(one.drive, target, source, config)
        for one in found.drives
        for target in one.objects
    }
    write_jpeg(out, draw_tracked_objects({name: track.shown for name, track in tracks.items()}))
    metrics = {name: track.metrics for name, track in tracks.items()}
    notes = ("absent:", *found.absent_lines()) if found.absent else ()
    columns = SingleObjectMetrics.columns()
    table: Table[Any] = Table(f"{root.name}: {config.tracker}", columns, metrics, "sequence", notes)
    publish(out, "Figs 7.7, 7.8", {"tracks": table}, {"config": config, "objects": objects})


@dataclass(frozen=True)
class _Track:
    """Track of one object.

    Attributes:
        metrics: Errors against the labels.
        shown: Instants that are drawn.
    """

    metrics: "SingleObjectMetrics"
    shown: "list[TrackedObjectScene]"


def _track(
    drive: Drive, target: "TargetObject", source: DriveFlags, config: TrackingResultsConfig
) -> _Track:
    """Track an object from its first label to the last frame of its sequence."""
    from data.derived.track_start import TrackStart
    from data.results.track_object import TrackConfig, tracked_scenes
    from perception.evaluation.single_object.metrics import (
        single_object_errors,
        single_object_metrics,
    )
    from perception.evaluation.single_object.track import PredictedTrack
    from perception.tracking.single_object.trackers import single_object_tracker

    sequence, truth = target.sequence, target.truth
    first = int(truth.frames[0])
    start = TrackStart(first, truth.boxes_velo[:1], sequence.track_id, sequence.kind, truth)
    count = sequence.last_frame + 1 - first
    track_config = TrackConfig(
        config.tracker, frames=count, video=False, on_bad_frame=source.on_bad_frame
    )
    tracker = single_object_tracker(config.tracker, drive.sensor)
    instants = {int(count * (number + 0.5) / config.instants) for number in range(config.instants)}
    frames, predictions, seconds, shown = [], [], [], []
    scenes = tracked_scenes(drive, start, tracker, track_config, progress_bar)
    for number, scene in enumerate(scenes):
        frames.append(scene.result.frame.index)
        predictions.append(scene.tracked)
        seconds.append(scene.seconds)
        if number in instants:
            shown.append(scene)
    predicted = PredictedTrack.from_predictions(frames, predictions, seconds)
    metrics = single_object_metrics(single_object_errors(truth, predicted, drive.calibration))
    return _Track(metrics, shown)
