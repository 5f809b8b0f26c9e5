from dataclasses import replace

import cv2
import numpy as np
import pytest

from perception.geometry.boxes import edges
from perception.render.birds_eye import BirdsEyeView
from perception.render.composition import Composition
from perception.render.labels import draw_labels
from perception.render.object_figures import ObjectPart, object_figures
from perception.render.objects import draw_objects
from perception.render.palette import CLASSES, FAINT_TEXT, LINE_PATTERNS, TRACKS, Style
from perception.render.panels import Resizing
from perception.render.scene import Scene, SceneObjects
from perception.render.strokes import Strokes, draw_strokes, project_strokes
from perception.types import Boxes3D, Tracks
from tests.render.conftest import FORWARD_CAMERA

ABOVE = BirdsEyeView(size_px=(200, 300), pixels_per_m=10.0, vehicle_px=(100.0, 250.0))
FORWARD = FORWARD_CAMERA.image_P_velo
THIN = Style(line_px=1, text_px=8)
SMALL = Composition(size_px=(800, 450))


def tracks_at(*bottoms, size=(4.0, 2.0, 1.5), yaw=0.0, velocity=(0.0, 0.0), seen=True, first_id=0):
    count = len(bottoms)
    boxes = Boxes3D(
        np.array(bottoms, float).reshape(-1, 3), np.tile(size, (count, 1)), np.full(count, yaw)
    )
    velocities = np.tile(np.array(velocity, float), (count, 1))
    return Tracks.unclassified(np.arange(count) + first_id, boxes, velocities, np.full(count, seen))


def drawn(tracks, image_P_velo=ABOVE.image_P_velo, size_px=(200, 300), paths=None):
    canvas = np.zeros((size_px[1], size_px[0], 3), np.uint8)
    paths = list(tracks.boxes.bottom_m[:, None]) if paths is None else paths
    figures = figures_of(tracks, paths)
    draw_labels(canvas, draw_objects(canvas, image_P_velo, figures, THIN), THIN.text_px)
    return canvas


def figures_of(tracks, paths):
    """Return the figures of tracks whose headings are reliable."""
    objects = SceneObjects.of_tracks(tracks)
    return object_figures(replace(objects, has_front=np.ones(len(objects), bool)), paths)


def is_colored(pixel, color=TRACKS[0]):
    return bool((pixel.astype(int) >= 0.6 * np.array(color)).all())


def test_the_projection_from_above_is_the_view_itself():
    points = np.array([(0, 0, 0), (10, 0, 5), (0, 5, -2), (-2, -3, 1.0)])
    homogeneous = np.column_stack([points, np.ones(4)]) @ ABOVE.image_P_velo.T
    np.testing.assert_allclose(homogeneous[:, :2], ABOVE.to_pixels(points))
    assert (homogeneous[:, 2] == 1).all()


def test_from_above_a_box_is_its_outline():
    # 4 m x 2 m, 10 m ahead: rows 130 to 170, columns 90 to 110.
    canvas = drawn(tracks_at((10, 0, -1.7)))
    for column, row in [(90, 150), (110, 150), (100, 130), (100, 170)]:
        assert is_colored(canvas[row, column])
    assert not canvas[160, 95].any()
    # Only the front of it is filled.
    assert canvas[134, 95].max() > 100
    assert not canvas[142, 95].any()


def test_before_the_camera_its_edges_are_where_they_project():
    # The rear of the box, 8 m ahead, 2 m wide, 1 m high: columns 87.5 to 112.5, rows 50 to 62.5.
    tracks = tracks_at((10, 0, -1.0), size=(4, 2, 1), velocity=(5.0, 0.0))
    canvas = drawn(tracks, FORWARD, (200, 100))
    for column, row in [(87, 56), (112, 56), (100, 62), (100, 50)]:
        assert canvas[row - 1 : row + 2, column - 1 : column + 2].max() > 150
    assert not canvas[90].any()


def test_a_front_is_filled_only_where_it_is_seen():
    away = drawn(tracks_at((5, 0, -1.0), size=(4, 2, 1)), FORWARD, (200, 100))
    towards = drawn(tracks_at((5, 0, -1.0), size=(4, 2, 1), yaw=np.pi), FORWARD, (200, 100))
    # Within the near side and out of the line of every edge.
    assert not away[74, 108].any()
    np.testing.assert_allclose(towards[74, 108], np.array(TRACKS[0]) / 2, atol=1)


