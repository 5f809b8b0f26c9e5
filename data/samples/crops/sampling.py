"""Crops of labelled frames: every proposal, and jittered boxes of labelled objects."""

import logging
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from data.samples.crops.config import CropSamplingConfig
from data.samples.crops.labelled_frames import CropConfig, LabelledFrames, ProposalScene
from data.samples.labelled_parts import require_classes
from perception.detection.depthcn.crops import WindowKind, windows_px
from perception.errors import DriveError, LabelError, PerceptionError
from perception.evaluation.detection.protocol import kitti_class
from perception.geometry.box_overlap_px import intersection_over_area_px, iou_px
from perception.types import ArrayTable, Bool, Float32, Float64, Int, OnBadFrame, Progress

_MIN_SHARE = 0.5  # of an object's points within the label
_MAX_SHARE = 0.1  # of a negative's: a wall that a car touches, but not half a car
_MIN_IOU, _MAX_IOU = 0.5, 0.3  # the same for 2D boxes
_MAX_UNLABELLED = 0.5  # of a proposal's box within a DontCare region
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ProposalMatches:
    """Labels of the P proposals of one frame.

    Attributes:
        labels: (P,) row of the matching label, -1 of others.
        is_left_out: (P,) mask of the ambiguous, which are neither positives nor negatives.
    """

    labels: Int
    is_left_out: Bool


def match_by_points(scene: ProposalScene, classes: Sequence[str]) -> ProposalMatches:
    """Match proposals with at least half of their points in the 3D box of an object of the classes."""
    return _match(scene, classes, scene.shares, (_MIN_SHARE, _MAX_SHARE))


def match_by_boxes(scene: ProposalScene, classes: Sequence[str]) -> ProposalMatches:
    """Match proposals by the IoU of 2D boxes, as the thesis does."""
    overlap = iou_px(scene.boxes_px, scene.label_boxes_px)
    return _match(scene, classes, overlap, (_MIN_IOU, _MAX_IOU))


# The thesis' network sees the proposal's box alone, so that only boxes can be compared.
MATCHERS: Mapping[WindowKind, Callable[[ProposalScene, Sequence[str]], ProposalMatches]] = {
    "metric": match_by_points,
    "box": match_by_boxes,
}


def _match(
    scene: ProposalScene, classes: Sequence[str], overlap: Float64, limits: tuple[float, float]
) -> ProposalMatches:
    """Match by a (P, L) overlap: positives from the first limit on, negatives up to the second."""
    positive, negative = limits
    # Too similar to be negatives; KITTI's benchmark does not count them either way.
    neighbours = {name for one in classes for name in kitti_class(one).neighbours} - {*classes}
    of_class = np.where(np.isin(scene.label_types, classes), overlap, 0.0)
    of_neighbour = np.where(np.isin(scene.label_types, [*neighbours]), overlap, 0.0)
    best = of_class.max(axis=1, initial=0.0)
    is_object = (best >= positive) & (best >= of_neighbour.max(axis=1, initial=0.0))
    labels = np.full(len(best), -1)
    labels[is_object] = of_class[is_object].argmax(axis=1) if is_object.any() else -1
    near_either = np.maximum(best, of_neighbour.max(axis=1, initial=0.0)) > negative
    unlabelled = intersection_over_area_px(scene.boxes_px, scene.dont_care_px)
    in_region = unlabelled.max(axis=1, initial=0.0) > _MAX_UNLABELLED
    return ProposalMatches(labels, np.asarray((near_either | in_region) & ~is_object))


@dataclass(frozen=True)
class CropSet(ArrayTable):
    """M crops of many frames, without their pixels.

    Attributes:
        frames: (M,) number of the frame of each.
        windows_px: (M, 4) x1 y1 x2 y2 of the crops in the image.
        depths_m: (M,) depth of the objects.
        classes: (M,) number of the object's class, -1 of others.
        boxes_px: (M, 4) x1 y1 x2 y2 of the object's label, NaN of others.
        is_jittered: (M,) mask of the jittered labels; the others are proposals.
    """

    frames: Int
    windows_px: Annotated[Float32, 4]
    depths_m: Float32
    classes: Int
    boxes_px: Annotated[Float32, 4]
    is_jittered: Bool

    @property
    def is_vehicle(self) -> Bool:
        """(M,) mask of the objects of the classes."""
        return np.asarray(self.classes >= 0)

    def require_both_classes(self, where: str) -> None:
        """Validate that there are vehicles and others.

        Raises:
            LabelError: there is no vehicle, or nothing else.
        """
        vehicles = int(self.is_vehicle.sum())
        if 0 < vehicles < len(self):
            return
        lacking = "negatives" if vehicles else "vehicles that the LiDAR observes"
        raise LabelError(
            where,
            expected=f"crops of both classes, {lacking} among them",
            found=f"{vehicles} vehicles and {len(self) - vehicles} others",
            advice="add drives",
        )


