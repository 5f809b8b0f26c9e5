"""Detections of each modality on the camera image and on the maps."""

from dataclasses import replace

import numpy as np
import pytest

from perception.render import palette
from perception.render.composition import Composition
from perception.render.detector_views import draw_detector_boxes, map_insets
from perception.render.panels import Resizing
from perception.render.scene import Scene
from perception.types import BoxDeviations, Boxes3D, Detections, FusedDetections, Vehicles

SIZE = (200, 100)
AS_IT_IS = Resizing.of_window(np.array([0.0, 0, *SIZE]), SIZE)


def detections(*boxes_px, scores=None):
    boxes = np.array(boxes_px, float).reshape(-1, 4)
    given = np.full(len(boxes), 0.9) if scores is None else np.array(scores)
    return Detections(boxes, given, np.full(len(boxes), "Car"))


@pytest.fixture
def seen(scene):
    """A car that image and depth map show, and an unlikely one; the first stands 10 m ahead."""
    fused = detections((80, 40, 120, 70), (10, 10, 30, 30), scores=[0.9, 0.2])
    nan = [np.nan] * 3
    vehicles = Vehicles(
        FusedDetections(fused, np.array([[0, 0, -1], [1, -1, -1]]), np.array([0, 0]), fused.scores),
        np.array([4, -1]),
        Boxes3D(
            np.array([[12, 0, -1.7], nan]), np.array([[4, 1.8, 1.5], nan]), np.array([0, np.nan])
        ),
        np.array([10.0, np.nan]),
        np.array([[2.0, 0], [np.nan, np.nan]]),
        np.full((2, 4, 4), np.nan),
        BoxDeviations.unknown(2),
        np.full(4, -1),
    )
    modality_detections = {
        "rgb": detections((60, 30, 130, 80), (10, 10, 30, 30), scores=[0.9, 0.2]),
        "dm": detections((50, 20, 140, 90)),
    }
    depths = np.full((100, 200), 90, np.uint8)
    return replace(
        scene,
        modality_detections=modality_detections,
        map_images={"dm": depths},
        vehicles=vehicles,
    )


def test_a_detector_has_the_colours_of_its_vehicles_and_the_unlikely_is_not_drawn(seen):
    canvas = np.zeros((100, 200, 3), np.uint8)
    draw_detector_boxes(canvas, Scene.of(seen), "rgb", AS_IT_IS, display_score=0.5)
    color = palette.track_color(4)
    np.testing.assert_allclose(canvas[60, 60], color, atol=60)
    assert not canvas[:28, :28].any()
    # In the pattern of its modality.
    dashed = np.zeros_like(canvas)
    pattern = palette.LINE_PATTERNS["rgb"]
    draw_detector_boxes(dashed, Scene.of(seen), "rgb", AS_IT_IS, display_score=0.5, pattern=pattern)
    solid, broken = (image[32:78, 60].max(axis=1) > 150 for image in (canvas, dashed))
    assert solid.all()
    assert 0.4 < broken.mean() < 0.8


def test_without_a_detector_there_is_no_view(scene):
    assert map_insets(Scene.of(scene), SIZE, 0.5) == {}


def test_only_maps_that_a_detector_used_are_shown(seen):
    insets = map_insets(Scene.of(seen), (100, 100), 0.5)
    assert list(insets) == ["Depth map"]
    # Half as large, and without the sky in the uppermost quarter.
    assert insets["Depth map"].shape == (38, 100, 3)
    np.testing.assert_allclose(insets["Depth map"][20, 25], palette.track_color(4), atol=60)


def test_the_views_of_the_detectors_are_drawn_on_request(seen):
    without, views = (
        Composition(size_px=(800, 450), detector_views=shown).draw(Scene.of(seen))
        for shown in (False, True)
    )
    changed = (without != views).any(axis=2)
    body_px = round(450 * (1 - 0.135))
    # On the camera image and in the legend.
    assert changed[:226, :451].any()
    assert not changed[232:body_px].any()
    assert changed[body_px:, :200].any()


def test_an_image_with_vehicles_differs_in_every_view(seen, scene):
    layout = Composition(size_px=(800, 450))
    changed = (layout.draw(Scene.of(seen)) != layout.draw(Scene.of(scene))).any(axis=2)
    body = changed[:389]
    assert body[:190, :560].any()
    assert body[260:, :560].any()
    assert body[:, 564:].any()
    assert changed[410:].any()
