"""The numbers of KITTI's object benchmark: what is looked for, and how hard it may be to see.

A. Geiger, P. Lenz, R. Urtasun, "Are we ready for autonomous driving? The KITTI vision benchmark suite",
CVPR 2012; the limits are those of its development kit.
"""

from dataclasses import dataclass, replace

from perception.errors import UsageError

DONT_CARE = "dontcare"
NO_ALPHA_RAD = -10.0  # what a detector writes that does not tell the heading
_STRICT_IOU = 0.7  # of classes that KITTI does not judge
RECALL_STEPS = 40  # a curve has a point at each of 0, 1/40 .. 1


@dataclass(frozen=True)
class Difficulty:
    """How well an object must be seen to count.

    Attributes:
        name: as in KITTI's tables.
        min_height_px: an object must be higher, a detection not lower.
        max_occlusion: level 0 to 3 as labelled.
        max_truncation: share outside the image, 0 to 1.
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


@dataclass(frozen=True)
class DetectionClass:
    """What is looked for; names of types are compared without case.

    Attributes:
        name: type of the objects.
        iou: by which a detection must overlap an object, and more.
        neighbours: types so alike that to detect them is neither right nor wrong.
    """

    name: str
    iou: float
    neighbours: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse an overlap that nothing or everything reaches."""
        if not 0 <= self.iou < 1:
            raise UsageError("iou", expected="from 0 to below 1", found=f"{self.iou:g}")

    def at_iou(self, iou: float) -> "DetectionClass":
        """Return the same class, judged at another overlap."""
        return replace(self, iou=iou)


KITTI_CLASSES = (
    DetectionClass("Car", iou=0.7, neighbours=("Van",)),
    DetectionClass("Pedestrian", iou=0.5, neighbours=("Person_sitting",)),
    DetectionClass("Cyclist", iou=0.5),
)


def kitti_class(name: str) -> DetectionClass:
    """Return a class as KITTI judges it; one that it does not, as strictly as cars."""
    known = {one.name.lower(): one for one in KITTI_CLASSES}
    return known.get(name.lower(), DetectionClass(name, _STRICT_IOU))
