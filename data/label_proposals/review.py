"""Decisions of a person on proposals, and the labels that follow from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from data.box_labels.boxes import LabelledFrame
from data.box_labels.written_frames import labelled_frame
from data.label_proposals.proposals import Proposal, ProposalFile, read_document
from data.labelled_objects import labels_of_boxes
from data.recorded_drive import RecordedDrive
from perception.detection.bev.classes import BEV_CLASSES
from perception.errors import LabelError
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse
from perception.types import Boxes3D, Labels

REVIEW_FORMAT = "trifuse review 1"
FILE_NAME = "review.json"
DECISIONS = ("accept", "reject")


@dataclass(frozen=True)
class Decision:
    """What a person decided on an object.

    Attributes:
        decision: "accept", "reject", or empty for none.
        kind: Class in place of the proposed one, or empty.
        where: Where it stands, for errors.
    """

    decision: str = ""
    kind: str = ""
    where: str = "review"


def read_review(path: Path, drive: str | None = None) -> Mapping[int, Decision]:
    """Return the decisions of a file by the number of the object.

    Args:
        path: File.
        drive: Name of the drive that they must be on where they name one.

    Raises:
        LabelError: It is missing or damaged, is on another drive, or has another decision.
    """
    advice = "save it in review.html"
    document = read_document(path, REVIEW_FORMAT, "decisions of a review", advice)
    named = document.get("drive", drive)
    if drive not in (None, named):
        expected, found = f"decisions on {drive}", f"some on {named}"
        raise LabelError(path, expected=expected, found=found, advice="review these proposals")
    result = {}
    objects = document.get("objects") or {}
    if not isinstance(objects, dict):
        expected, found = "objects by their numbers", "others"
        raise LabelError(path, expected=expected, found=found, advice=advice)
    for number, one in objects.items():
        where = f"{path} object {number}"
        decision = one.get("decision", "") if isinstance(one, dict) else one
        if not number.isdecimal() or decision not in ("", *DECISIONS):
            expected = f"a number with one of {', '.join(DECISIONS)}"
            raise LabelError(where, expected=expected, found=repr(decision))
        kind = one.get("type", "") if isinstance(one, dict) else ""
        result[int(number)] = Decision(str(decision), str(kind), where)
    return result


def reviewed(
    proposals: Sequence[Proposal], decisions: Mapping[int, Decision], min_confidence: float
) -> list[Proposal]:
    """Return the proposals that are labels: those that were accepted, and of the others the confident boxes.

    Args:
        proposals: Proposals.
        decisions: Decisions by the number of the object.
        min_confidence: Confidence from which a box is a label without a decision.

    Raises:
        LabelError: A decision is on no proposal, or names an unknown class.
    """
    numbers = {one.number for one in proposals}
    if unknown := sorted(decisions.keys() - numbers):
        expected, found = f"decisions on objects 1 to {len(numbers)}", f"one on {unknown[0]}"
        where, advice = decisions[unknown[0]].where, "review these proposals"
        raise LabelError(where, expected=expected, found=found, advice=advice)
    classes, result = known_classes(proposals), []
    for one in proposals:
        decision = decisions.get(one.number, Decision())
        if (kind := decision.kind or one.kind) not in classes:
            expected = f"a type of {', '.join(classes)}"
            raise LabelError(decision.where, expected=expected, found=kind)
        is_label = (one.box_confidences >= min_confidence) | (decision.decision == "accept")
        if is_label.any() and decision.decision != "reject":
            result.append(replace(one.select(is_label), kind=kind))
    return result


def known_classes(proposals: Sequence[Proposal]) -> list[str]:
    """Return the classes that a person may choose."""
    return sorted({*BEV_CLASSES, *(one.kind for one in proposals)})


def labelled_frames(
    drive: RecordedDrive, file: ProposalFile, labels: Sequence[Proposal]
) -> list[LabelledFrame]:
    """Return every frame that was read with the boxes of its labels.

    Args:
        drive: Drive of the frames.
        file: Proposals with their poses.
        labels: Those that are labels.
    """
    around = labels_by_frame(file, labels).items()
    return [labelled_frame(drive, frame, one, file.poses[frame]) for frame, one in around]


def labels_by_frame(file: ProposalFile, labels: Sequence[Proposal]) -> dict[int, Labels]:
    """Return the labels of every frame that was read, in the LiDAR frame; arguments as of `labelled_frames`."""
    rows: dict[int, list[tuple[Proposal, int]]] = {frame: [] for frame in file.poses}
    for one in labels:
        for row, frame in enumerate(one.frames.tolist()):
            rows[frame].append((one, row))
    result = {}
    for frame, ones in rows.items():
        boxes_world = Boxes3D.concatenate(one.boxes_world[row : row + 1] for one, row in ones)
        boxes_velo = transform_boxes(inverse(file.poses[frame]), boxes_world)
        numbers = np.array([one.number for one, _ in ones], np.int64)
        result[frame] = labels_of_boxes(boxes_velo, [one.kind for one, _ in ones], numbers)
    return result
