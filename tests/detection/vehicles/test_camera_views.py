"""A result of two cameras as each of them shows it, and in what is written of it."""

from dataclasses import replace

import numpy as np
import pytest

from data.exports.table_rows import table_rows
from data.results.objects import FrameVehicles
from perception.detection.vehicles.camera_joining import join_cameras
from perception.detection.vehicles.camera_views import views_of
from perception.geometry.camera import box_outlines_px
from perception.render.scene import SceneObjects
from perception.types import Boxes3D, Detections
from tests.detection.vehicles.test_camera_joining import located_by_both
from tests.known_result import known_result
from tests.vehicle_scenes import CALIBRATION, SIZE_PX, cars


@pytest.fixture(scope="module")
def result():
    """Return a result of a car ahead, one that the left camera shows better, and one that it alone shows."""
    true = Boxes3D.concatenate(
        [cars((20.0, 0.0, 0.1)), cars((10.0, 8.5, 0.1)), cars((0.0, 12.0, 0.0))]
    )
    frame, located = located_by_both(true, scores=(0.6, 0.9))
    found = [
        {
            "dm": Detections(
                part.fused.detections.boxes_px,
                np.full(len(part), score),
                part.fused.detections.types,
            )
        }
        for part, score in zip(located.values(), (0.625, 0.875), strict=True)
    ]
    rows = {
        camera: replace(
            part,
            fused=replace(
                part.fused,
                source_indices=np.column_stack(
                    [np.full(len(part), -1), np.arange(len(part)), np.full(len(part), -1)]
                ),
                dominant_modality=np.ones(len(part), int),
            ),
        )
        for camera, part in located.items()
    }
    return replace(
        known_result(),
        frame=frame,
        vehicles=join_cameras(rows, frame),
        modality_detections=found[0],
        further_detections=(found[1],),
    )


def test_each_camera_shows_the_vehicles_in_its_image(result):
    assert result.vehicles.cameras.tolist() == [1, 1, 0]
    main, left = views_of(result)
    assert (main.frame.camera, left.frame.camera) == ("front", "left")
    assert main.frame.further_cameras == left.frame.further_cameras == ()
    assert (len(main.vehicles), len(left.vehicles)) == (2, 2)
    ahead, beside = np.argsort(main.vehicles.boxes.bottom_m[:, 1])
    assert main.vehicles.fused.source_indices[ahead].tolist() == [-1, 0, -1]
    # What the other camera shows better is known by its 3D box.
    assert main.vehicles.fused.source_indices[beside].tolist() == [-1, -1, -1]
    outline_px = box_outlines_px(CALIBRATION.image_P_velo, main.vehicles.boxes, SIZE_PX)
    np.testing.assert_array_equal(
        main.vehicles.fused.detections.boxes_px[beside], outline_px[beside]
    )
    assert left.modality_detections == result.further_detections[0]


def test_a_result_of_one_camera_is_its_only_view():
    single = known_result()
    assert views_of(single) == (single,)


def test_records_and_tables_name_the_camera_and_have_its_scores(result):
    records = FrameVehicles.of(result).vehicles
    assert [one.camera for one in records] == ["left", "left", "front"]
    assert [one.scores["dm"] for one in records] == [0.875, 0.875, 0.625]
    rows = table_rows(result, 0.0)["vehicles"]
    assert rows["camera"].tolist() == ["left", "left", "front"]
    assert rows["score_dm"].tolist() == [0.875, 0.875, 0.625]


def test_boxes_of_another_image_are_not_drawn_in_that_of_the_main_camera(result):
    objects = SceneObjects.of(replace(result, tracks=result.tracks[:0]), 0.5)
    shown = np.isfinite(objects.in_camera(0).boxes_px).all(axis=1)
    assert shown.tolist() == [False, False, True]
