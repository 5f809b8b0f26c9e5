"""`trifuse evaluate otd`."""

from pathlib import Path
from typing import Literal

from data.results.command_config import CommandConfig
from data.results.evaluated import EvaluationDocument
from perception.cli.flags import DriveFlags, ReportFlags
from perception.pipeline import PipelineConfig
from perception.tracking.single_object.config import SingleObjectTrackerConfig

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
        trackers: Names of the trackers, such as default,h-fus,3d-kf; all of them by default, which takes long.
        track_id: Track id of the only object; all by default.
        plots: Folder for the plots of Figs A.1 to A.3 and of one-pass evaluation.
        tracker: Configuration of the trackers (Table 7.5).
        pipeline: Configuration of the pipeline up to the ground.
    """
    from data.derived.otd_objects import ObjectSetConfig, find_objects, run_trackers
    from perception.cli.progress import progress_bar
    from perception.evaluation.single_object import tracker_runs
    from perception.evaluation.single_object.measure import PROTOCOL, SingleObjectMeasure
    from perception.evaluation.single_object.plots import write_plots

    names = tracker_runs.require_trackers(trackers)
    set_config = ObjectSetConfig(root, set, drive.sequence, track_id, drive.frames, drive.reading)
    found, measure = find_objects(set_config), SingleObjectMeasure(names)
    for one in found.drives:
        makers = tracker_runs.named_trackers(names, one.drive.sensor, tracker)
        skips = drive.on_bad_frame
        runs = run_trackers(one.drive, one.objects, makers, pipeline, skips, progress_bar)
        for target, by_name in zip(one.objects, runs, strict=True):
            measure.update(target, by_name, one.drive.calibration)
    metrics = measure.compute()
    document = EvaluationDocument("otd", {"config": set_config, **found.to_json()}, PROTOCOL)
    heading = found.heading(root, set, len(metrics.objects))
    if "h-fus" in names:
        heading = f"{heading}\n\n{tracker_runs.fusion_parameters(tracker).text()}"
    report.publish(heading, metrics, document, config)
    if plots is not None:
        for path in write_plots(plots, f"{root.name}, set {set}", metrics):
            print(path)
