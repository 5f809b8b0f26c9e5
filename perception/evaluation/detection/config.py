"""Settings of the detection metrics."""

from dataclasses import dataclass

from perception.errors import UsageError

RECALL_POINTS = (11, 40)


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
