"""`trifuse evaluate datmo`."""

from pathlib import Path
from typing import cast, get_args

from data.frames import OnBadFrame
from perception.cli.evaluations.datmo_report import PROTOCOL_WORDS, DatmoProtocol, compare_datmo
from perception.cli.evaluations.datmo_steps import datmo_steps
from perception.cli.evaluations.datmo_tables import datmo_results, datmo_tables
from perception.cli.evaluations.document import Evaluation
from perception.cli.evaluations.drive_run import DriveRun, open_labelled_drive
from perception.datmo.config import DatmoMethod
from perception.errors import UsageError
from perception.evaluation.config import EvaluationView, MovingObjectConfig
from perception.pipeline import PipelineConfig


def datmo(  # noqa: PLR0913 - flags of a command
    root: Path,
    *,
    sequence: str | None = None,
    methods: str = "default,thesis,author",
    view: EvaluationView = "camera",
    sensor: str | None = None,
    frames: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    min_points: int = 20,
    json: Path | None = None,
) -> None:
    """Measure how well moving objects are tracked on the ground plane, several methods on the same scans.

    HOTA, CLEAR and IDF1 by distance and by overlap, errors of place, velocity and extent, and each object.

    Example: trifuse evaluate datmo kitti/tracking --sequence 0000 --methods default,thesis

    Args:
        root: tracking sequences, or a synthetic drive in raw or tracking layout.
        sequence: which one, where there are several.
        methods: which of default, thesis and author, with commas between; ground and obstacles are always the default's.
        view: judge what the camera sees, or all around, which only synthetic drives know.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        frames: only so many from the start; else all.
        on_bad_frame: stop at a damaged frame, or skip it and say so.
        min_points: that an object's box must hold to count.
        json: gets the same figures with protocol, data and configuration.
    """
    chosen = _parse_methods(methods)
    protocol = DatmoProtocol(targets=MovingObjectConfig(min_points=min_points), view=view)
    drive = open_labelled_drive(root, sequence, sensor, frames)
    run = DriveRun(drive, PipelineConfig.for_motion("none"), frames, on_bad_frame)
    steps = datmo_steps(drive, run.config, chosen, limit=frames, on_bad_frame=on_bad_frame)
    reports = compare_datmo(drive, steps, chosen, protocol)
    evaluated = next(iter(reports.values())).frames
    print(f"{run.describe(evaluated)}, judged: {view}\n\n{datmo_tables(reports)}")
    if json is not None:
        words = {**PROTOCOL_WORDS, "values": protocol}
        run.write(json, evaluated, Evaluation("datmo", words, datmo_results(reports)))


def _parse_methods(words: str) -> tuple[DatmoMethod, ...]:
    known = [method for method in get_args(DatmoMethod) if method != "none"]
    chosen = [word.strip() for word in words.split(",")]
    if not set(chosen) <= set(known) or len(set(chosen)) < len(chosen):
        raise UsageError(
            "--methods",
            expected=f"some of {', '.join(known)}, with commas, each once",
            found=repr(words),
        )
    return cast("tuple[DatmoMethod, ...]", tuple(chosen))