def test_a_box_outside_the_view_draws_no_line_across_the_image():
    # It reaches from 5 m behind the camera to 5 m ahead of it, 2 m to the right.
    tracks = tracks_at((0, -3, -1.0), size=(10, 2, 1.5))
    strokes = project_strokes(
        FORWARD, np.zeros((100, 200, 3), np.uint8), edges(tracks.boxes)[0], np.zeros(12, int)
    )
    assert len(strokes.owners)
    assert strokes.ends_px.min() > -9
    assert (strokes.ends_px.max(axis=(0, 1)) < (209, 109)).all()
    canvas = drawn(tracks, FORWARD, (200, 100))
    # Whatever lies right of it ahead of the camera projects into the right half.
    assert not canvas[:, :110].any()
    assert canvas[:, 130:].any()


def test_a_box_behind_the_camera_is_not_drawn():
    assert not drawn(tracks_at((-8, 0, -1.0), velocity=(-9.0, 0.0)), FORWARD, (200, 100)).any()


def test_the_arrow_is_as_long_as_the_way_of_a_second():
    figures = figures_of(tracks_at((10, 0, 0), velocity=(0.0, 3.0)), [np.array([(10, 0, 0.0)])])
    shaft = figures.segments_m[figures.numbers == ObjectPart.ARROW][0]
    # From the left side of a box 2 m wide.
    np.testing.assert_allclose(shaft, [(10, 1, 0), (10, 4, 0)], atol=1e-9)
    slow = figures_of(tracks_at((10, 0, 0), velocity=(0.4, 0)), [np.array([(10, 0, 0.0)])])
    assert not (slow.numbers == ObjectPart.ARROW).any()


def test_a_way_is_drawn_where_it_went_and_fades():
    path = np.column_stack([np.linspace(2, 10, 25), np.full(25, 6.0), np.zeros(25)])
    canvas = drawn(tracks_at((10, 6, 0), size=(0.4, 0.4, 1)), paths=[path])
    old, new = canvas[225, 40], canvas[165, 40]
    assert is_colored(new)
    assert 60 < old.max() < 0.6 * max(TRACKS[0])


def test_under_the_vehicle_no_way_is_drawn():
    path = np.column_stack([np.linspace(-4, 10, 25), np.zeros((25, 2))])
    canvas = drawn(tracks_at((10, 0, 0), size=(0.4, 0.4, 1)), paths=[path])
    assert canvas[200, 100].any()
    assert not canvas[235:265, 100].any()


def test_predicted_boxes_are_faint():
    observed = drawn(tracks_at((10, 0, 0)))[:, 90].max(axis=1)[140:160]
    predicted = drawn(tracks_at((10, 0, 0), seen=False))[:, 90].max(axis=1)[140:160]
    assert (observed > 250).all()
    assert (predicted < 0.6 * observed).all()
    assert (predicted > 100).all()


@pytest.mark.parametrize(
    ("modality", "starts", "stops"),
    [
        ("rgb", [0, 12, 24], [7.2, 19.2, 30]),
        ("dm", [0, 6, 12, 18, 24], [2.4, 8.4, 14.4, 20.4, 26.4]),
        ("rm", [0, 12.06, 18, 30], [9, 14.94, 27, 30]),
    ],
)
def test_each_modality_has_its_line_pattern(modality, starts, stops):
    line = Strokes(np.array([3]), np.array([[(0.0, 0.0), (30.0, 0.0)]]))
    dashes = line.dashed(LINE_PATTERNS[modality])
    assert set(dashes.owners) == {3}
    np.testing.assert_allclose(dashes.ends_px[:, 0, 0], starts)
    np.testing.assert_allclose(dashes.ends_px[:, 1, 0], stops)
    assert not dashes.ends_px[..., 1].any()


@pytest.mark.parametrize(("width_px", "rows"), [(1, [50]), (3, [49, 50, 51])])
def test_lines_are_as_wide_as_they_were_asked_for(width_px, rows):
    canvas = np.zeros((100, 100, 3), np.uint8)
    line = Strokes(np.array([0]), np.array([[(10.0, 50.0), (90.0, 50.0)]]))
    draw_strokes(canvas, line, [(255, 255, 255)], np.array([width_px]))
    assert np.flatnonzero(canvas[:, 50, 0] > 128).tolist() == rows


@pytest.mark.skipif(cv2.__version__ < "5", reason="OpenCV 4 draws other pixels of lines")
def test_the_nearer_of_two_lies_on_top():
    # Ids 0 and 1 stand one behind the other; where their lines cross, the nearer one's colour is seen.
    tracks = tracks_at((10, 0, -1), (6, 0, -1), size=(0.1, 2, 2))
    canvas = drawn(tracks, FORWARD, (200, 100))
    near, far = drawn(tracks[1:], FORWARD, (200, 100)), drawn(tracks[:1], FORWARD, (200, 100))
    both = (near == TRACKS[1]).all(axis=2) & far.any(axis=2)
    assert both.any()
    assert (canvas[both] == TRACKS[1]).all()


