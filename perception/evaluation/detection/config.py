"""Settings and protocol of the detection metrics."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from perception.errors import UsageError
from perception.evaluation.detection.protocol import DIFFICULTIES

RECALL_POINTS = (11, 40)
PROTOCOL: Mapping[str, str] = {
    "name": "KITTI object benchmark: boxes in the image, from above (bev) and in space (3d), orientation",
    "similarity": "intersection over union, areas without + 1 pixel, above the IoU of the class",
    "objects": (
        "objects of the class within the limits of the difficulty on height, occlusion and truncation; others "
        "of the class and objects of its neighbour classes are ignored"
    ),
    "detections": (
        "detections below the minimum height are ignored, of any class; an unmatched detection with more than "
        "the IoU of its area in one DontCare region is no false positive"
    ),
    "3D boxes": (
        "rotated rectangles from above, and with their heights in space; the limits of the difficulty are those in the "
        "image; a DontCare region has no 3D box; at the IoU of the class, and at 0.5 of Car and others, 0.25 of "
        "Pedestrian and Cyclist; a class without 3D boxes is measured in the image alone"
    ),
    "orientation": (
        "AOS: true positives in the image weighted by (1 + cos of the error of alpha) / 2; none where a detection has "
        "no alpha"
    ),
    "precision": "at up to 41 scores of matched objects, each the maximum over this and all higher recalls",
    "averages": "R11: recall 0, 0.1 .. 1 (before October 2019); R40: recall 1/40 .. 1 (since then)",
    "intervals": "95 % percentile intervals over bootstrap resamples of the frames",
    "truncation": (
        "of tracking labels, level 0 counts at every difficulty, levels 1 and 2 at none: of the objects in both "
        "of KITTI's benchmarks, 97 % of level 0 are truncated by 0.15 or less, 99.6 % of level 1 by more than "
        "0.5, half of level 2"
    ),
    "gain": (
        "average precision above that of the best single modality; in each bootstrap resample, of the best "
        "modality of that resample"
    ),
    "calibration": (
        "detections in ten bins of score; expected calibration error: mean difference of score and share of "
        "correct detections, of all labelled objects, at the first IoU"
    ),
    "corruptions": (
        "darkness: half the light a stop, without gain to compensate, with shot noise of 10,000 electrons at white and "
        "read noise of 5 electrons; point dropout: independent, with equal probability; calibration errors: rotation "
        "about a random axis through the camera, or shift in a random direction of the image, labels stay"
    ),
}


@dataclass(frozen=True)
class PrecisionConfig:
    """Average precision.

    Attributes:
        iou: IoU that a detection must exceed to match an object, several with commas; KITTI requires 0.7 of cars.
        recall_points: Number of recall points over which precision is averaged: 40 as KITTI since 2019, 11 as
            before and in the thesis; both as 11,40.
        bootstrap: Number of bootstrap resamples of the frames for 95 % intervals; 0 for none.
        seed: Seed of the resamples.
    """

    iou: tuple[float, ...] = (0.7, 0.5)
    recall_points: tuple[int, ...] = (40,)
    bootstrap: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate the ranges."""
        for iou in self.iou:
            if not 0 <= iou < 1:
                raise UsageError("--iou", expected="from 0 to below 1", found=f"{iou:g}")
        if not self.recall_points or not set(self.recall_points) <= set(RECALL_POINTS):
            found = ",".join(map(str, self.recall_points)) or "none"
            raise UsageError("--recall-points", expected="11, 40 or 11,40", found=found)
        if self.bootstrap < 0:
            raise UsageError("--bootstrap", expected="0 or more", found=str(self.bootstrap))

    def protocol(self, **values: object) -> dict[str, Any]:
        """Return the protocol in words and values.

        Args:
            **values: Further values that the metrics depend on.
        """
        return {**PROTOCOL, "values": {"difficulties": DIFFICULTIES, **asdict(self), **values}}


@dataclass(frozen=True)
class CorruptionLevels:
    """Levels of each sensor corruption, besides 0; an empty list leaves the corruption out.

    Attributes:
        darkness: Darkness of the camera image [stops]; each stop halves the light.
        point_dropout: Share of LiDAR points that are dropped, 0 to below 1.
        rotation: Rotation of the LiDAR-camera calibration [degrees].
        shift: Shift of the projected scan in the image [pixels].
    """

    darkness: tuple[float, ...] = (1, 2, 3, 4, 5, 6)
    point_dropout: tuple[float, ...] = (0.25, 0.5, 0.75, 0.9)
    rotation: tuple[float, ...] = (0.25, 0.5, 1, 2)
    shift: tuple[float, ...] = (2, 4, 8, 16)

    def __post_init__(self) -> None:
        """Validate that the levels of each corruption rise from above 0."""
        for name, levels in vars(self).items():
            if any(a >= b for a, b in zip((0, *levels), levels, strict=False)):
                found = ", ".join(f"{level:g}" for level in levels)
                flag = f"--levels.{name.replace('_', '-')}"
                raise UsageError(flag, expected="levels that rise from above 0", found=found)
        if not any(vars(self).values()):
            raise UsageError("--levels", expected="levels of one corruption or more", found="none")


# Table of the thesis with detectors of others, all on cars at KITTI's IoU.
PublishedTable = Literal["table-7.9", "table-7.11"]
PUBLISHED_CLASS, PUBLISHED_IOU = "Car", 0.7


def require_published(classes: Sequence[str], ious: Sequence[float], *, are_tracks: bool) -> None:
    """Validate that the metric of published detectors is measured.

    Args:
        classes: Names of the measured classes; all of KITTI's where none is named.
        ious: Measured IoUs; those of the classes where none is named.
        are_tracks: Whether the results are tracks.

    Raises:
        UsageError: The results are tracks, or other classes or IoUs are measured.
    """
    has_cars = not classes or PUBLISHED_CLASS.lower() in {name.lower() for name in classes}
    if are_tracks or not has_cars or (ious and PUBLISHED_IOU not in ious):
        raise UsageError(
            "--published",
            expected=f"detections of {PUBLISHED_CLASS} at IoU {PUBLISHED_IOU:g}",
            found=f"{'tracks' if are_tracks else 'detections'} of {', '.join(classes) or 'all classes'} "
            f"at IoU {', '.join(map(str, ious)) or 'of the protocol'}",
            advice="leave --classes and --iou out",
        )
