"""A drive through the pipeline, frame by frame, with a progress bar."""

from collections.abc import Generator

from data.frames import OnBadFrame, frame_count, read_frames
from perception.cli.progress import progress_bar
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import Drive, Result


def drive_results(
    drive: Drive, config: PipelineConfig, *, limit: int | None, on_bad_frame: OnBadFrame
) -> Generator[Result, None, None]:
    """Yield what the pipeline makes of each frame; frames of no sequence know nothing of each other.

    Args:
        drive: what is read.
        config: of the pipeline.
        limit: only so many frames from the start, or None.
        on_bad_frame: stop or skip.

    Raises:
        PerceptionError: a frame cannot be read or used.
    """
    frames = read_frames(drive, on_bad_frame=on_bad_frame, limit=limit)
    count = frame_count(drive, limit)
    with (
        Pipeline(drive.sensor, config) as pipeline,
        pipeline.stream(frames, is_sequence=drive.is_sequence) as results,
    ):
        yield from progress_bar(results, drive.name, count)
