"""Detected vehicles in the pictures: each detector in its colour, what they say together bold, boxes on the ground."""

from dataclasses import replace

import numpy as np
import pytest

from perception.render import palette
from perception.render.composition import Composition
from perception.render.panels import Resizing
from perception.render.tracks import TrackStyle
from perception.render.vehicles import VehicleFigures, map_panels
from perception.types import Boxes3D, Detections, FusedDetections, Tracks, Vehicles

SIZE = (200, 100)
AS_IT_IS = Resizing.of_window(np.array([0.0, 0, *SIZE]), SIZE)
STYLE = TrackStyle(line_px=1, text_px=7)


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
        FusedDetections(fused, np.array([[0, 0, -1], [1, -1, -1]]), np.array([0, 0])),
        np.array([4, -1]),
        Boxes3D(
            np.array([[12, 0, -1.7], nan]), np.array([[4, 1.8, 1.5], nan]), np.array([0, np.nan])
        ),
        np.array([10.0, np.nan]),
        np.array([[2.0, 0], [np.nan, np.nan]]),
        np.full((2, 4, 4), np.nan),
        np.full(4, -1),
    )
    modality_detections = {
        "rgb": detections((60, 30, 130, 80)),
        "dm": detections((50, 20, 140, 90)),
    }
    depths = np.full((100, 200), 90, np.uint8)
    return replace(
        scene,
        modality_detections=modality_detections,
        map_images={"dm": depths},
        vehicles=vehicles,
    )


def test_each_detector_has_its_colour_and_the_unlikely_is_not_drawn(seen):
    picture = np.zeros((100, 200, 3), np.uint8)
    VehicleFigures.of(seen).draw_on_image(picture, AS_IT_IS, STYLE)
    for column, color in ((60, palette.MODALITIES["rgb"]), (50, palette.MODALITIES["dm"])):
        np.testing.assert_allclose(picture[60, column], color, atol=60)
    np.testing.assert_allclose(picture[55, 80], palette.track_color(4), atol=60)
    assert not picture[:35, :35].any()


def test_a_vehicle_that_is_also_a_track_is_drawn_once_in_space(seen):
    assert VehicleFigures.of(seen).names == ("4",)
    boxes = seen.vehicles.boxes[np.array([0])]
    tracks = Tracks.unclassified(np.array([4]), boxes, np.zeros((1, 2)), np.ones(1, bool))
    assert VehicleFigures.of(replace(seen, tracks=tracks)).names == ()


def test_without_a_detector_there_is_nothing_to_draw(scene):
    assert VehicleFigures.of(scene) is None
    assert map_panels(scene, SIZE) == {}


def test_only_maps_that_were_looked_at_are_shown(seen):
    panels = map_panels(seen, (100, 100))
    assert list(panels) == ["Depth map"]
    # Half as large, and without the sky in the uppermost quarter.
    assert panels["Depth map"].shape == (38, 100, 3)


def test_a_picture_with_vehicles_differs_in_every_view(seen, scene):
    layout = Composition(size_px=(800, 450))
    changed = (layout.draw(seen) != layout.draw(scene)).any(axis=2)
    body = changed[:416]
    assert body[:190, :560].any()
    assert body[260:, :560].any()
    assert body[:, 564:].any()
    assert changed[416:].any()
