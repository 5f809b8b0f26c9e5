"""From labelled frames to candidates: every proposal, and the boxes of vehicles shaken a little."""

import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from data.crops.labelled_frames import LabelledFrames, ProposalScene
from data.crops.matching import MATCHERS, VEHICLE
from data.frames import OnBadFrame
from perception.detection.depthcn.windows import WindowKind, windows_px
from perception.errors import DriveError, LabelError, PerceptionError, UsageError
from perception.types import Bool, Float32, Float64, Int, Progress

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class CropSamplingConfig:
    """What becomes a candidate.

    Attributes:
        window: which part of the picture the network sees of it; it also decides who is a vehicle.
        jittered_copies: how often the box of each labelled vehicle is added beside the proposals.
        max_jitter: how far the edges of such a box move at most, as a share of its size.
        min_points: returns on a vehicle that is added; with fewer there is little to learn from.
        on_bad_frame: stop at a frame that cannot be read, or skip it.
        seed: of the shaking.
    """

    window: WindowKind = "metric"
    jittered_copies: int = 2
    max_jitter: float = 0.1
    min_points: int = 20
    on_bad_frame: OnBadFrame = "stop"
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what cannot be done, or would move a box off its vehicle."""
        if self.jittered_copies < 0 or not 0 <= self.max_jitter <= 0.25 or self.min_points < 1:
            raise UsageError(
                "rules of gathering",
                expected="shaken >= 0, shake from 0 to 0.25, min_points >= 1",
                found=f"{self.jittered_copies}, {self.max_jitter:g}, {self.min_points}",
            )


@dataclass(frozen=True)
class CropSet:
    """M candidates of many frames, without their pixels.

    Attributes:
        frames: (M,) number of the frame.
        windows_px: (M, 4) x1 y1 x2 y2 that the network sees.
        depths_m: (M,) how far they are.
        is_vehicle: (M,).
        boxes_px: (M, 4) of the vehicle's label, NaN of others.
        is_jittered: (M,) whether it is a shaken label, not a proposal.
    """

    frames: Int
    windows_px: Float32
    depths_m: Float32
    is_vehicle: Bool
    boxes_px: Float32
    is_jittered: Bool

    def __len__(self) -> int:
        """Return M."""
        return len(self.frames)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the candidates of a mask, of indices, or of a slice."""
        return type(self)(*(getattr(self, field.name)[rows] for field in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the candidates of all parts, one part after the other."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def require_both_classes(self, where: str) -> None:
        """Refuse a set from which nothing could be learned, or by which nothing could be judged.

        Raises:
            LabelError: there is no vehicle, or nothing else.
        """
        vehicles = int(self.is_vehicle.sum())
        if 0 < vehicles < len(self):
            return
        lacking = "things that are no vehicles" if vehicles else "vehicles that the LiDAR sees"
        raise LabelError(
            where,
            expected=f"candidates of both classes, {lacking} among them",
            found=f"{vehicles} vehicles and {len(self) - vehicles} others",
            advice="add drives",
        )


def collect_crops(
    frames: LabelledFrames, config: CropSamplingConfig, progress: Progress = iter
) -> CropSet:
    """Go through all frames.

    Args:
        frames: where the candidates are looked for.
        config: what becomes one.
        progress: goes through the numbers of the frames, and may show how far it is.

    Raises:
        DriveError: there is no frame, or a drive has no labels.
        LabelError: no vehicle is labelled, or a label cannot be read.
        PerceptionError: a frame cannot be read, and `rules.on_bad_frame` is "stop".
    """
    if not len(frames):
        raise DriveError("candidates", expected="labelled frames", found="none")
    parts, types = [], Counter[str]()
    for number in progress(range(len(frames))):
        try:
            scene = frames.scene(number)
            frames.image(number)  # made now, while a person waits and sees the progress
        except LabelError:
            raise
        except PerceptionError as error:
            if config.on_bad_frame == "stop":
                raise
            log.warning("skipped frame %d: %s", number, error)
            continue
        types.update(scene.label_types.tolist())
        parts.append(_crops(scene, number, config))
    _require_vehicles(types, len(parts))
    return CropSet.joined(parts)


def _require_vehicles(types: Counter[str], frames: int) -> None:
    if types[VEHICLE]:
        return
    others = ", ".join(f"{count} {name}" for name, count in types.most_common()) or "no object"
    raise LabelError(
        f"labels of {frames} frames",
        expected=f"at least one {VEHICLE}",
        found=f"{others}, a set that lacks the class",
        advice="choose drives with labelled cars",
    )


def _crops(scene: ProposalScene, number: int, config: CropSamplingConfig) -> CropSet:
    rng = np.random.default_rng([config.seed, number])
    return CropSet.joined(
        [_proposed(scene, number, config.window), _jittered(scene, number, config, rng)]
    )


def _proposed(scene: ProposalScene, number: int, kind: WindowKind) -> CropSet:
    matches = MATCHERS[kind](scene)
    rows = np.flatnonzero(~matches.is_left_out)
    labels = matches.labels[rows]
    boxes_px = np.full((len(rows), 4), np.nan)
    boxes_px[labels >= 0] = scene.label_boxes_px[labels[labels >= 0]]
    windows = windows_px(kind, scene.boxes_px[rows], scene.depths_m[rows], scene.focal_px)
    return _of_frame(number, windows, scene.depths_m[rows], boxes_px, is_jittered=False)


def _jittered(
    scene: ProposalScene, number: int, config: CropSamplingConfig, rng: np.random.Generator
) -> CropSet:
    """Add vehicles that the LiDAR sees whether or not they are proposed, with boxes a little off."""
    is_observed = (scene.label_types == VEHICLE) & (scene.label_points >= config.min_points)
    rows = np.repeat(
        np.flatnonzero(is_observed & np.isfinite(scene.label_depths_m)), config.jittered_copies
    )
    boxes_px, depths_m = scene.label_boxes_px[rows], scene.label_depths_m[rows]
    size = np.tile(boxes_px[:, 2:] - boxes_px[:, :2], 2)
    moved = boxes_px + rng.uniform(-config.max_jitter, config.max_jitter, boxes_px.shape) * size
    windows = windows_px(config.window, moved, depths_m, scene.focal_px)
    return _of_frame(number, windows, depths_m, boxes_px, is_jittered=True)


def _of_frame(
    number: int, windows: Float64, depths_m: Float64, boxes_px: Float64, *, is_jittered: bool
) -> CropSet:
    return CropSet(
        frames=np.full(len(windows), number),
        windows_px=windows.astype(np.float32),
        depths_m=depths_m.astype(np.float32),
        is_vehicle=np.asarray(np.isfinite(boxes_px).all(axis=1)),
        boxes_px=boxes_px.astype(np.float32),
        is_jittered=np.full(len(windows), is_jittered),
    )
