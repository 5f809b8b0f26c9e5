"""What a few settings reach on all drives, object by object: for curves, where the search only counts."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from data.drive import Labels
from data.true_boxes import true_boxes
from perception.detection.proposal_order import ProposalOrder, order_scores
from perception.detection.proposals import ProposalRules
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.evaluation.detection.proposal_recall import ProposalRecall, proposal_recall
from perception.maps.projection import camera_of
from perception.types import Detections, Frame
from train.proposal_search.counting import Part, propose_by_all, read_or_skip
from train.proposal_search.search import SearchPlan
from train.proposal_search.workers import run_parts

Gathered = Iterable[tuple["Gathering", "list[Candidates]"]]
RecallProgress = Callable[[Gathered, int], Gathered]


@dataclass(frozen=True)
class Gathering:
    """What one process gathers at a time.

    Attributes:
        part: frames, settings and class.
        order: by which proposals are scored.
    """

    part: Part
    order: ProposalOrder


@dataclass(frozen=True)
class Candidates:
    """One frame.

    Attributes:
        labels: all of it.
        proposals: of each setting, scored by their order.
    """

    labels: Labels
    proposals: tuple[Detections, ...]


def measure_recall(
    plan: SearchPlan,
    settings: Sequence[ProposalRules],
    order: ProposalOrder,
    workers: int = 1,
    progress: RecallProgress = lambda gathered, parts: gathered,
) -> list[ProposalRecall]:
    """Return the recall of each setting over all frames of a search.

    Raises:
        PerceptionError: a frame cannot be read.
    """
    gatherings = [Gathering(part, order) for part in plan.parts([settings])]
    gathered = progress(run_parts(gather, gatherings, workers), len(gatherings))
    by_chunk = {gathering.part.chunk: frames for gathering, frames in gathered}
    frames = [frame for chunk in sorted(by_chunk) for frame in by_chunk[chunk]]
    truths = true_boxes([frame.labels for frame in frames])
    return [
        proposal_recall(
            truths,
            DetectedBoxes.of_frames([frame.proposals[number] for frame in frames]),
            len(frames),
            plan.survey.of_class,
            plan.overlaps,
        )
        for number in range(len(settings))
    ]


def gather(gathering: Gathering) -> list[Candidates]:
    """Return what is labelled and what is proposed in each frame that can be read."""
    part = gathering.part
    drive = part.frames.open()
    read = ((index, read_or_skip(drive, index, part.on_bad_frame)) for index in part.frames.frames)
    return [
        Candidates(drive.labels(index), _propose(frame, gathering))
        for index, frame in read
        if frame is not None
    ]


def _propose(frame: Frame, gathering: Gathering) -> tuple[Detections, ...]:
    focal_px = float(camera_of(frame)[0].image_P_cam[0, 0])
    return tuple(
        Detections(
            found.boxes_px,
            order_scores(gathering.order, found, focal_px),
            np.full(len(found), gathering.part.of_class),
        )
        for found in propose_by_all(frame, gathering.part.rules)
    )
