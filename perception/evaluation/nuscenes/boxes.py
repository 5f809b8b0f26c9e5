"""Labelled and detected boxes of one sample, and which of them count."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from perception.evaluation.nuscenes.protocol import CLASSES, IN_RACKS
from perception.evaluation.objects import LabelledView
from perception.geometry.camera import box_outlines_px
from perception.types import ArrayTable, Bool, Boxes3D, Float64


@dataclass(frozen=True)
class TaskBoxes(ArrayTable):
    """M boxes of one sample, in a world that rests.

    Attributes:
        types: (M,) names of classes.
        centers_m: (M, 3) centres.
        size_m: (M, 3) length, width, height.
        yaw_rad: (M,) headings.
        velocities_m_s: (M, 2) over the ground; NaN where not known.
        attributes: (M,) attributes; empty where not known.
    """

    types: NDArray[np.str_]
    centers_m: Annotated[Float64, 3]
    size_m: Annotated[Float64, 3]
    yaw_rad: Float64
    velocities_m_s: Annotated[Float64, 2]
    attributes: NDArray[np.str_]

    @property
    def boxes(self) -> Boxes3D:
        """(M) boxes, which state the centres of their bottom faces."""
        bottom_m = self.centers_m - self.size_m * (0.0, 0.0, 0.5)
        return Boxes3D(bottom_m, self.size_m, self.yaw_rad)


@dataclass(frozen=True)
class TaskObjects(TaskBoxes):
    """M labelled objects.

    Attributes:
        has_points: (M,) whether a sensor has measured a point of it.
    """

    has_points: Bool


@dataclass(frozen=True)
class TaskDetections(TaskBoxes):
    """M detected objects in the order of their file.

    Attributes:
        scores: (M,) scores of any scale.
    """

    scores: Float64


@dataclass(frozen=True)
class Racks(ArrayTable):
    """R bicycle racks.

    Attributes:
        centers_m: (R, 3) centres.
        size_m: (R, 3) length, width, height.
        world_R_rack: (R, 3, 3) rotations.
    """

    centers_m: Annotated[Float64, 3]
    size_m: Annotated[Float64, 3]
    world_R_rack: Annotated[Float64, 3, 3]

    def contain(self, points_m: Float64) -> Bool:
        """Tell which of (M, 3) points are in a rack."""
        offsets_m = points_m[:, None] - self.centers_m
        inside_m = np.einsum("mri,rij->mrj", offsets_m, self.world_R_rack)
        return np.asarray((np.abs(inside_m) <= self.size_m / 2).all(axis=2).any(axis=1))


@dataclass(frozen=True)
class Surroundings:
    """What tells which boxes of a sample count.

    Attributes:
        vehicle_m: (2,) place of the vehicle.
        racks: Bicycle racks.
        view: Image to which the labels are confined, its camera in the world; None where all around is labelled.
    """

    vehicle_m: Float64
    racks: Racks
    view: LabelledView | None = None

    def count(self, boxes: TaskBoxes) -> Bool:
        """Tell which of (M,) boxes are of a class, near enough, and in no rack if bicycles."""
        limits_m = {name: one.max_distance_m for name, one in CLASSES.items()}
        max_m = np.array([limits_m.get(name, 0.0) for name in boxes.types.tolist()])
        offsets_m = boxes.centers_m[:, :2] - self.vehicle_m
        is_near = np.linalg.norm(offsets_m, axis=1) < max_m
        is_cycle = np.isin(boxes.types, IN_RACKS)
        return np.asarray(is_near & ~(is_cycle & self.racks.contain(boxes.centers_m)))

    def reach_into_view(self, boxes: TaskBoxes) -> Bool:
        """Tell which of (M,) boxes are at least in part where objects are labelled."""
        if self.view is None:
            return np.ones(len(boxes), np.bool_)
        outlines_px = box_outlines_px(
            self.view.calibration.image_P_velo, boxes.boxes, self.view.image_size_px
        )
        return np.asarray(np.isfinite(outlines_px).all(axis=1))

    def are_in_view(self, boxes: TaskBoxes) -> Bool:
        """Tell which of (M,) boxes have their centre where all objects are labelled."""
        if self.view is None:
            return np.ones(len(boxes), np.bool_)
        centers_m = boxes.centers_m
        return self.view.contains(centers_m) & ~self.view.is_dont_care(centers_m)
