"""The local area around the vehicle, and the grids laid over it."""

from dataclasses import dataclass, replace

import numpy as np

from perception.errors import UsageError
from perception.kernels.cropping import crop
from perception.types import Bool, Float, Float32, Int


@dataclass(frozen=True)
class CroppedScan:
    """Some points of a scan.

    Attributes:
        points_velo: (M, C) the points.
        rows: (M,) where they are in the scan, rising.
    """

    points_velo: Float32
    rows: Int


@dataclass(frozen=True)
class AreaOverrides:
    """Reaches of a local area; None for what the sensor's area says.

    Attributes:
        ahead_m: Reach along +x in metres.
        behind_m: Reach along -x in metres.
        side_m: Reach along +y and -y in metres.
        height_m: Reach above the ground in metres.
    """

    ahead_m: float | None = None
    behind_m: float | None = None
    side_m: float | None = None
    height_m: float | None = None

    def over(self, area: "LocalArea") -> "LocalArea":
        """Return an area with the reaches that are given."""
        given = {name: value for name, value in vars(self).items() if value is not None}
        return replace(area, **given)


@dataclass(frozen=True)
class LocalArea(AreaOverrides):
    """Local area of the obstacle stages, a box in the LiDAR frame (thesis 7.1.1)."""

    ahead_m: float = 25.0
    behind_m: float = 5.0
    side_m: float = 10.0
    height_m: float = 2.0

    def __post_init__(self) -> None:
        """Validate that the area has an extent."""
        if min(self.ahead_m + self.behind_m, self.side_m, self.height_m) <= 0:
            raise UsageError("local area", expected="a positive extent", found=str(self))

    @property
    def rectangle(self) -> tuple[float, float, float, float]:
        """Lowest and highest x, lowest and highest y."""
        return -self.behind_m, self.ahead_m, -self.side_m, self.side_m

    @property
    def reach_m(self) -> float:
        """Distance in metres to the farthest corner."""
        return float(np.hypot(max(self.ahead_m, self.behind_m), self.side_m))

    def contains_xy(self, points_velo: Float, margin_m: float = 0.0) -> Bool:
        """Tell which (N, 2+) points lie over the area, grown by a margin."""
        x, y = points_velo[:, 0], points_velo[:, 1]
        return np.asarray(
            (x > -self.behind_m - margin_m)
            & (x < self.ahead_m + margin_m)
            & (np.abs(y) < self.side_m + margin_m)
        )

    def covers(self, other: "LocalArea") -> bool:
        """Tell whether another area, seen from above, lies within this one."""
        reaches = ((one.ahead_m, one.behind_m, one.side_m) for one in (self, other))
        return all(own >= others for own, others in zip(*reaches, strict=True))

    def crop(self, points_velo: Float) -> CroppedScan:
        """Return the (N, 3+) points that lie over the area."""
        return _cropped(points_velo, self.rectangle, is_inside=True)


# Area of moving objects in the thesis (5.2.2). It contains the area of obstacles, `LocalArea()`.
MOVING_OBJECT_AREA = LocalArea(ahead_m=30.0, behind_m=10.0)
# What is seen from above (`perception.detection.bev`), all round.
SURROUNDINGS = LocalArea(ahead_m=50.0, behind_m=50.0, side_m=50.0)


@dataclass(frozen=True)
class EgoVehicle:
    """Outline of the vehicle around its LiDAR; returns from inside it are the vehicle itself.

    The defaults are a large car with a LiDAR above its middle, with a margin on each side. The outline holds the
    LiDAR itself, and with it all points without a return, which lie at the origin.

    Attributes:
        front_m: Reach along +x in metres.
        rear_m: Reach along -x in metres.
        side_m: Reach along +y and -y in metres.
    """

    front_m: float = 3.0
    rear_m: float = 2.5
    side_m: float = 1.4

    def __post_init__(self) -> None:
        """Validate that the LiDAR is within the outline."""
        if min(self.front_m, self.rear_m, self.side_m) <= 0:
            raise UsageError("ego vehicle", expected="reaches above 0 m", found=str(self))

    def contains_xy(self, points_velo: Float) -> Bool:
        """Tell which (N, 2+) points lie over the vehicle."""
        x, y = points_velo[:, 0], points_velo[:, 1]
        return np.asarray((x > -self.rear_m) & (x < self.front_m) & (np.abs(y) < self.side_m))

    def crop(self, points_velo: Float) -> CroppedScan:
        """Return the (N, 3+) points that do not lie over the vehicle."""
        rectangle = (-self.rear_m, self.front_m, -self.side_m, self.side_m)
        return _cropped(points_velo, rectangle, is_inside=False)


def _cropped(
    points_velo: Float, rectangle: tuple[float, float, float, float], *, is_inside: bool
) -> CroppedScan:
    points = np.ascontiguousarray(points_velo, np.float32)
    rows, cropped = crop(points, rectangle, is_inside)
    return CroppedScan(cropped, rows)