def collect_crops(
    frames: LabelledFrames,
    config: CropSamplingConfig,
    *,
    on_bad_frame: OnBadFrame = "stop",
    seed: int = 0,
    progress: Progress = iter,
) -> CropSet:
    """Collect the crops of all frames.

    Args:
        frames: Frames with proposals and labels.
        config: Jittered labels that are added.
        on_bad_frame: Stop at a damaged frame, or skip it with a warning.
        seed: Seed of the jitter.
        progress: Wrapper of the loop over frames that may show its progress.

    Raises:
        DriveError: there is no frame, or a drive has no labels.
        LabelError: no vehicle is labelled, or a label cannot be read.
        PerceptionError: a frame cannot be read, and `on_bad_frame` is "stop".
    """
    if not len(frames):
        raise DriveError("crops", expected="labelled frames", found="none")
    parts, types = [], Counter[str]()
    for number in progress(range(len(frames))):
        try:
            scene = frames.scene(number)
            frames.image(number)  # computed here, where the progress is shown
        except LabelError:
            raise
        except PerceptionError as error:
            if on_bad_frame == "stop":
                raise
            log.warning("skipped frame %s: %s", frames.name(number), error)
            continue
        types.update(scene.label_types.tolist())
        rng = np.random.default_rng([seed, number])
        crop = frames.config
        parts += [_proposed(scene, number, crop), _jittered(scene, number, crop, config, rng)]
    require_classes(frames.config.classes, types, f"labels of {len(parts) // 2} frames")
    return CropSet.concatenate(parts)


def _proposed(scene: ProposalScene, number: int, crop: CropConfig) -> CropSet:
    matches = MATCHERS[crop.window](scene, crop.classes)
    rows = np.flatnonzero(~matches.is_left_out)
    labels = matches.labels[rows]
    windows = windows_px(crop.window, scene.boxes_px[rows], scene.depths_m[rows], scene.focal_px)
    return CropSet(
        frames=np.full(len(rows), number),
        windows_px=windows.astype(np.float32),
        depths_m=scene.depths_m[rows].astype(np.float32),
        **_objects(scene, labels, crop),
        is_jittered=np.zeros(len(rows), bool),
    )


def _jittered(
    scene: ProposalScene,
    number: int,
    crop: CropConfig,
    config: CropSamplingConfig,
    rng: np.random.Generator,
) -> CropSet:
    """Return labelled objects of the classes that the LiDAR observes, proposed or not, with jittered boxes."""
    is_of_class = np.isin(scene.label_types, crop.classes)
    is_observed = is_of_class & (scene.label_points >= config.min_points)
    rows = np.repeat(
        np.flatnonzero(is_observed & np.isfinite(scene.label_depths_m)), config.jittered_copies
    )
    boxes_px, depths_m = scene.label_boxes_px[rows], scene.label_depths_m[rows]
    size = np.tile(boxes_px[:, 2:] - boxes_px[:, :2], 2)
    moved = boxes_px + rng.uniform(-config.max_jitter, config.max_jitter, boxes_px.shape) * size
    windows = windows_px(crop.window, moved, depths_m, scene.focal_px)
    return CropSet(
        frames=np.full(len(rows), number),
        windows_px=windows.astype(np.float32),
        depths_m=depths_m.astype(np.float32),
        **_objects(scene, rows, crop),
        is_jittered=np.ones(len(rows), bool),
    )


def _objects(scene: ProposalScene, labels: Int, crop: CropConfig) -> dict[str, np.ndarray]:
    """Return classes and boxes of (M,) rows of labels, -1 of others."""
    classes, boxes_px = np.full(len(labels), -1), np.full((len(labels), 4), np.nan, np.float32)
    found = labels >= 0
    number_of = {name: number for number, name in enumerate(crop.classes)}
    classes[found] = [number_of[name] for name in scene.label_types[labels[found]].tolist()]
    boxes_px[found] = scene.label_boxes_px[labels[found]]
    return {"classes": classes, "boxes_px": boxes_px}
