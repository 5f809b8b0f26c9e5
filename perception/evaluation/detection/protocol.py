"""Classes and difficulties of KITTI's object benchmark.

A. Geiger, P. Lenz, R. Urtasun, "Are we ready for autonomous driving? The KITTI vision benchmark suite",
CVPR 2012; the limits are those of its development kit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from perception.errors import UsageError

DONT_CARE = "dontcare"
NO_ALPHA_RAD = -10.0  # observation angle of a detection without a heading
# IoU thresholds of classes that KITTI does not evaluate, and the loose one of their 3D boxes
_STRICT_IOU, _LOOSE_IOU = 0.7, 0.5
RECALL_STEPS = 40  # a curve has a point at each of 0, 1/40 .. 1


@dataclass(frozen=True)
class Difficulty:
    """Limits within which an object must be detected.

    Attributes:
        name: Name as in KITTI's tables.
        min_height_px: Height of the box that an object must exceed and a detection must reach, in pixels.
        max_occlusion: Maximum occlusion level, 0 to 3.
        max_truncation: Maximum share outside the image, 0 to 1.
    """

    name: str
    min_height_px: float
    max_occlusion: int
    max_truncation: float


DIFFICULTIES = (
    Difficulty("easy", min_height_px=40, max_occlusion=0, max_truncation=0.15),
    Difficulty("moderate", min_height_px=25, max_occlusion=1, max_truncation=0.30),
    Difficulty("hard", min_height_px=25, max_occlusion=2, max_truncation=0.50),
)
LEVELS = tuple(one.name for one in DIFFICULTIES)


@dataclass(frozen=True)
class DetectionClass:
    """Object class of the metrics; names are compared without case.

    Attributes:
        name: Name of the class in labels and detections.
        iou: IoU that a detection must exceed to match an object, 0 to below 1.
        neighbours: Names of similar classes, whose detection is neither right nor wrong.
        loose_iou: Lower IoU that is usual for 3D boxes besides the strict one, from above and in space.
    """

    name: str
    iou: float
    neighbours: tuple[str, ...] = ()
    loose_iou: float = _LOOSE_IOU

    def __post_init__(self) -> None:
        """Validate the IoU."""
        if not 0 <= self.iou < 1:
            raise UsageError("iou", expected="from 0 to below 1", found=f"{self.iou:g}")

    def at_iou(self, iou: float) -> "DetectionClass":
        """Return the class with another IoU."""
        return replace(self, iou=iou)


KITTI_CLASSES = (
    DetectionClass("Car", iou=0.7, neighbours=("Van",)),
    DetectionClass("Pedestrian", iou=0.5, neighbours=("Person_sitting",), loose_iou=0.25),
    DetectionClass("Cyclist", iou=0.5, loose_iou=0.25),
)


def kitti_class(name: str) -> DetectionClass:
    """Return a class with KITTI's IoU; 0.7 of a class that KITTI does not evaluate."""
    known = {one.name.lower(): one for one in KITTI_CLASSES}
    return known.get(name.lower(), DetectionClass(name, _STRICT_IOU))


def class_of_name(name: str, ious: Sequence[float]) -> DetectionClass:
    """Return a class by its name in any case.

    Raises:
        UsageError: KITTI has no such class, and no IoU is named.
    """
    for known in KITTI_CLASSES:
        if known.name.lower() == name.lower():
            return known
    if not ious:
        raise UsageError(
            "--classes",
            expected=", ".join(known.name for known in KITTI_CLASSES),
            found=name,
            advice="name any other class together with --iou",
        )
    return DetectionClass(name, ious[0])
