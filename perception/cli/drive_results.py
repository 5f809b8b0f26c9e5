"""The pipeline over the frames of a drive, with a progress bar."""

from collections.abc import Generator, Sequence

from data.faults.injection import Fault, inject
from data.frames import frame_count, read_frames
from data.results.checkpoint import Checkpoint
from perception.cli.progress import progress_bar
from perception.kernels.compiled import load_compiled
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import Drive, OnBadFrame, Result


def compile_functions() -> None:
    """Compile or load the compiled functions of all modules that are imported, with a bar where it takes time."""
    load_compiled(
        lambda functions: progress_bar(functions, "compiling", unit="function", delay_s=1)
    )


def drive_results(
    drive: Drive,
    config: PipelineConfig,
    *,
    limit: int | None,
    on_bad_frame: OnBadFrame,
    checkpoint: Checkpoint | None = None,
    checkpoint_frames: int = 0,
    faults: Sequence[Fault] = (),
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
            yield from progress_bar(results, drive.name, frame_count(drive, limit) - first)
