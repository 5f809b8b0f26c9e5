"""Recall of a few settings on all drives, object by object, for curves; the search itself only counts."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from tqdm import tqdm

from data.batch.parts import run_parts
from perception.detection.config import ProposalConfig
from perception.detection.depthcn.proposal_order import ProposalOrder, order_scores
from perception.detection.depthcn.proposals import propose
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.proposal_recall import ProposalRecall, proposal_recall
from perception.maps.projection import camera_of
from perception.types import Detections, Frame, Labels, Method, OnBadFrame
from train.proposal_search.counting import read_or_skip
from train.proposal_search.search import SearchConfig
from train.proposal_search.survey import FrameSet


@dataclass(frozen=True)
class ProposalSetting:
    """Parameters and method of the proposals.

    Attributes:
        parameters: Parameters of the proposals.
        method: Method of the proposals: default or thesis.
    """

    parameters: ProposalConfig = field(default_factory=ProposalConfig)
    method: Method = "default"


@dataclass(frozen=True)
class FrameProposals:
    """One frame.

    Attributes:
        labels: Labels of the frame.
        proposals: Proposals of each setting, scored by their order.
    """

    labels: Labels
    proposals: tuple[Detections, ...]


def compared_settings(best: ProposalConfig, method: Method) -> dict[str, ProposalSetting]:
    """Return the best parameters, the default and the thesis' by name; equal ones once."""
    names = {ProposalSetting(best, method): "best"}
    for name, setting in (
        ("default", ProposalSetting()),
        ("thesis", ProposalSetting(method="thesis")),
    ):
        names[setting] = f"{names[setting]} = {name}" if setting in names else name
    return {name: setting for setting, name in names.items()}


def measure_recall(
    config: SearchConfig,
    settings: Mapping[str, ProposalSetting],
    order: ProposalOrder,
    workers: int = 1,
) -> dict[str, ProposalRecall]:
    """Return the recall of each setting over all frames of a search.

    Raises:
        PerceptionError: a frame cannot be read.
    """
    chunks = config.survey.chunks(config.chunk_frames)
    collect = partial(
        collect_proposals,
        settings=tuple(settings.values()),
        order=order,
        on_bad_frame=config.on_bad_frame,
    )
    collected = run_parts(collect, chunks, workers)
    bar = tqdm(collected, "recall", len(chunks), unit="part", file=sys.stderr, delay=2)
    by_chunk = dict(bar)
    frames = [frame for chunk in chunks for frame in by_chunk[chunk]]
    truths = TrueBoxes.of_frames([frame.labels for frame in frames])
    recalls = {}
    for number, name in enumerate(settings):
        proposals = DetectedBoxes.of_frames([frame.proposals[number] for frame in frames])
        boxes = pair_boxes(truths, proposals, len(frames))
        recalls[name] = proposal_recall(boxes, config.survey.of_class, config.overlaps)
    return recalls


def collect_proposals(
    chunk: FrameSet,
    settings: Sequence[ProposalSetting],
    order: ProposalOrder,
    on_bad_frame: OnBadFrame = "stop",
) -> list[FrameProposals]:
    """Return the labels and the proposals of each frame that can be read."""
    drive = chunk.open()
    read = ((index, read_or_skip(drive, index, on_bad_frame)) for index in chunk.frames)
    return [
        FrameProposals(
            drive.labels(index),
            tuple(_propose(frame, setting, order) for setting in settings),
        )
        for index, frame in read
        if frame is not None
    ]


def _propose(frame: Frame, setting: ProposalSetting, order: ProposalOrder) -> Detections:
    calibration, size_px = camera_of(frame)
    found = propose(frame.points_velo, calibration, size_px, setting.parameters, setting.method)
    scores = order_scores(order, found, float(calibration.image_P_cam[0, 0]))
    return Detections(found.boxes_px, scores, np.full(len(found), "proposal"))
