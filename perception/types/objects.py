"""Objects on the road: boxes, tracks and vehicles."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray

from perception.types.detections import MODALITIES, FusedDetections
from perception.types.table import ArrayTable, Bool, Float64, Int, require_shape


@dataclass(frozen=True)
class Boxes3D(ArrayTable):
    """M upright boxes in one frame, the LiDAR frame unless the variable's name states another.

    ::

                 front
              +---^---+
              |   |   |
        left  |   o   |
              +-------+

    Attributes:
        bottom_m: (M, 3) centre of the bottom face.
        size_m: (M, 3) length (along the heading), width, height.
        yaw_rad: (M,) heading, from +x towards +y.
    """

    bottom_m: Annotated[Float64, 3]
    size_m: Annotated[Float64, 3]
    yaw_rad: Float64

    @property
    def centers_m(self) -> Float64:
        """(M, 3) centres of the boxes, not those of their bottom faces."""
        return self.bottom_m + self.size_m * (0.0, 0.0, 0.5)


@dataclass(frozen=True)
class BoxDeviations(ArrayTable):
    """Standard deviations of M boxes, beside the covariance of their centres; NaN where not known.

    Attributes:
        size_m: (M, 3) of length, width and height.
        yaw_rad: (M,) of the heading modulo pi, that of the box's axis; at most that of any direction.
        reversal: (M,) probability that the front is the rear, 0 to 0.5.
    """

    size_m: Annotated[Float64, 3]
    yaw_rad: Float64
    reversal: Float64

    @classmethod
    def unknown(cls, count: int) -> Self:
        """Return the deviations of boxes of which none is known."""
        return cls(np.full((count, 3), np.nan), np.full(count, np.nan), np.full(count, np.nan))


@dataclass(frozen=True)
class Tracks(ArrayTable):
    """T tracked objects at the time of one scan, in the LiDAR frame of that scan.

    Attributes:
        ids: (T,) rising; an id is never used again.
        boxes: (T)
        velocities_m_s: (T, 2) over the ground, not relative to the vehicle, along x and y of the LiDAR frame.
        is_observed: (T,) whether the object was observed in this scan, or is predicted.
        covariances: (T, 4, 4) covariance of position and velocity, x y vx vy of the LiDAR frame; NaN where not known.
        box_deviations: (T) standard deviations of the boxes.
        types: (T,) class that a detector gave the object, empty where none has detected it.
        scores: (T,) score of the last such detection, NaN where there is none.
    """

    ids: Int
    boxes: Boxes3D
    velocities_m_s: Annotated[Float64, 2]
    is_observed: Bool
    covariances: Annotated[Float64, 4, 4]
    box_deviations: BoxDeviations
    types: NDArray[np.str_]
    scores: Float64

    @classmethod
    def unclassified(
        cls,
        ids: Int,
        boxes: Boxes3D,
        velocities_m_s: Float64,
        is_observed: Bool,
        covariances: Float64 | None = None,
        box_deviations: BoxDeviations | None = None,
    ) -> Self:
        """Return T tracks of objects that no detector has classified."""
        count = len(ids)
        if covariances is None:
            covariances = np.full((count, 4, 4), np.nan)
        types, scores = np.full(count, ""), np.full(count, np.nan)
        if box_deviations is None:
            box_deviations = BoxDeviations.unknown(count)
        return cls(
            ids, boxes, velocities_m_s, is_observed, covariances, box_deviations, types, scores
        )


@dataclass(frozen=True)
class Vehicles:
    """M detected vehicles as objects on the road, in the LiDAR frame of one scan of N points.

    Attributes:
        fused: (M) fused detections.
        ids: (M,) track ids, equal to those of `Tracks` for an object in both; -1 before confirmation.
        boxes: (M) 3D boxes on the ground; rows of NaN where the LiDAR has too few points.
        distances_m: (M,) from the LiDAR to the nearest return, NaN without one.
        velocities_m_s: (M, 2) over the ground along x and y of the LiDAR frame, NaN before it is known.
        covariances: (M, 4, 4) covariance of position and velocity, as of `Tracks`; NaN of the velocity before the
            vehicle is tracked on the ground, and NaN without a box.
        box_deviations: (M) standard deviations of the boxes.
        owners: (N,) vehicle that each point belongs to, or -1.
        cameras: (M,) camera whose image the detection is in, 0 of the main one and n of the n-th of
            `Frame.further_cameras`, -1 of one in no image; else the main camera of all.
        bev_scores: (M,) score of the detector of the bird's-eye view, NaN where it has not found the vehicle.
        bev_types: (M,) class that it names, empty there.
        scan_existence: (M,) probability, 0..1, that the object exists, by this scan and its images alone.
    """

    fused: FusedDetections
    ids: Int
    boxes: Boxes3D
    distances_m: Float64
    velocities_m_s: Float64
    covariances: Float64
    box_deviations: BoxDeviations
    owners: Int
    cameras: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    bev_scores: Float64 = field(default_factory=lambda: np.zeros(0))
    bev_types: NDArray[np.str_] = field(default_factory=lambda: np.zeros(0, np.str_))
    scan_existence: Float64 = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        """Validate shapes and lengths."""
        count = len(self.fused)
        if not len(self.cameras):
            object.__setattr__(self, "cameras", np.zeros(count, np.int64))
        if not len(self.bev_scores):
            object.__setattr__(self, "bev_scores", np.full(count, np.nan))
        if not len(self.bev_types):
            object.__setattr__(self, "bev_types", np.full(count, "", np.str_))
        if not len(self.scan_existence):
            object.__setattr__(self, "scan_existence", self.fused.existence)
        require_shape("Vehicles.cameras", self.cameras, (count,))
        require_shape("Vehicles.bev_scores", self.bev_scores, (count,))
        require_shape("Vehicles.bev_types", self.bev_types, (count,))
        require_shape("Vehicles.scan_existence", self.scan_existence, (count,))
        require_shape("Vehicles.ids", self.ids, (count,))
        require_shape("Vehicles.boxes.yaw_rad", self.boxes.yaw_rad, (count,))
        require_shape("Vehicles.distances_m", self.distances_m, (count,))
        require_shape("Vehicles.velocities_m_s", self.velocities_m_s, (count, 2))
        require_shape("Vehicles.covariances", self.covariances, (count, 4, 4))
        require_shape("Vehicles.box_deviations.yaw_rad", self.box_deviations.yaw_rad, (count,))

    @classmethod
    def empty(cls, points: int) -> Self:
        """Return no vehicles in a scan of some number of points."""
        unknown = np.zeros(0)
        return cls(
            fused=FusedDetections.empty(),
            ids=np.zeros(0, np.int64),
            boxes=Boxes3D.empty(),
            distances_m=unknown,
            velocities_m_s=np.zeros((0, 2)),
            covariances=np.zeros((0, 4, 4)),
            box_deviations=BoxDeviations.unknown(0),
            owners=np.full(points, -1),
        )

    def __len__(self) -> int:
        """Return M."""
        return len(self.fused)

    @property
    def dominant_modalities(self) -> NDArray[np.str_]:
        """(M,) names of the modalities with the largest contribution, empty where it is of none."""
        names = np.array([*MODALITIES, ""])[self.fused.dominant_modality]
        return np.where((names == "") & np.isfinite(self.bev_scores), "bev", names)

    @cached_property
    def point_counts(self) -> Int:
        """(M,) number of points of each vehicle."""
        return np.bincount(self.owners[self.owners >= 0], minlength=len(self))

    @classmethod
    def concatenate(cls, parts: Sequence[Self], owners: Int) -> Self:
        """Return the vehicles of several parts, in order.

        Args:
            parts: Vehicles of one scan.
            owners: (N,) vehicle of all that each point belongs to, or -1.
        """
        columns: dict[str, Any] = {}
        for column in fields(cls):
            values = [getattr(part, column.name) for part in parts]
            is_table = isinstance(values[0], ArrayTable)
            columns[column.name] = (
                type(values[0]).concatenate(values) if is_table else np.concatenate(values)
            )
        return cls(**columns | {"owners": owners})

    def select(self, rows: Int) -> Self:
        """Return the vehicles of some rows, in their order, with their points."""
        columns = {
            column.name: getattr(self, column.name)[rows]
            for column in fields(self)
            if column.name != "owners"
        }
        places = np.full(len(self) + 1, -1)  # the last is the place of points without a vehicle
        places[rows] = np.arange(len(rows))
        return replace(self, **columns, owners=places[self.owners])

    def with_detections(self, **columns: Any) -> Self:  # noqa: ANN401 - columns of `Detections`
        """Return the vehicles with other values in some columns of their detections."""
        detections = replace(self.fused.detections, **columns)
        return replace(self, fused=replace(self.fused, detections=detections))

    def as_tracks(self, rows: Int) -> Tracks:
        """Return the vehicles of some rows as tracks that are observed in this scan."""
        detections = self.fused.detections
        return Tracks(
            ids=self.ids[rows],
            boxes=self.boxes[rows],
            velocities_m_s=self.velocities_m_s[rows],
            is_observed=np.ones(len(rows), bool),
            covariances=self.covariances[rows],
            box_deviations=self.box_deviations[rows],
            types=detections.types[rows],
            scores=detections.scores[rows],
        )
