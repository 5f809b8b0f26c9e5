"""Pictures of one followed object: what each part shows of what, where it must be."""

from dataclasses import replace

import numpy as np
import pytest

from perception.render import palette
from perception.render.canvas import blank_canvas
from perception.render.palette import Style
from perception.render.panels import FittedImage, Resizing
from perception.render.scan_points import ScanPoints
from perception.render.tracked_object_composition import (
    TrackedObjectComposition,
    draw_speed_chart,
)
from perception.render.tracked_object_grid import draw_tracked_objects
from perception.render.tracked_object_views import (
    STATUS_COLORS,
    TrackedObjectScene,
    TrackedObjectViews,
    draw_path,
    draw_region,
    label_text,
)
from perception.render.trails import TrackedObjectTrail
from perception.tracking.single_object.image_region import ImageRegion
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Boxes3D

STYLE = Style()
BOX = Boxes3D(np.array([[12.0, 1, -1.73]]), np.array([[4.0, 1.8, 1.6]]), np.zeros(1))


def rectangle(x1, y1, x2, y2, size_px) -> ImageRegion:
    hull_px = np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]], float)
    return ImageRegion(hull_px, size_px)


def tracked_in(state: TrackStatus, box: Boxes3D | None = BOX, **changes) -> TrackedObject:
    return TrackedObject(
        state, box, **{"velocity_m_s": np.array([3.0, 4.0]), "box_px": None} | changes
    )


@pytest.fixture
def follow_scene(scene) -> TrackedObjectScene:
    return TrackedObjectScene(
        result=scene,
        tracked=tracked_in(TrackStatus.SEEN, region=rectangle(85, 40, 95, 60, (200, 100))),
        path_velo=np.array([[8.0, 1, -1.73], [10, 1, -1.73], [12, 1, -1.73]]),
        ego_path_velo=np.array([[-8.0, 0, -1.73], [-4, 0, -1.73], [0, 0, -1.73]]),
        speeds_km_h=[17.0, 18.0],
        states=[TrackStatus.SEEN, TrackStatus.SEEN],
        seconds=0.004,
        truth=BOX,
    )


def count_of(canvas, color, tolerance=12) -> int:
    return int((np.abs(canvas.astype(int) - color).max(axis=2) <= tolerance).sum())


def test_the_image_has_its_size_and_shows_object_paths_region_and_label(follow_scene):
    canvas = TrackedObjectComposition((1280, 720), frame_count=4).draw(follow_scene)
    assert canvas.shape == (720, 1280, 3)
    for color in (
        palette.TRACKED_OBJECT,
        palette.EGO_PATH,
        palette.INSIDE,
        palette.RING,
        palette.TRUTH,
    ):
        assert count_of(canvas, color) > 60


def test_without_a_camera_the_scene_takes_the_whole_height(follow_scene):
    frame = replace(follow_scene.result.frame, image=None, calibration=None)
    result = replace(follow_scene.result, frame=frame)
    bare = replace(follow_scene, result=result, tracked=tracked_in(TrackStatus.SEEN))
    canvas = TrackedObjectComposition((1280, 720)).draw(bare)
    # Where the camera's picture was, the scene's dark panel is.
    assert np.abs(canvas[30:200, 500:800].astype(int) - palette.PANEL).max(axis=2).min() == 0
    assert count_of(canvas, palette.TRACKED_OBJECT) > 60
    assert count_of(canvas, palette.INSIDE) == 0


def test_an_object_in_the_image_alone_is_drawn_as_its_rectangle(follow_scene):
    tracked = tracked_in(TrackStatus.SEEN, None, box_px=np.array([50.0, 30, 120, 70]))
    views = TrackedObjectViews(replace(follow_scene, tracked=tracked, truth=None), STYLE)
    image = views.camera((200, 100))
    assert tuple(image[50, 50]) == palette.TRACKED_OBJECT
    assert tuple(image[50, 80]) == (128, 128, 128)
    assert views.from_above((300, 300)).shape == (300, 300, 3)


