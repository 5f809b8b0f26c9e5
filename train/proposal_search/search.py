"""The exhaustive search: every setting in every frame, the best one first (6.1.4)."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import reduce
from operator import add
from pathlib import Path
from typing import Any

from data.batch.parts import run_parts
from perception import __version__
from perception.errors import LabelError, UsageError
from perception.evaluation.detection.proposal_recall import IOU_THRESHOLDS, require_iou
from perception.types import Method, OnBadFrame
from train.proposal_search.counting import ProposalCount, SearchTask, run_search_task
from train.proposal_search.grid import SearchGrid
from train.proposal_search.search_log import SearchLog
from train.proposal_search.survey import Survey

FinishedTasks = Iterable[tuple[SearchTask, list[ProposalCount]]]
SearchProgress = Callable[[FinishedTasks, int, int], FinishedTasks]


@dataclass(frozen=True)
class SearchConfig:
    """Drives and values of a search.

    Attributes:
        survey: Drives and object class.
        grid: Values of the parameters.
        method: Method of the proposals: default or thesis.
        overlaps: IoU thresholds; the recall at the first is maximized.
        chunk_frames: Number of frames that one process takes at a time.
        on_bad_frame: Stop at a damaged frame, or leave it out of all counts.
    """

    survey: Survey
    grid: SearchGrid = field(default_factory=SearchGrid)
    method: Method = "default"
    overlaps: tuple[float, ...] = IOU_THRESHOLDS
    chunk_frames: int = 10
    on_bad_frame: OnBadFrame = "stop"

    def __post_init__(self) -> None:
        """Validate the IoU thresholds."""
        if not self.overlaps or len(set(self.overlaps)) < len(self.overlaps):
            found = str(list(self.overlaps))
            raise UsageError("--iou", expected="one or more, each once", found=found)
        for iou in self.overlaps:
            require_iou(iou)

    def parts(self) -> list[SearchTask]:
        """Cut the search into parts, chunk by chunk, and each by what shares its ground removal."""
        return [
            SearchTask(
                chunk=chunk,
                frames=frames,
                parameters=tuple(parameters),
                method=self.method,
                of_class=self.survey.of_class,
                overlaps=self.overlaps,
                on_bad_frame=self.on_bad_frame,
            )
            for chunk, frames in enumerate(self.survey.chunks(self.chunk_frames))
            for parameters in self.grid.grounds()
        ]

    def identity(self) -> dict[str, Any]:
        """Return, in JSON's own types, all that counts depend on beside the setting and the chunk."""
        return {
            "program": __version__,
            "drives": [
                {
                    "path": str(drive.path),
                    "sequence": drive.sequence,
                    "frames": list(drive.frames),
                    "labels": dict(labels),
                }
                for drive, labels in zip(self.survey.drives, self.survey.labels, strict=True)
            ],
            "method": self.method,
            "of_class": self.survey.of_class.lower(),
            "overlaps": list(self.overlaps),
            "chunk_frames": self.chunk_frames,
            "on_bad_frame": self.on_bad_frame,
        }


def search(
    config: SearchConfig,
    search_log: Path,
    workers: int = 1,
    progress: SearchProgress = lambda finished, done, parts: finished,
) -> list[ProposalCount]:
    """Count what is not counted yet, and return all parameters over all frames, the best first.

    The best reaches most objects at the first overlap (6.1.4); of several, it has the fewest proposals.

    Args:
        config: Drives and values to try.
        search_log: File of the counts, from which an interrupted search continues.
        workers: Number of processes.
        progress: Wrapper of the loop over finished parts that may show its progress; it gets how many were
            done before, and how many there are.

    Raises:
        PerceptionError: a frame cannot be read, or the counts are of another search.
    """
    counts = SearchLog(search_log, config.identity())
    parts = config.parts()
    missing = [part for part in parts if not counts.holds(part)]
    finished = run_parts(run_search_task, missing, workers)
    for part, of_part in progress(finished, len(parts) - len(missing), len(parts)):
        counts.add(part.chunk, of_part)
    chunks = range(len(config.survey.chunks(config.chunk_frames)))
    sums = [
        reduce(add, (counts.counts[chunk, parameters] for chunk in chunks))
        for parameters in config.grid.combinations()
    ]
    if not sums[0].objects:
        raise LabelError(
            f"{config.survey.frames} frames",
            expected=f"{config.survey.of_class} labels in those that can be read",
            found=f"none, as {sums[0].unread} frames cannot be read",
        )
    return sorted(sums, key=lambda one: (-one.reached[0], one.proposals))
