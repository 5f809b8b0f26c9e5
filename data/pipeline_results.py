"""The pipeline over the frames of a drive."""

from collections.abc import Callable, Generator, Iterable, Sequence
from typing import Any

from data.faults.injection import Fault, inject
from data.frames import frame_count, read_frames
from data.results.checkpoint import Checkpoint
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import Drive, OnBadFrame, Result

# Shows a progress bar over frames with a description and their number.
FrameProgress = Callable[[Iterable[Any], str, int], Iterable[Any]]


def no_progress(frames: Iterable[Any], description: str, count: int) -> Iterable[Any]:
    """Return the frames: no bar is shown."""
    del description, count
    return frames


def pipeline_results(  # noqa: PLR0913 - each is a flag of its own
    drive: Drive,
    config: PipelineConfig,
    *,
    limit: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    checkpoint: Checkpoint | None = None,
    checkpoint_frames: int = 0,
    faults: Sequence[Fault] = (),
    progress: FrameProgress = no_progress,
) -> Generator[Result, None, None]:
    """Yield the result of each frame; frames of no sequence, such as object frames, share no state.

    Args:
        drive: Drive to read.
        config: Pipeline configuration.
        limit: Number of frames from the start; None for all.
        on_bad_frame: Stop at a damaged frame, or skip it.
        checkpoint: Checkpoint of the same pipeline and drive to go on from; None to start with the first frame.
        checkpoint_frames: Number of frames between two results with a snapshot; 0 for none.
        faults: Faults of sensors that are injected.
        progress: Progress bar over the results.

    Raises:
        PerceptionError: a frame cannot be read or used.
    """
    first = 0 if checkpoint is None else checkpoint.frames
    with Pipeline(drive.sensor, config) as pipeline:
        if checkpoint is not None:
            pipeline.restore(checkpoint.pipeline)
        # A fault may repeat what was before it, and so begins with the drive.
        start = 0 if faults else first
        frames = read_frames(drive, on_bad_frame=on_bad_frame, limit=limit, first=start)
        if faults:
            frames = (frame for frame in inject(frames, faults) if frame.index >= first)
        with pipeline.stream(
            frames, is_sequence=drive.is_sequence, snapshot_frames=checkpoint_frames
        ) as results:
            yield from progress(results, drive.name, frame_count(drive, limit) - first)
