"""Proposed labels of the objects of a drive, what is unsure about each, and the file that holds them."""

import json
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
from perception.errors import LabelError
from perception.geometry.box_overlap import iou_bev
from perception.tracking.vehicles.class_sizes import CLASS_SIZES
from perception.types import Boxes3D, Float64, Int

FILE_NAME = "proposals.json"
MIN_SCORE = 0.1  # of an observation
_FORMAT = "trifuse proposals 1"
_MISSED = 0.1  # score of a frame in which an object has returns, and is not detected
_MIN_RETURNS = 3  # of such a frame
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
        strong = np.sort(seen.scores)[len(seen) // 2 :]
        if _mean_score(strong) >= _MIN_CONFIDENCE:
            result.append(ObservedObject(seen, fit_trajectory(seen, frames, stamps_s)))
    return result


def to_proposals(objects: Sequence[ObservedObject]) -> list[Proposal]:
    """Return the proposals of objects whose returns are counted; of two at one place the surer one."""
    found = [one for one in map(_to_proposal, objects) if one is not None]
    found.sort(key=lambda one: -one.confidence)
    kept: list[Proposal] = []
    for one in found:
        if not any(_are_same(one, other) for other in kept):
            kept.append(one)
    return [replace(one, number=number) for number, one in enumerate(kept, start=1)]


def _to_proposal(one: ObservedObject) -> Proposal | None:
    seen, trajectory = one.seen, one.trajectory
    points = np.array([one.points.get(frame, 0) for frame in trajectory.frames.tolist()], np.int64)
    score_of = dict(zip(seen.frames.tolist(), seen.scores.tolist(), strict=True))
    scores = np.array([score_of.get(one, _MISSED) for one in trajectory.frames.tolist()])
    confidence = _mean_score(scores[trajectory.is_observed | (points >= _MIN_RETURNS)])
    is_labelled = points > 0
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


def _mean_score(scores: Float64) -> float:
    """Return the probability of the mean log-odds of scores."""
    if not len(scores):
        return 0.0
    clipped = np.clip(scores, 0.01, 0.99)
    return float(1 / (1 + np.exp(-np.log(clipped / (1 - clipped)).mean())))


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
    """

    proposals: Sequence[Proposal]
    poses: Mapping[int, Float64]

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
        write_json(folder / FILE_NAME, {"format": _FORMAT, "poses": poses, "objects": objects})

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
            return cls([_proposal_of(one) for one in document["objects"]], poses)
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
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        found = f"no whole JSON ({error})"
        raise LabelError(path, expected=what, found=found, advice=advice) from error
    if not isinstance(document, dict) or document.get("format") != form:
        raise LabelError(path, expected=f"{what}, {form}", found="another document", advice=advice)
    return document
