import numpy as np

from perception.evaluation.false_obstacles import ShadowDetector, Shadows
from perception.evaluation.objects import LabelledObjects, LabelledView, MotionState
from perception.geometry.se3 import from_euler
from perception.types import (
    Boxes3D,
    Calibration,
    Float,
    Float64,
    Frame,
    Obstacles,
    Result,
    Voxels,
)

CAMERA = Calibration(
    image_P_cam=np.array([[500.0, 0, 500, 0], [0, 500, 200, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
)


class Level:
    """The ground, of which shadows ask nothing."""

    def height_m(self, xy_m: Float) -> Float64:
        return np.zeros(len(xy_m))

    def distance_m(self, points_velo: Float) -> Float64:
        return np.zeros(len(points_velo))


Annotations = tuple[LabelledObjects, LabelledView]


def scene(x_m: float, motion: MotionState = MotionState.MOVING) -> Annotations:
    """Return a 2 m cube straight ahead."""
    box = Boxes3D(np.array([[x_m, 0.0, -1.7]]), np.full((1, 3), 2.0), np.zeros(1))
    objects = LabelledObjects(box, np.array([motion]), np.array([1]))
    return objects, LabelledView(CAMERA, (1000, 400), np.zeros((0, 4)))


def voxels_at(x_m: float, count: int = 6, z_m: float = -0.7) -> np.ndarray:
    return np.array([[x_m, 0.1 * i - 0.25, z_m] for i in range(count)], np.float32)


def step(
    shadow_detector: ShadowDetector,
    frame: int,
    voxels: np.ndarray,
    annotations: Annotations,
    ego_m=0.0,
):
    world_SE3_velo = from_euler(0, 0, 0, np.array([ego_m, 0.0, 0.0]))
    static = Voxels(voxels, np.ones(len(voxels), np.int64), 0.1)
    nothing = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), 0.1)
    scan = Frame(frame, 0.1 * frame, np.ones((1, 4), np.float32))
    obstacles = Obstacles(np.zeros(1, np.uint8), static, nothing)
    return shadow_detector.update(Result(scan, world_SE3_velo, Level(), obstacles), *annotations)


def figures(shadows: Shadows) -> tuple[int, int]:
    return int(shadows.voxels[0]), int(shadows.clusters[0])


def test_what_stays_where_an_object_was_is_its_shadow():
    shadow_detector = ShadowDetector()
    assert figures(step(shadow_detector, 0, voxels_at(10), scene(10))) == (
        0,
        0,
    )  # the object itself
    assert figures(step(shadow_detector, 1, voxels_at(10), scene(14))) == (6, 1)
    assert figures(step(shadow_detector, 2, voxels_at(20), scene(15))) == (0, 0)  # nobody was there


def test_places_are_remembered_in_the_world():
    shadow_detector = ShadowDetector()
    step(shadow_detector, 0, voxels_at(10), scene(10))
    # The vehicle drove 3 m on, so that the place left is now 7 m ahead.
    assert figures(step(shadow_detector, 1, voxels_at(7), scene(14), ego_m=3.0)) == (6, 1)


def test_an_object_that_stood_leaves_no_shadow():
    shadow_detector = ShadowDetector()
    step(shadow_detector, 0, voxels_at(10), scene(10, MotionState.STATIC))
    assert figures(step(shadow_detector, 1, voxels_at(10), scene(14))) == (0, 0)


def test_shadows_are_forgotten_and_few_voxels_or_ground_are_none():
    shadow_detector = ShadowDetector(memory_s=0.15)
    step(shadow_detector, 0, voxels_at(10), scene(10))
    assert figures(step(shadow_detector, 1, voxels_at(10, count=3), scene(14))) == (3, 0)
    assert figures(step(shadow_detector, 1, voxels_at(10, z_m=-1.65), scene(14))) == (0, 0)
    assert figures(step(shadow_detector, 4, voxels_at(10), scene(20))) == (0, 0)