@pytest.mark.parametrize("box", [None, Boxes3D(BOX.bottom_m * (-1, 1, 1), BOX.size_m, BOX.yaw_rad)])
def test_an_object_out_of_the_image_leaves_the_close_up_blank(follow_scene, box):
    tracked = tracked_in(TrackStatus.LOST, box)
    close_up = TrackedObjectViews(replace(follow_scene, tracked=tracked), STYLE).close_up((80, 60))
    assert (close_up == palette.PANEL).all()


def test_the_close_up_stays_within_the_image(follow_scene):
    near = Boxes3D(np.array([[3.0, 2, -1.73]]), BOX.size_m, BOX.yaw_rad)
    tracked = tracked_in(TrackStatus.SEEN, near)
    views = TrackedObjectViews(replace(follow_scene, tracked=tracked, truth=None), STYLE)
    assert count_of(views.close_up((160, 80)), palette.PANEL, 0) == 0


def test_the_view_from_above_holds_vehicle_and_object(follow_scene):
    far = Boxes3D(np.array([[70.0, -30, -1.73]]), BOX.size_m, BOX.yaw_rad)
    scene = replace(follow_scene, tracked=tracked_in(TrackStatus.SEEN, far), truth=None)
    canvas = TrackedObjectViews(scene, STYLE).from_above((300, 400))
    assert count_of(canvas, palette.TRACKED_OBJECT) > 10
    assert count_of(canvas, palette.VEHICLE) > 5


def test_the_label_says_where_an_object_is_not_observed():
    text = {status: label_text(tracked_in(status)) for status in TrackStatus}
    assert text == {"seen": "18.0 km/h", "predicted": "predicted 18.0 km/h", "lost": "lost"}


def test_objects_over_time_are_a_row_each_and_missing_instants_are_blank(follow_scene):
    frame = replace(follow_scene.result.frame, image=None, calibration=None)
    bare = replace(follow_scene, result=replace(follow_scene.result, frame=frame))
    canvas = draw_tracked_objects({"van": [follow_scene, follow_scene], "cyclist": [bare]})
    rows, columns = (slice(0, 512), slice(516, 1028)), (slice(0, 640), slice(644, 1284))
    for row, column in ((rows[0], columns[0]), (rows[0], columns[1]), (rows[1], columns[0])):
        assert count_of(canvas[row, column], palette.TRACKED_OBJECT) > 60
    assert count_of(canvas[rows[0], columns[1]], palette.INSIDE, 90) > 200
    assert (canvas[rows[1], columns[1]] == palette.BACKGROUND).all()


def test_a_region_is_blue_and_its_ring_red():
    canvas = blank_canvas((60, 60), (100, 100, 100))
    region = rectangle(20, 20, 40, 40, (60, 60))
    draw_region(canvas, region.hull_px, region.outer_px)
    inside, ring, outside = canvas[30, 30].astype(int), canvas[30, 17].astype(int), canvas[30, 5]
    assert inside[2] > inside[0] + 30
    assert ring[0] > ring[2] + 30
    assert tuple(outside) == (100, 100, 100)


def test_a_way_of_one_place_is_no_line():
    canvas = blank_canvas((20, 20), palette.PANEL)
    draw_path(canvas, np.eye(3, 4), np.zeros((1, 3)), palette.EGO_PATH)
    assert (canvas == palette.PANEL).all()


def test_points_glow_on_the_object_and_are_dim_on_the_ground(scene):
    points = np.array([[12, 1, -1.0, 0], [12, 1, -1.7, 0], [12, 8, -0.2, 0]], np.float32)
    shown = ScanPoints.of(points, scene.ground, BOX)
    # The lowest first.
    np.testing.assert_array_equal(shown.points_velo[:, 2], np.sort(points[:, 2]))
    np.testing.assert_array_equal(shown.is_marked, [False, True, False])
    assert tuple(shown.colors[1]) == palette.TRACKED_OBJECT
    assert shown.colors[0].sum() < shown.colors[2].sum()


