"""A drive through the pipeline once, and from there through several ways to find and follow what moves."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

from data.frames import OnBadFrame, frame_count, read_frames
from perception.cli.evaluations.datmo_report import DatmoPredictions
from perception.cli.progress import progress_bar
from perception.datmo.config import DatmoMethod
from perception.datmo.detector import SegmentedScan
from perception.datmo.stage import Datmo, datmo_stage
from perception.geometry.threads import limit_blas_threads
from perception.pipeline import PipelineConfig
from perception.pipeline.obstacle_chain import ObstacleChain
from perception.types import Drive, Tracks


def datmo_steps(
    drive: Drive,
    config: PipelineConfig,
    methods: Sequence[DatmoMethod],
    *,
    limit: int | None,
    on_bad_frame: OnBadFrame,
) -> Iterator[DatmoPredictions]:
    """Yield what every method makes of the same segmented scans, with a progress bar.

    Args:
        drive: what is read.
        config: of the pipeline up to the segmented scan.
        methods: each once.
        limit: only so many frames from the start, or None.
        on_bad_frame: stop or skip.

    Raises:
        PerceptionError: a frame cannot be read or used.
    """
    chain = ObstacleChain(drive.sensor, config)
    stages = {
        method: datmo_stage(replace(config.datmo, method=method), drive.sensor, config.area)
        for method in methods
    }
    frames = read_frames(drive, on_bad_frame=on_bad_frame, limit=limit)
    count = frame_count(drive, limit)
    for frame in progress_bar(frames, drive.name, count):
        _, scan = chain.segment(frame)
        tracks: dict[str, Tracks] = {}
        seconds: dict[str, float] = {}
        for method, stage in stages.items():
            tracks[method], seconds[method] = _timed(stage, scan)
        yield DatmoPredictions(frame, tracks, seconds)


def _timed(stage: Datmo | None, scan: SegmentedScan) -> tuple[Tracks, float]:
    """Return the tracks of one method, and the seconds that they took."""
    if stage is None:
        return Tracks.empty(), 0.0
    with limit_blas_threads():
        start = time.perf_counter()
        tracks = stage.update(scan)
        return tracks, time.perf_counter() - start
