"""`trifuse label`."""

from dataclasses import dataclass
from pathlib import Path

from data.label_proposals.config import ProposedLabelConfig
from data.results.command_config import CommandConfig
from perception.cli.flags import PartOfDriveFlags
from perception.cli.parser import FlagGroup
from perception.cli.run import RunResultsFlags
from perception.pipeline import PipelineConfig

_PIPELINE = PipelineConfig()


@dataclass(frozen=True)
class LabelFlags(ProposedLabelConfig, FlagGroup):
    """Labels."""


def label(
    root: Path,
    *,
    drive: PartOfDriveFlags,
    results: RunResultsFlags,
    labels: LabelFlags,
    config: CommandConfig,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Propose labels for a drive: the objects of all its frames, joined and smoothed, and a page to review them.

    Example: trifuse label my_drive --out my_labels --form labelcloud

    Args:
        root: Folder or file of a drive in any layout.
        pipeline: Pipeline configuration; else it detects from above, and in images where there are some.
    """
    from data.label_proposals.label_drive import proposal_pipeline, write_labels
    from data.open_drive import open_drive
    from data.results.drive_run import DriveRun
    from data.results.folder import LATEST
    from data.results.run_config import RunConfig
    from perception.cli.progress import frame_progress_bar, progress_bar

    opened = open_drive(root, sequence=drive.sequence, config=drive.reading)
    if labels.review is None:
        chosen = proposal_pipeline(pipeline, opened)
        run = RunConfig(frames=drive.frames, video=False, pipeline=chosen, proposes=True)
        bars = (results.checkpoint_frames, (), progress_bar, frame_progress_bar("returns"))
        DriveRun(opened, run, drive.on_bad_frame, *bars).write(results.place(config))
    print(write_labels(opened, results.out or LATEST, labels))