def test_the_nearest_point_is_on_top(scene):
    points = np.array([[40, 0, 0, 0], [10, 0, 0, 0]], np.float32)
    shown = ScanPoints(points, np.array([[9, 9, 9], [200, 0, 0]], np.uint8), np.zeros(2, bool))
    for order in (slice(None), slice(None, None, -1)):
        canvas = blank_canvas((200, 100), palette.PANEL)
        turned = replace(shown, points_velo=points[order], colors=shown.colors[order])
        turned.draw(canvas, scene.frame.calibration.image_P_velo)
        assert tuple(canvas[50, 100]) == (200, 0, 0)


def test_the_plot_rises_with_the_speed_and_shows_the_states():
    canvas = blank_canvas((240, 80), palette.BACKGROUND)
    states = [TrackStatus.SEEN, TrackStatus.SEEN, TrackStatus.PREDICTED, TrackStatus.LOST]
    draw_speed_chart(canvas, [0.0, 10.0, 20.0, np.nan], states, 8, 6)
    strip = canvas[round(0.70 * 80) + 4]
    assert [tuple(strip[column]) for column in (40, 65, 90, 120)] == [
        STATUS_COLORS[state] for state in states
    ]
    assert tuple(strip[200]) == palette.BACKGROUND
    rows, columns = np.nonzero((canvas[:55] == palette.TRACKED_OBJECT).all(axis=2))
    assert np.corrcoef(rows, columns)[0, 1] < -0.9


def test_the_plot_of_a_static_object_can_be_drawn():
    canvas = blank_canvas((240, 80), palette.BACKGROUND)
    draw_speed_chart(canvas, [np.nan, 0.0], [TrackStatus.LOST, TrackStatus.SEEN], 2, 6)
    assert (canvas != palette.BACKGROUND).any()


def test_a_trail_keeps_places_in_the_world_and_forgets_where_the_object_was_lost(scene):
    trail = TrackedObjectTrail()
    for shift_m, state in enumerate([TrackStatus.SEEN, TrackStatus.PREDICTED, TrackStatus.LOST]):
        pose = np.eye(4)
        pose[0, 3] = shift_m
        result = replace(scene, world_SE3_velo=pose)
        trail.add(result, tracked_in(state))
    # Seen from the last pose, two metres on.
    np.testing.assert_allclose(trail.path_velo(result)[:, 0], [10, 11])
    np.testing.assert_allclose(
        trail.ego_path_velo(result), [[-2, 0, -1.73], [-1, 0, -1.73], [0, 0, -1.73]]
    )
    assert trail.speeds_km_h[:2] == [18.0, 18.0]
    assert np.isnan(trail.speeds_km_h[2])


def test_pixels_stay_on_what_they_show_when_an_image_is_resized():
    image = np.zeros((40, 60, 3), np.uint8)
    image[10:12, 20:22] = 255
    fitted = FittedImage.within(image, (180, 90))
    assert fitted.canvas.shape == (90, 135, 3)
    rows, columns = np.nonzero(fitted.canvas[..., 0] > 127)
    np.testing.assert_allclose(
        fitted.resizing.move(np.array([[20.5, 10.5]]))[0], [columns.mean(), rows.mean()], atol=0.3
    )
    assert fitted.on_strip(200).shape == (90, 200, 3)


def test_a_window_is_enlarged_to_the_size_asked_for_and_blank_beyond_the_image():
    image = np.full((40, 60, 3), 77, np.uint8)
    resizing = Resizing.of_window(np.array([50.0, 10, 70, 20]), (80, 40))
    canvas = resizing.cut(image, (80, 40))
    assert tuple(canvas[20, 5]) == (77, 77, 77)
    assert tuple(canvas[20, 75]) == palette.PANEL
    np.testing.assert_allclose(resizing.move(np.array([[49.5, 9.5]])), [[-0.5, -0.5]])
