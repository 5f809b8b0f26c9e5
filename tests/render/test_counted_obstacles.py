from dataclasses import replace

import numpy as np

from perception.errors import ImageError
from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.objects import MotionState
from perception.evaluation.obstacles import FrameObstacles, ObjectObservations
from perception.render import palette
from perception.render.counted_obstacles import draw_counted_obstacles
from perception.types import Boxes3D, Result
from tests.faults import fault


def counted(motion: MotionState, found: int) -> FrameObstacles:
    """Return a cube of 1 m, 10 m ahead: columns 95 to 105, rows 45 to 56."""
    one = ObjectObservations(
        frames=np.zeros(1, int),
        track_ids=np.zeros(1, int),
        motions=np.array([motion]),
        boxes_velo=Boxes3D(np.array([[10.0, 0, -0.5]]), np.ones((1, 3)), np.zeros(1)),
        points=np.array([30]),
        obstacle_points=np.array([found]),
        moving_points=np.zeros(1, int),
    )
    return FrameObstacles(one, ObjectMatchConfig(), 0, 0)


def has(image: np.ndarray, color: tuple[int, int, int], rows: slice = slice(None)) -> bool:
    return bool((np.abs(image[rows].astype(int) - color).max(axis=2) < 12).any())


def test_boxes_are_red_or_green_and_an_arrow_points_at_the_missed(scene: Result):
    alone = draw_counted_obstacles(scene, None)
    moving = draw_counted_obstacles(scene, counted(MotionState.MOVING, found=30))
    static = draw_counted_obstacles(scene, counted(MotionState.STATIC, found=30))
    missed = draw_counted_obstacles(scene, counted(MotionState.STATIC, found=3))
    assert has(moving, palette.MOVING) and not has(alone, palette.MOVING)
    assert has(static, palette.STATIC) and not has(alone, palette.STATIC)
    assert not has(static, palette.GROUND)
    assert has(missed, palette.GROUND, slice(10, 45))
    assert (scene.frame.image == 128).all()


def test_obstacles_of_few_points_are_not_drawn(scene: Result):
    few = counted(MotionState.MOVING, found=30)
    few = replace(few, config=ObjectMatchConfig(min_points=31))
    np.testing.assert_array_equal(
        draw_counted_obstacles(scene, few), draw_counted_obstacles(scene, None)
    )


def test_a_frame_without_an_image_is_an_error(scene: Result):
    blind = replace(scene, frame=replace(scene.frame, image=None))
    with fault(ImageError, expected="an image with its calibration"):
        draw_counted_obstacles(blind, None)
