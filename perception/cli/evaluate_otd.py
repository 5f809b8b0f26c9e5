"""`trifuse evaluate otd`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluationDocument
from perception.cli.evaluation import publish_report
from perception.cli.flags import DriveFlags, ReportFlags
from perception.errors import UsageError
from perception.pipeline import PipelineConfig
from perception.tracking.single_object.config import SingleObjectTrackerConfig
from perception.types import Drive, OnBadFrame

if TYPE_CHECKING:
    from perception.evaluation.single_object.track import TargetObject
    from perception.evaluation.single_object.tracker_runs import TrackerMakers, TrackerRun

ObjectSet = Literal["table-3.2", "3d-otd", "all", "present"]
_PIPELINE, _TRACKER = PipelineConfig.for_motion("none"), SingleObjectTrackerConfig()


def evaluate_otd(
    root: Path,
    *,
    drive: DriveFlags,
    report: ReportFlags,
    config: CommandConfig,
    set: ObjectSet = "all",
    trackers: tuple[str, ...] = (),
    track_id: int | None = None,
    plots: Path | None = None,
    tracker: SingleObjectTrackerConfig = _TRACKER,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Measure trackers of one object on the sequences of the thesis, or on any labelled track.

    E3D, E2D and E_phi of Tables 7.6 and 7.7, overlap and heading success of Appendix A, Success and Precision
    of one-pass evaluation, shares of frames seen and lost, and time. Absent sequences are listed.

    Example: trifuse evaluate otd kitti/tracking --set present --sequence 0000 --trackers default,h-fus

    Args:
        root: KITTI's tracking data, or a synthetic drive.
        set: Set of objects: table-3.2 (8 sequences), 3d-otd (Table A.1, 50), both, or every labelled track of 15 frames.
        trackers: Names of the trackers, such as default,h-fus,3d-kf; else all of them, which takes long.
        track_id: Track id of the only object; else all.
        plots: Folder for the plots of Figs A.1 to A.3 and of one-pass evaluation.
        tracker: Configuration of the trackers (Table 7.5).
        pipeline: Configuration of the pipeline up to the ground.
    """
    from data.derived.otd_objects import ObjectSetConfig, find_objects
    from perception.evaluation.single_object.measure import PROTOCOL, SingleObjectMeasure
    from perception.evaluation.single_object.parameters import fusion_parameters
    from perception.evaluation.single_object.plots import write_plots
    from perception.evaluation.single_object.tracker_runs import named_trackers

    names = require_trackers(trackers)
    set_config = ObjectSetConfig(root, set, drive.sequence, track_id, drive.frames, drive.reading)
    found, measure = find_objects(set_config), SingleObjectMeasure(names)
    for one in found.drives:
        makers = named_trackers(names, one.drive.sensor, tracker)
        runs = run_trackers(one.drive, one.objects, makers, pipeline, drive.on_bad_frame)
        for target, by_name in zip(one.objects, runs, strict=True):
            measure.update(target, by_name, one.drive.calibration)
    metrics, absent = measure.compute(), found.absent_lines()
    drives = [
        {"drive": d.drive.name, "sensor": d.drive.sensor.name, "frames": len(d.drive)}
        for d in found.drives
    ]
    reasons = {one.sequence.name: one.reason for one in found.absent}
    count = len(metrics.objects)
    heading = f"{root}: {count} of {count + len(found.absent)} sequences of the set {set}"
    document = EvaluationDocument(
        "otd",
        {"config": set_config, "drives": drives, "absent": reasons},
        PROTOCOL,
    )
    heading = "\n".join([f"{heading}; absent:", *absent]) if absent else heading
    if "h-fus" in names:
        heading = f"{heading}\n\n{fusion_parameters(tracker).text()}"
    publish_report(heading, metrics, document, config, report)
    if plots is not None:
        for path in write_plots(plots, f"{root.name}, set {set}", metrics):
            print(path)


def run_trackers(
    drive: Drive,
    targets: "Sequence[TargetObject]",
    makers: "TrackerMakers",
    pipeline: PipelineConfig = _PIPELINE,
    on_bad_frame: OnBadFrame = "stop",
) -> "list[dict[str, TrackerRun]]":
    """Let trackers track objects of one drive, with a progress bar; see `track_objects`."""
    from data.frames import frame_count, read_frames
    from perception.cli.progress import progress_bar
    from perception.evaluation.single_object.tracker_runs import track_objects

    limit = max((one.sequence.last_frame + 1 for one in targets), default=0)
    frames = read_frames(drive, on_bad_frame=on_bad_frame, limit=limit)
    bar = progress_bar(frames, drive.name, frame_count(drive, limit))
    return track_objects(bar, drive.sensor, targets, makers, pipeline)


def require_trackers(names: Sequence[str]) -> tuple[str, ...]:
    """Validate names of trackers; return all trackers where none is named.

    Raises:
        UsageError: A name is unknown, or occurs twice.
    """
    from perception.tracking.single_object.trackers import TRACKERS

    if {*names} <= {*TRACKERS} and len({*names}) == len(names):
        return tuple(names) or TRACKERS
    expected = f"some of {', '.join(TRACKERS)}, each once"
    raise UsageError("--trackers", expected=expected, found=repr(",".join(names)))
