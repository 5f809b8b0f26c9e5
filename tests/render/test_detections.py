"""Boxes and depths as pictures, checked by the colours of single pixels."""

from dataclasses import replace

import numpy as np
import pytest

from perception.maps.densify import DenseMaps
from perception.render import palette
from perception.render.detection_composition import DetectionComposition, DetectionScene
from perception.render.detections import (
    DETECTED,
    PROPOSED,
    color_depth_map,
    draw_boxes,
    draw_detections,
)
from perception.types import Detections


def cars(*rows: tuple[float, float, float, float, float]) -> Detections:
    boxes = np.array(rows, float).reshape(-1, 5)
    return Detections(boxes[:, :4], boxes[:, 4], np.full(len(boxes), "Car"))


def is_colored(pixel: np.ndarray, color: palette.Color) -> bool:
    """Tell whether a pixel of a smooth line has the line's colour, or almost."""
    return bool(np.abs(pixel.astype(int) - color).max() < 60)


def scene_of(image: np.ndarray | None, *, proposals_px: np.ndarray, found: Detections):
    depth = np.full((100, 300, 3), 60, np.uint8)
    return DetectionScene(7, image, depth, proposals_px, found, {"maps": 0.01})


def test_a_box_has_its_colour_on_its_edges_and_a_dark_seam():
    canvas = np.full((60, 80, 3), 200, np.uint8)
    draw_boxes(canvas, np.array([[10.0, 20, 50, 40]]), PROPOSED)
    assert is_colored(canvas[20, 30], PROPOSED)
    assert is_colored(canvas[30, 10], PROPOSED)
    assert canvas[19, 30].max() < 80
    assert tuple(canvas[30, 30]) == (200, 200, 200)
    draw_boxes(canvas, np.zeros((0, 4)), PROPOSED)


def test_the_surest_detection_lies_uppermost_and_every_label_can_be_read():
    canvas = np.zeros((160, 240, 3), np.uint8)
    draw_detections(canvas, cars((20, 60, 120, 110, 0.9), (20, 60, 120, 110, 0.2)), text_px=9)
    assert is_colored(canvas[60, 70], DETECTED)
    alone = np.zeros_like(canvas)
    draw_detections(alone, cars((20, 60, 120, 110, 0.9)), text_px=9)
    # The label of the surest is where it would be alone; the other one is beside.
    np.testing.assert_array_equal(canvas[39:56], alone[39:56])
    assert (canvas != alone).any()


def test_near_is_red_far_is_blue_and_unknown_is_dark():
    depth_m = np.array([[5.0, 12.0, 70.0, 0.0]], np.float32)
    is_measured = depth_m > 0
    dense = DenseMaps(depth_m, np.zeros_like(depth_m), is_measured, np.zeros_like(is_measured))
    near, middle, far, unknown = color_depth_map(dense)[0].astype(int)
    assert near[0] > near[1] + 60 > near[2]
    assert middle[1] > middle[2]
    assert far[2] > far[1]
    assert tuple(unknown) == palette.PANEL


def test_camera_and_depth_stand_one_over_the_other():
    found = cars((100, 40, 160, 80, 0.8))
    proposals_px = np.array([[200.0, 30, 240, 70]])
    image = np.full((100, 300, 3), 120, np.uint8)
    scene = scene_of(image, proposals_px=proposals_px, found=found)
    layout = DetectionComposition.of(scene, period_s=0.1)
    picture = layout.draw(scene)
    width, height = layout.panel_px
    assert picture.shape == (2 * height + 4 + 64, width, 3)
    assert [size % 2 for size in picture.shape[:2]] == [0, 0]
    scale = width / 300
    for top in (0, height + 4):
        edges = picture[top + round(60 * scale), :, :]
        assert is_colored(edges[round(100.5 * scale - 0.5)], DETECTED)
        assert is_colored(edges[round(200.5 * scale - 0.5)], PROPOSED)


@pytest.mark.parametrize(
    ("size_px", "panel_px", "columns"),
    [((1242, 375), (1280, 386), 1), ((1936, 1216), (640, 402), 2), ((640, 480), (640, 480), 2)],
)
def test_panels_have_the_aspect_of_the_camera(size_px, panel_px, columns):
    image = np.zeros((size_px[1], size_px[0], 3), np.uint8)
    scene = DetectionScene(7, image, image, np.zeros((0, 4)), Detections.empty(), {})
    layout = DetectionComposition.of(scene, period_s=0.1)
    assert (layout.panel_px, layout.columns) == (panel_px, columns)
    assert layout.draw(scene).shape[1] == columns * panel_px[0]


@pytest.mark.parametrize("size", [(90, 310), (200, 200), (375, 1242)])
def test_a_frame_of_another_size_fits_the_first_ones_layout(size):
    scene = scene_of(None, proposals_px=np.zeros((0, 4)), found=Detections.empty())
    layout = DetectionComposition.of(scene, period_s=0.1)
    other = replace(scene, depth=np.zeros((*size, 3), np.uint8))
    assert layout.draw(other).shape == layout.draw(scene).shape