def labels_of(objects, **known):
    canvas = np.zeros((300, 200, 3), np.uint8)
    objects = replace(objects, **known)
    figures = object_figures(objects, [np.zeros((0, 3))] * len(objects))
    return draw_objects(canvas, ABOVE.image_P_velo, figures, THIN)


def test_a_label_says_class_distance_id_and_speed():
    objects = SceneObjects.of_tracks(tracks_at((10, 0, 0), first_id=12, velocity=(0.0, 4.0)))
    (label,) = labels_of(objects)
    assert (label.name, label.details) == ("10 m", "#12  4.0 m/s")
    cyclist = {"types": np.array(["Cyclist"])}
    (label,) = labels_of(objects, **cyclist)
    assert (label.name, label.details) == ("Cyclist 10 m", "#12  4.0 m/s")
    untracked = {"ids": np.array([-1]), "colors": np.array([-1]), "is_moving": np.zeros(1, bool)}
    (label,) = labels_of(objects, **cyclist, **untracked)
    assert (label.name, label.details) == ("Cyclist 10 m", "")
    nowhere = Boxes3D(*(np.full((1, *row), np.nan) for row in ((3,), (3,), ())))
    (label,) = labels_of(objects, **cyclist, **untracked, boxes=nowhere)
    assert (label.name, label.details) == ("Cyclist", "")


def test_a_track_has_the_colour_of_its_id_and_another_object_that_of_its_class():
    objects = SceneObjects.of_tracks(tracks_at((10, 0, 0)))
    (label,) = labels_of(objects, types=np.array(["Truck"]))
    assert (label.color, label.mark) == (TRACKS[0], CLASSES["Truck"])
    (label,) = labels_of(objects, types=np.array(["Truck"]), colors=np.array([-1]))
    assert (label.color, label.mark) == (CLASSES["Truck"], CLASSES["Truck"])
    (label,) = labels_of(objects, types=np.array(["Wagon"]), colors=np.array([-1]))
    assert (label.color, label.mark) == (FAINT_TEXT, None)


def test_the_selected_object_is_labelled_first_then_what_moves_then_what_is_near():
    tracks = tracks_at((5, 0, 0), (15, 0, 0), (10, 2, 0), (20, 3, 0), velocity=(2.0, 0))
    known = {
        "is_moving": np.array([False, True, False, False]),
        "statuses": np.array(["", "", "", "lost"]),
        "is_observed": np.array([True, True, True, False]),
    }
    labels = labels_of(SceneObjects.of_tracks(tracks), **known)
    assert [label.details for label in labels] == ["#3  lost", "#1  2.0 m/s", "#0", "#2"]


def test_an_object_without_a_3d_box_is_its_rectangle_in_the_image_alone():
    tracks = tracks_at((np.nan, np.nan, np.nan))
    rectangle = np.array([[20.0, 30, 80, 90]])
    objects = replace(SceneObjects.of_tracks(tracks), boxes_px=rectangle)
    figures = object_figures(objects, [np.zeros((0, 3))])
    resizing = Resizing.of_window(np.array([0.0, 0, 100, 50]), (200, 100))
    canvas = np.zeros((300, 200, 3), np.uint8)
    (label,) = draw_objects(canvas, FORWARD, figures, THIN, resizing)
    np.testing.assert_allclose(label.box_px, [40.5, 60.5, 160.5, 180.5])
    assert is_colored(canvas[61, 100])
    draw_objects(elsewhere := np.zeros((300, 200, 3), np.uint8), ABOVE.image_P_velo, figures, THIN)
    assert not elsewhere.any()


def test_the_label_stands_over_its_box():
    canvas = drawn(tracks_at((10, 0, 0), first_id=12))
    assert canvas[112:128].any()
    assert not canvas[:105].any()


def test_no_tracks_leave_the_image_as_it_was():
    assert not drawn(Tracks.empty(), paths=[]).any()


def test_tracks_are_in_every_panel(scene):
    tracked = replace(scene, tracks=tracks_at((12, 1, -1.7), velocity=(3.0, 0.0)))
    changed = (SMALL.draw(Scene.of(tracked)) != SMALL.draw(Scene.of(scene))).any(axis=2)[: 450 - 34]
    rows, columns = np.nonzero(changed)
    is_left, is_top = columns < 560, rows < 190
    assert (is_left & is_top).any()
    assert (is_left & ~is_top).any()
    assert (~is_left).any()


def test_tracks_are_drawn_without_a_camera_too(scene):
    blind = replace(scene, frame=replace(scene.frame, image=None, calibration=None))
    tracked = replace(blind, tracks=tracks_at((12, 1, -1.7)))
    assert (SMALL.draw(Scene.of(tracked)) != SMALL.draw(Scene.of(blind))).any()
