"""`trifuse evaluate otd`."""

from dataclasses import dataclass
from pathlib import Path

from data.frames import OnBadFrame
from perception.cli.evaluations.document import Evaluation, write_evaluation
from perception.cli.evaluations.otd_objects import (
    AvailableObjects,
    ObjectSet,
    ObjectSetConfig,
    find_objects,
)
from perception.cli.evaluations.otd_plots import write_plots
from perception.cli.evaluations.otd_report import (
    PROTOCOL_WORDS,
    OtdProtocol,
    OtdReport,
    evaluate_object,
)
from perception.cli.evaluations.otd_steps import pipeline_config, track_objects
from perception.cli.evaluations.otd_tables import absent_lines, otd_results, otd_tables
from perception.errors import UsageError
from perception.tracking.single_object.trackers import TRACKERS


def otd(  # noqa: PLR0913 - flags of a command
    root: Path,
    *,
    set: ObjectSet = "all",
    trackers: str | None = None,
    sequence: str | None = None,
    track_id: int | None = None,
    sensor: str | None = None,
    frames: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    plots: Path | None = None,
    json: Path | None = None,
) -> None:
    """Measure how well trackers follow one object, by the sequences of the thesis or any labelled track.

    E3D, E2D and E_phi of Tables 7.6 and 7.7, overlap and heading success of Appendix A, Success and
    Precision of one-pass evaluation, shares of frames seen and lost, and time. What is absent is named.

    Example: trifuse evaluate otd kitti/tracking --set present --sequence 0000 --trackers default,h-fus

    Args:
        root: KITTI's tracking data, or a synthetic drive.
        set: table-3.2 (8 sequences), 3d-otd (Table A.1, 50), both, or every labelled track with 15 frames that is present.
        trackers: names with commas between, as default,h-fus,3d-kf; else all there are, which takes long.
        sequence: only this drive, as 0000.
        track_id: only this object.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        frames: only so many from the start of each drive; else all.
        on_bad_frame: stop at a damaged frame, or skip it and say so.
        plots: gets the plots of Figs A.1 to A.3 and of one-pass evaluation as PNG.
        json: gets the same figures with protocol, data and configuration.
    """
    chosen = parse_trackers(trackers)
    config = ObjectSetConfig(root, set, sequence, track_id, frames, sensor)
    found = find_objects(config)
    report = measure_otd(found, chosen, on_bad_frame=on_bad_frame)
    print(f"{_describe(config, found)}\n\n{otd_tables(report)}")
    if plots is not None:
        for path in write_plots(plots, f"{root.name}, set {set}", report):
            print(path)
    if json is not None:
        words = {**PROTOCOL_WORDS, "values": report.protocol}
        evaluation = Evaluation("otd", words, otd_results(report, found.absent))
        used = {"trackers": chosen, "pipeline": pipeline_config()}
        write_evaluation(json, _dataset_info(config, found), used, evaluation)


def measure_otd(
    found: AvailableObjects,
    trackers: tuple[str, ...],
    protocol: OtdProtocol | None = None,
    on_bad_frame: OnBadFrame = "stop",
) -> OtdReport:
    """Let trackers follow the objects of one drive after the other, and judge them.

    Raises:
        PerceptionError: a frame cannot be read or used.
    """
    protocol = protocol or OtdProtocol()
    objects = [
        evaluate_object(target, runs, drive_targets.drive.calibration, protocol)
        for drive_targets in found.drives
        for target, runs in zip(
            drive_targets.objects,
            track_objects(
                drive_targets.drive, drive_targets.objects, trackers, on_bad_frame=on_bad_frame
            ),
            strict=True,
        )
    ]
    return OtdReport(protocol, trackers, objects)


@dataclass(frozen=True)
class ObjectDatasetInfo:
    """Which data the figures are of.

    Attributes:
        config: what was asked for.
        drives: name, LiDAR and number of frames of each drive that was read.
    """

    config: ObjectSetConfig
    drives: list[dict[str, str | int]]


def _dataset_info(config: ObjectSetConfig, found: AvailableObjects) -> ObjectDatasetInfo:
    return ObjectDatasetInfo(
        config,
        [
            {"drive": one.drive.name, "sensor": one.drive.sensor.name, "frames": len(one.drive)}
            for one in found.drives
        ],
    )


def _describe(config: ObjectSetConfig, found: AvailableObjects) -> str:
    count = sum(len(one.objects) for one in found.drives)
    line = f"{config.root}: {count} of {count + len(found.absent)} sequences of the set {config.objects}"
    return f"{line}; absent:\n{absent_lines(found.absent)}" if found.absent else line


def parse_trackers(words: str | None) -> tuple[str, ...]:
    """Split names at commas; all trackers where none is named.

    Raises:
        UsageError: a name is unknown, or there twice.
    """
    chosen = TRACKERS if words is None else tuple(word.strip() for word in words.split(","))
    if not set(chosen) <= set(TRACKERS) or len(set(chosen)) < len(chosen) or not chosen:
        raise UsageError(
            "--trackers",
            expected=f"some of {', '.join(TRACKERS)}, with commas, each once",
            found=repr(words),
        )
    return chosen
