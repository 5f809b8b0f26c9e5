"""Scans of cars at known places, and the boxes that a perfect detector would draw around them."""

import numpy as np

from perception.geometry import se3
from perception.geometry.boxes import transform_boxes
from perception.geometry.camera import box_outlines_px
from perception.types import Boxes3D, Calibration, Detections, Frame, FusedDetections

ROAD_M = -1.7
SIZE_PX = (1240, 380)
CALIBRATION = Calibration(
    image_P_cam=np.array([[720.0, 0, 620, 0], [0, 720, 172, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    image_size_px=SIZE_PX,
)


class FlatRoad:
    """The ground model of a level road."""

    def height_m(self, xy_m: np.ndarray) -> np.ndarray:
        return np.full(len(xy_m), ROAD_M)

    def distance_m(self, points_velo: np.ndarray) -> np.ndarray:
        return points_velo[:, 2] - ROAD_M


def cars(*places: tuple[float, float, float], size_m=(4.0, 1.65, 1.5)) -> Boxes3D:
    """Return a car at each x, y and yaw."""
    x, y, yaw_rad = np.array(places, float).reshape(-1, 3).T
    bottom_m = np.column_stack([x, y, np.full(len(x), ROAD_M)])
    return Boxes3D(bottom_m, np.tile(size_m, (len(x), 1)), yaw_rad)


def sides(boxes: Boxes3D, step_m: float = 0.15) -> np.ndarray:
    """Return points (N, 3) on the upright sides of boxes that face the sensor at the origin."""
    points = [np.zeros((0, 3))]
    for bottom_m, size_m, yaw_rad in zip(boxes.bottom_m, boxes.size_m, boxes.yaw_rad, strict=True):
        ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        left = np.array([-ahead[1], ahead[0]])
        for normal, along, half_m, reach_m in (
            (ahead, left, size_m[0] / 2, size_m[1] / 2),
            (left, ahead, size_m[1] / 2, size_m[0] / 2),
        ):
            for sign in (1, -1):
                middle = bottom_m[:2] + sign * half_m * normal
                if middle @ (sign * normal) >= 0:
                    continue
                offsets = np.linspace(-reach_m, reach_m, int(2 * reach_m / step_m) + 1)
                heights = np.arange(0.3, size_m[2], step_m)
                places = (middle + offsets[:, None] * along)[:, None].repeat(len(heights), 1)
                z = np.broadcast_to(bottom_m[2] + heights, places.shape[:2])[..., None]
                points.append(np.concatenate([places, z], axis=-1).reshape(-1, 3))
    return np.concatenate(points)


def walker(boxes: Boxes3D) -> np.ndarray:
    """Return points (N, 3) on upright cylinders of 0.4 m, as on people, on the side towards the sensor."""
    return np.concatenate([_cylinder(bottom_m, 0.2, 0.3, 1.7) for bottom_m in boxes.bottom_m])


def rider(boxes: Boxes3D) -> np.ndarray:
    """Return points (N, 3) of cyclists: the side of a cycle in their middle plane, and a person on top."""
    parts = []
    for bottom_m, yaw_rad in zip(boxes.bottom_m, boxes.yaw_rad, strict=True):
        ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
        along_m, height_m = np.meshgrid(np.arange(-0.8, 0.81, 0.1), np.arange(0.3, 1.0, 0.15))
        cycle = along_m.reshape(-1, 1) * ahead + height_m.reshape(-1, 1) * [0, 0, 1]
        parts += [bottom_m + cycle, _cylinder(bottom_m, 0.2, 1.0, 1.7)]
    return np.concatenate(parts)


def _cylinder(bottom_m: np.ndarray, radius_m: float, low_m: float, high_m: float) -> np.ndarray:
    """Return points (N, 3) on the side of an upright cylinder that faces the sensor at the origin."""
    towards_rad = np.arctan2(-bottom_m[1], -bottom_m[0])
    angle_rad = towards_rad + np.arcsin(np.linspace(-0.95, 0.95, 7))
    ring = np.column_stack([np.cos(angle_rad), np.sin(angle_rad), np.zeros(len(angle_rad))])
    heights = np.arange(low_m, high_m, 0.15)[:, None, None] * [0, 0, 1]
    return np.asarray((bottom_m + radius_m * ring + heights).reshape(-1, 3))


def visible_points(points: np.ndarray) -> np.ndarray:
    """Return the points that no nearer one hides from a sensor of 0.3 degrees to a beam."""
    range_m = np.linalg.norm(points, axis=1)
    beams = np.column_stack(
        [np.arctan2(points[:, 1], points[:, 0]), np.arcsin(points[:, 2] / range_m)]
    )
    order = np.argsort(range_m)
    _, nearest = np.unique(np.rint(beams[order] / 0.005), axis=0, return_index=True)
    return points[order[nearest]]


def road(*, step_m: float = 0.4) -> np.ndarray:
    """Return points (N, 3) of a flat road."""
    x, y = np.meshgrid(np.arange(3, 60, step_m), np.arange(-15, 15, step_m))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, ROAD_M)])


def frame_of(*parts: np.ndarray, index: float = 0, pose: np.ndarray | None = None) -> Frame:
    """Return a frame without image, ten of which make a second."""
    points = np.concatenate(parts)
    scan = np.column_stack([points, np.full(len(points), 0.3)]).astype(np.float32)
    return Frame(int(index), 0.1 * index, scan, world_SE3_velo=pose, calibration=CALIBRATION)


def detected(boxes: Boxes3D, scores: np.ndarray | float = 0.9) -> FusedDetections:
    """Return the boxes that a perfect detector would draw."""
    boxes_px = box_outlines_px(CALIBRATION.image_P_velo, boxes, SIZE_PX)
    count = len(boxes)
    found = Detections(boxes_px, np.broadcast_to(scores, count) * 1.0, np.full(count, "Car"))
    return FusedDetections(found, np.full((count, 3), -1), np.zeros(count, int), found.scores)


def observed_from(
    x_m: float, boxes_world: Boxes3D, yaw_rad: float = 0.0
) -> tuple[np.ndarray, Boxes3D]:
    """Return the pose of a LiDAR that stands at x in the world, and the boxes as it sees them."""
    pose = se3.from_euler(0, 0, yaw_rad, np.array([x_m, 0.0, 0.0]))
    return pose, transform_boxes(se3.inverse(pose), boxes_world)
