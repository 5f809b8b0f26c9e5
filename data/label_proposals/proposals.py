"""Proposed labels of the objects of a drive, what is unsure about each, and the file that holds them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from data.kitti.reading import read_text
from data.label_proposals.association import link
from data.label_proposals.observations import Observations
from data.label_proposals.trajectory import ObjectTrajectory, fit_trajectory
from data.results.documents import write_json
from perception.detection.bev.classes import GROUPS
from perception.errors import LabelError
from perception.geometry.box_overlap import iou_bev
from perception.json_text import read_json_text
from perception.tracking.vehicles.class_sizes import CLASS_SIZES
from perception.tracking.vehicles.evidence import log_odds, probability
from perception.types import Bool, Boxes3D, Float64, Int

FILE_NAME = "proposals.json"
MIN_SCORE = 0.1  # of an observation
_FORMAT = "trifuse proposals 1"
_MIN_RETURNS = 3  # of a frame in which an object is visible
# Log-odds of an object: by the mean log-odds of the better half of its observations, the logarithm of the number of
# distinct ones, and their share of the frames in which it is visible; the last is a constant.
_OF_VEHICLES = np.array([1.0, 0.8, 4.0, -5.3])
_OF_PEOPLE = np.array([0.8, 0.8, 8.0, -8.5])  # posts are found now and then
# By which a box without the object gains returns: of the greatest likelihood on synthetic drives of four sensors, for vehicles
# and for people.
_STRAY_RETURNS = 0.5
_ALIKE_S = 0.6  # in which detections of one object err alike
_LEAST = 0.02  # score at which log-odds end
_MIN_CONFIDENCE = 0.1  # of a proposal that is kept at all
_SAME_IOU = 0.2
_UNSURE = (0.3, 0.8)  # confidences
_FEW_RETURNS, _FEW_FRAMES = 10, 3
_MIXED_SHARE = 0.7  # of the commonest class
_ODD_SIZE = 3.0  # deviations of a class


@dataclass(frozen=True)
class Proposal:
    """Proposed labels of one object.

    Attributes:
        number: Number of the object, from 1.
        kind: Class.
        confidence: Probability that it is an object, 0 to 1.
        is_moving: Whether it ever moves.
        frames: (K,) indices of the frames with a label.
        boxes_world: (K) its boxes in the world frame.
        points: (K,) number of returns in each.
        best_frame: Frame in which it is detected best.
        reasons: What a person should look at, in words.
    """

    number: int
    kind: str
    confidence: float
    is_moving: bool
    frames: Int
    boxes_world: Boxes3D
    points: Int
    best_frame: int
    reasons: tuple[str, ...] = ()

    @property
    def box_confidences(self) -> Float64:
        """(K,) Probability that each box is right, 0 to 1: that of the object, and that its returns are of it."""
        return np.asarray(self.confidence * self.points / (self.points + _STRAY_RETURNS))

    def select(self, rows: Bool) -> Self:
        """Return the object in some of its frames, by (K,) whether it is one of them."""
        return replace(
            self,
            frames=self.frames[rows],
            boxes_world=self.boxes_world[rows],
            points=self.points[rows],
        )

    @property
    def urgency(self) -> float:
        """How much a look is worth: high where it is unsure, and has many frames."""
        doubt = 1 - abs(2 * self.confidence - 1) + 0.5 * len(self.reasons)
        return float(doubt * np.sqrt(len(self.frames)))


@dataclass(frozen=True)
class ObservedObject:
    """An object before the returns in its boxes are counted.

    Attributes:
        seen: Its observations.
        trajectory: Its boxes.
        points: Number of returns by frame, filled in from the scans.
    """

    seen: Observations
    trajectory: ObjectTrajectory
    points: dict[int, int] = field(default_factory=dict)


def observed_objects(
    observations: Observations, frames: Int, stamps_s: Float64
) -> list[ObservedObject]:
    """Return the objects of a drive.

    Args:
        observations: What was found.
        frames: (F,) indices of the frames.
        stamps_s: (F,) their times.
    """
    result = []
    for rows in link(observations):
        seen = observations[rows]
        if _confidence(seen, 0) >= _MIN_CONFIDENCE:
            result.append(ObservedObject(seen, fit_trajectory(seen, frames, stamps_s)))
    return result


def to_proposals(objects: Sequence[ObservedObject]) -> list[Proposal]:
    """Return the proposals of objects whose returns are counted; of two at one place the surer one."""
    found = [one for one in map(_to_proposal, objects) if one is not None]
    found.sort(key=lambda one: -one.confidence)
    # Objects whose times and surroundings do not meet are not compared.
    lows = np.array([_reach(one, -1.0).min(axis=0) for one in found]).reshape(-1, 3)
    highs = np.array([_reach(one, 1.0).max(axis=0) for one in found]).reshape(-1, 3)
    kept: list[int] = []
    for row, one in enumerate(found):
        meet = (lows[kept] <= highs[row]).all(axis=1) & (highs[kept] >= lows[row]).all(axis=1)
        if not any(_are_same(one, found[kept[other]]) for other in np.flatnonzero(meet)):
            kept.append(row)
    return [replace(found[row], number=number) for number, row in enumerate(kept, start=1)]


def _reach(one: Proposal, side: float) -> Float64:
    """Return (K, 3) frames and ends of the surroundings of an object on one side."""
    ends_m = one.boxes_world.bottom_m[:, :2] + side * one.boxes_world.size_m[:, :1] / 2
    return np.column_stack([one.frames, ends_m])


def _to_proposal(one: ObservedObject) -> Proposal | None:
    seen, trajectory = one.seen, one.trajectory
    points = np.array([one.points.get(frame, 0) for frame in trajectory.frames.tolist()], np.int64)
    is_reached = _are_reached(trajectory.is_observed, points >= _MIN_RETURNS)
    is_missed = is_reached & ~trajectory.is_observed & (points >= _MIN_RETURNS)
    confidence = _confidence(seen, int(is_missed.sum()))
    is_labelled = (points > 0) & is_reached
    if confidence < _MIN_CONFIDENCE or not is_labelled.any():
        return None
    weights: dict[str, float] = {}
    for kind, score in zip(seen.types.tolist(), seen.scores.tolist(), strict=True):
        weights[kind] = weights.get(kind, 0.0) + score**2
    kind = max(weights, key=lambda name: weights[name])
    share = weights[kind] / sum(weights.values())
    frames, boxes = trajectory.frames[is_labelled], trajectory.boxes_world[is_labelled]
    reasons = _reasons(kind, share, confidence, boxes, points[is_labelled])
    best = int(seen.frames[seen.scores.argmax()])
    moves = trajectory.is_moving
    return Proposal(0, kind, confidence, moves, frames, boxes, points[is_labelled], best, reasons)


def _are_reached(is_observed: Bool, is_visible: Bool) -> Bool:
    """Return whether each frame is between the first and the last observation, or visible up to one of them."""
    first, last = np.flatnonzero(is_observed)[[0, -1]]
    result = np.ones(len(is_observed), bool)
    result[:first] = np.logical_and.accumulate(is_visible[:first][::-1])[::-1]
    result[last + 1 :] = np.logical_and.accumulate(is_visible[last + 1 :])
    return result


def _reasons(
    kind: str, share: float, confidence: float, boxes: Boxes3D, points: Int
) -> tuple[str, ...]:
    size = CLASS_SIZES.get(kind.lower())
    is_odd = size is not None and any(
        abs(value - one.mean_m) > _ODD_SIZE * one.deviation_m
        for value, one in zip(boxes.size_m[0], (size.length, size.width, size.height), strict=True)
    )
    known = {
        "unsure": _UNSURE[0] < confidence < _UNSURE[1],
        f"class unsure, {kind} in {share:.0%}": share < _MIXED_SHARE,
        f"unusual size of a {kind.lower()}": is_odd,
        "few returns": int(points.max(initial=0)) < _FEW_RETURNS,
        "few frames": len(points) < _FEW_FRAMES,
    }
    return tuple(reason for reason, holds in known.items() if holds)


def _confidence(seen: Observations, missed: int) -> float:
    """Return the probability of an object by its observations, and the number of frames that lack one."""
    odds = log_odds(np.sort(seen.scores)[len(seen) // 2 :], _LEAST).mean()
    distinct = 1 + (seen.stamps_s[-1] - seen.stamps_s[0]) / _ALIKE_S
    share = len(seen) / (len(seen) + missed)
    weights = _OF_VEHICLES if seen.groups[0] == GROUPS["Car"] else _OF_PEOPLE
    facts = np.array([odds, np.log(min(len(seen), distinct)), share, 1.0])
    return float(probability(weights @ facts))


def _are_same(one: Proposal, other: Proposal) -> bool:
    """Return whether two objects overlap in half of the frames of the first."""
    shared, rows, others = np.intersect1d(one.frames, other.frames, return_indices=True)
    if 2 * len(shared) < len(one.frames):
        return False
    step = max(len(shared) // 8, 1)  # some frames tell
    rows, others = rows[::step], others[::step]
    a, b = one.boxes_world[rows], other.boxes_world[others]
    near_m = np.linalg.norm(a.bottom_m[:, :2] - b.bottom_m[:, :2], axis=1)
    reach_m = (a.size_m[:, 0] + b.size_m[:, 0]) / 2
    if (near_m > reach_m).mean() > 0.5:
        return False
    overlaps = np.array([iou_bev(a[k : k + 1], b[k : k + 1])[0, 0] for k in range(len(rows))])
    return bool((overlaps > _SAME_IOU).mean() > 0.5)


@dataclass(frozen=True)
class ProposalFile:
    """Proposals of a drive with the poses in which their boxes are.

    Attributes:
        proposals: Proposals.
        poses: (4, 4) pose of the LiDAR in each frame that was read.
        names: Name of each of these frames.
    """

    proposals: Sequence[Proposal]
    poses: Mapping[int, Float64]
    names: Mapping[int, str] = field(default_factory=dict)

    def write(self, folder: Path) -> None:
        """Write the file into a folder."""
        objects = [
            {
                "number": one.number, "type": one.kind, "confidence": round(one.confidence, 4),
                "is_moving": one.is_moving, "reasons": list(one.reasons), "best_frame": one.best_frame,
                "frames": one.frames, "points": one.points,
                "boxes": np.column_stack([one.boxes_world.bottom_m, one.boxes_world.size_m, one.boxes_world.yaw_rad]).round(4),
            }
            for one in self.proposals
        ]  # fmt: skip
        poses = {str(frame): pose[:3].ravel() for frame, pose in self.poses.items()}
        names = {str(frame): name for frame, name in self.names.items()}
        document = {"format": _FORMAT, "poses": poses, "names": names, "objects": objects}
        write_json(folder / FILE_NAME, document)

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the file of a folder.

        Raises:
            LabelError: It is missing, or damaged.
        """
        path, advice = folder / FILE_NAME, "make it with: trifuse label"
        document = read_document(path, _FORMAT, "proposals", advice)
        try:
            poses = {
                int(frame): np.vstack([np.reshape(pose, (3, 4)), [0.0, 0.0, 0.0, 1.0]])
                for frame, pose in document["poses"].items()
            }
            names = {int(frame): str(name) for frame, name in document.get("names", {}).items()}
            return cls([_proposal_of(one) for one in document["objects"]], poses, names)
        except (KeyError, TypeError, ValueError) as error:
            found = f"other entries ({error!r})"
            raise LabelError(path, expected="proposals", found=found, advice=advice) from error


def _proposal_of(one: Mapping[str, Any]) -> Proposal:
    boxes = np.array(one["boxes"], np.float64).reshape(-1, 7)
    return Proposal(
        int(one["number"]),
        str(one["type"]),
        float(one["confidence"]),
        bool(one["is_moving"]),
        np.array(one["frames"], np.int64),
        Boxes3D(boxes[:, :3], boxes[:, 3:6], boxes[:, 6]),
        np.array(one["points"], np.int64),
        int(one["best_frame"]),
        tuple(map(str, one["reasons"])),
    )


def read_document(path: Path, form: str, what: str, advice: str) -> dict[str, Any]:
    """Return a JSON document of a format of ours.

    Args:
        path: File.
        form: Its format.
        what: What it holds, for the error.
        advice: What to do without it.

    Raises:
        LabelError: It is missing, damaged, or of another format.
    """
    text = read_text(path, LabelError, what, advice)
    try:
        document = read_json_text(text)
    except ValueError as error:
        found = f"no whole JSON ({error})"
        raise LabelError(path, expected=what, found=found, advice=advice) from error
    if not isinstance(document, dict) or document.get("format") != form:
        raise LabelError(path, expected=f"{what}, {form}", found="another document", advice=advice)
    return document
