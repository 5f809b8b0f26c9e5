"""Detections of one frame as observations in the world: located by their returns, or by their height in the image."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray

from perception.geometry import se3
from perception.geometry.box_overlap_px import iou_px
from perception.geometry.boxes import transform_boxes
from perception.tracking.vehicles.class_names import (
    class_likelihoods,
    height_likelihoods,
    names_in_images,
)
from perception.tracking.vehicles.class_sizes import SizePriors
from perception.tracking.vehicles.evidence import with_heights
from perception.tracking.vehicles.image_heights import image_heights_m
from perception.types import ArrayTable, Bool, Boxes3D, Detections, Float64, Int, Vehicles

_POSITION_NOISE_M = 0.2  # standard deviation of a located position, at any distance
_POSITION_NOISE_PER_M = 0.01  # increase of that standard deviation with distance
_SPARSE_NOISE_M = 1.2  # of a position by one point; divided by the root of the number of points
_BODY_NOISE_M = 0.2  # both of people, whose returns lie around their middle
ASSUMED_HEIGHT_M = 1.6  # of an object without returns, which places it by its height in the image
_ASSUMED_DEPTH_SHARE = 0.3  # standard deviation of its depth, as a share of the depth
_ASSUMED_SIDE_SHARE = 0.12  # deviation of its position across the line of sight, in its widths
SAME_PLACE_IOU = 0.6  # minimum IoU in the image of detections of several classes of one object
_MIN_SHARE = 0.25  # of the minimum existence of an object, of the likeliest of its classes
NEAREST_M = 0.5


@dataclass(frozen=True)
class FrameGeometry:
    """Time, pose and projection of one frame in one camera, or in the camera of each of T rows.

    Attributes:
        stamp_s: Time of the scan.
        world_SE3_velo: (4, 4) pose of the LiDAR.
        image_P_velo: (3, 4) or (T, 3, 4) projection from the LiDAR frame to pixels.
        image_size_px: Width and height of the image, or (T, 2).
    """

    stamp_s: float
    world_SE3_velo: Float64
    image_P_velo: Float64
    image_size_px: tuple[int, int] | Int

    @classmethod
    def of_rows(cls, cameras: Sequence[Self], numbers: Int) -> Self:
        """Return the geometry of T rows by the number of the camera of each."""
        stacked = np.stack([one.image_P_velo for one in cameras])
        sizes_px = np.array([one.image_size_px for one in cameras])
        first = cameras[0]
        return cls(first.stamp_s, first.world_SE3_velo, stacked[numbers], sizes_px[numbers])

    @property
    def image_P_world(self) -> Float64:
        """(..., 3, 4) projection from the world to pixels."""
        return np.asarray(self.image_P_velo @ se3.inverse(self.world_SE3_velo))

    @property
    def focal_px(self) -> Float64:
        """(...) vertical focal length: the part of the second row that is orthogonal to the optical axis."""
        upward, forward = self.image_P_velo[..., 1, :3], self.image_P_velo[..., 2, :3]
        depth_scale = np.linalg.norm(forward, axis=-1, keepdims=True)
        axis = forward / depth_scale
        across = upward - (upward * axis).sum(axis=-1, keepdims=True) * axis
        return np.asarray(np.linalg.norm(across, axis=-1) / depth_scale[..., 0])

    def clip(self, boxes_px: Float64) -> Float64:
        """Return the parts of (T, 4) boxes within the image."""
        return np.clip(boxes_px, 0.0, np.tile(self.image_size_px, 2) - 1.0)

    def project(self, points_world: Float64) -> Float64:
        """Return (T, 3) column, row and depth of (T, 3) points; NaN behind the camera."""
        image_P_world = self.image_P_world
        homogeneous = (image_P_world[..., :3] @ points_world[..., None])[..., 0]
        homogeneous += image_P_world[..., 3]
        depths_m = np.where(homogeneous[:, 2:] > NEAREST_M, homogeneous[:, 2:], np.nan)
        return np.hstack([homogeneous[:, :2] / depths_m, depths_m])

    def unproject(self, pixels: Float64, depths_m: Float64) -> Float64:
        """Return (D, 3) the points in the world at (D, 2) pixels and (D,) depths."""
        image_P_world = self.image_P_world
        homogeneous = depths_m[:, None] * np.column_stack([pixels, np.ones(len(pixels))])
        offsets = (homogeneous - image_P_world[..., 3])[..., None]
        return np.asarray(np.linalg.solve(image_P_world[..., :3], offsets)[..., 0])


@dataclass(frozen=True)
class VehicleObservations(ArrayTable):
    """D detections in the world, those that may exist.

    A detection without returns has the depth at which an object of the assumed height has the height of its box: a
    guess, but one that moves in the image with the ego vehicle nearly as the object does.

    Attributes:
        rows: (D,) rows among all detections of the frame.
        cameras: (D,) number of the camera of each.
        detections: (D) detections in the image of that camera.
        boxes_world: (D) boxes in the world; of a detection without returns without extent but the assumed height.
        is_located: (D,) whether the box is that of the returns.
        noise: (D, 2, 2) covariances of the positions.
        axis_rad: (D,) standard deviations of the axes of the boxes; NaN where they are not known.
        reversal: (D,) probability that the front of each is its rear; NaN where it is not known.
        size_deviations_m: (D, 3) standard deviations of length, width and height; NaN where they are not known.
        class_likelihoods: (D, C) logarithms of the likelihoods of its names and its height by each class.
        existence: (D,) probability that an object of any class is there.
        is_above: (D,) whether it was found from above, where no returns of another object can be taken for its own.
    """

    rows: Int
    cameras: Int
    detections: Detections
    boxes_world: Boxes3D
    is_located: Bool
    noise: Annotated[Float64, 2, 2]
    axis_rad: Float64
    reversal: Float64
    size_deviations_m: Annotated[Float64, 3]
    class_likelihoods: Annotated[Float64, ...]
    existence: Float64
    is_above: Bool

    @classmethod
    def of(
        cls,
        vehicles: Vehicles,
        cameras: Sequence[FrameGeometry],
        classes: NDArray[np.str_],
        min_existence: float,
    ) -> Self:
        """Transform vehicles to the world, those of one camera after those of another.

        Args:
            vehicles: Located detections of the frame.
            cameras: Pose and projection of the frame in each camera.
            classes: (C,) classes of the tracker.
            min_existence: Minimum existence of a detection that is kept.
        """
        fused, numbers = vehicles.fused, vehicles.cameras
        rows = np.argsort(numbers, kind="stable")
        rows = rows[fused.existence[rows] >= _MIN_SHARE * min_existence]
        boxes_px = fused.detections.boxes_px
        is_same_place = iou_px(boxes_px[rows], boxes_px) >= SAME_PLACE_IOU
        is_same_place &= numbers[rows, None] == numbers
        # An object is of one class: what speaks for any of them speaks for the object.
        by_class = _of_classes(fused.detections, fused.existence, classes, is_same_place)
        likely = np.minimum(by_class.sum(axis=1), 1.0)
        kept = np.flatnonzero(likely >= min_existence)
        rows = rows[kept]
        frame = FrameGeometry.of_rows(cameras, numbers[rows])
        detections, boxes = fused.detections[rows], vehicles.boxes[rows]
        heights_m = _image_heights_m(boxes, detections.boxes_px, frame)
        is_located = np.isfinite(boxes.bottom_m[:, 0])
        assumed, assumed_noise = _assumed(detections.boxes_px, frame)
        located = transform_boxes(frame.world_SE3_velo, boxes)
        has_sides = SizePriors.of(detections.types).has_sides
        noise = _located_noise(boxes, vehicles.point_counts[rows], has_sides)
        known = np.flatnonzero(is_located)
        named = names_in_images(vehicles)[rows]
        shown_m = np.where(named == "", np.nan, heights_m)
        return cls(
            rows,
            numbers[rows],
            detections,
            assumed.replaced(known, located[known]),
            is_located,
            np.where(is_located[:, None, None], noise, assumed_noise),
            vehicles.box_deviations.yaw_rad[rows],
            vehicles.box_deviations.reversal[rows],
            vehicles.box_deviations.size_m[rows],
            class_likelihoods(named, vehicles.bev_types[rows], classes)
            + height_likelihoods(shown_m, detections.boxes_px, classes),
            with_heights(likely[kept], heights_m, detections),
            np.isfinite(vehicles.bev_scores[rows]),
        )


def _of_classes(
    detections: Detections, values: Float64, classes: NDArray[np.str_], is_same_place: Bool
) -> Float64:
    """Return (K, C) the highest of (D,) values of each class at K places, by (K, D) whether a detection is there."""
    by_class = np.zeros((len(is_same_place), len(classes)))
    for column, name in enumerate(classes.tolist()):
        rows = np.flatnonzero(detections.types == name)
        by_class[:, column] = (is_same_place[:, rows] * values[rows]).max(axis=1, initial=0.0)
    return by_class


def _image_heights_m(boxes: Boxes3D, boxes_px: Float64, frame: FrameGeometry) -> Float64:
    """Return (D,) the heights that the image shows; NaN of boxes that are not located or that its upper border cuts."""
    heights_m = image_heights_m(boxes, boxes_px, frame.image_P_velo)
    return np.where(boxes_px[:, 1] > 1, heights_m, np.nan)


def _located_noise(boxes: Boxes3D, point_counts: Int, has_sides: Bool) -> Float64:
    points = np.maximum(point_counts, 1)
    away_m = np.nan_to_num(np.linalg.norm(boxes.bottom_m, axis=1))
    of_sides = (
        _POSITION_NOISE_M**2 + (_POSITION_NOISE_PER_M * away_m) ** 2 + _SPARSE_NOISE_M**2 / points
    )
    variances = np.where(has_sides, of_sides, _BODY_NOISE_M**2 * (1 + 1 / points))
    return np.asarray(variances[:, None, None] * np.eye(2))


def _assumed(boxes_px: Float64, frame: FrameGeometry) -> tuple[Boxes3D, Float64]:
    """Return (D) boxes in the world by their heights in the image, and (D, 2, 2) covariances of their positions."""
    sizes_px = np.maximum(boxes_px[:, 2:] - boxes_px[:, :2], 1.0)
    focal_px = frame.focal_px
    depths_m = focal_px * ASSUMED_HEIGHT_M / sizes_px[:, 1]
    middles = frame.unproject((boxes_px[:, :2] + boxes_px[:, 2:]) / 2, depths_m)
    count = len(boxes_px)
    sizes_m = np.tile([0.0, 0.0, ASSUMED_HEIGHT_M], (count, 1))
    boxes = Boxes3D(middles - sizes_m / [1, 1, 2], sizes_m, np.zeros(count))
    sight = middles[:, :2] - frame.world_SE3_velo[:2, 3]
    sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-6)
    along = sight[:, :, None] * sight[:, None, :]
    along_m = _ASSUMED_DEPTH_SHARE * depths_m
    across_m = _ASSUMED_SIDE_SHARE * sizes_px[:, 0] / focal_px * depths_m
    noise = along_m[:, None, None] ** 2 * along + across_m[:, None, None] ** 2 * (np.eye(2) - along)
    return boxes, noise
