"""Found, missed and made-up objects are told apart by their colours."""

import numpy as np

from perception.render import palette
from perception.render.detections import draw_detection_errors
from perception.types import Detections

FOUND, MISSED, VAN = [40.0, 40, 240, 140], [400.0, 40, 600, 140], [700.0, 40, 900, 140]
GHOST = [40.0, 200, 240, 280]


def test_each_kind_has_its_colour():
    boxes_px = np.array([FOUND, VAN, GHOST])
    found = Detections(boxes_px, np.array([0.9, 0.8, 0.7]), np.full(3, "Car"))
    objects_px, ignored_px = np.array([FOUND, MISSED]), np.array([VAN])
    canvas = draw_detection_errors(
        np.zeros((300, 1000, 1), np.uint8), objects_px, ignored_px, found, 0.7
    )
    assert canvas.shape == (300, 1000, 3)

    def color(x, y):
        return tuple(canvas[y, x].tolist())

    # In the middle of each left side.
    assert color(40, 90) == palette.MOVING
    assert color(400, 90) == palette.STATIC
    assert color(700, 90) == palette.MOVING
    assert color(40, 240) == palette.TRACKED_OBJECT


def test_small_images_are_enlarged_and_may_show_no_detection():
    none = np.zeros((0, 4))
    picture = np.full((30, 100, 3), 7, np.uint8)
    canvas = draw_detection_errors(picture, none, none, Detections.empty(), 0.5)
    assert canvas.shape == (300, 1000, 3)
    assert (canvas == 7).all()
    assert (picture == 7).all()
