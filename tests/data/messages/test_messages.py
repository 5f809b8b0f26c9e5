"""Messages, written and read again."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from data.messages import geometry, images, motion, objects
from data.messages.definitions import definition_of, encoded, typestore
from data.messages.points import point_cloud
from data.messages.topics import diagnostics, topics
from perception.errors import MissingDependencyError
from perception.geometry import se3
from perception.geometry.boxes import corners
from perception.types import Calibration, CameraImage
from tests.known_result import IMAGE, POINTS_VELO, TRACKS, VEHICLES, known_result

STAMP_S = 1_700_000_000.5
# As KITTI's: the projection is of the reference camera, 6 cm beside the colour camera.
CALIBRATION = Calibration(
    image_P_cam=np.array([[50.0, 0, 32, 3.0], [0, 50, 16, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    image_size_px=(64, 32),
)


def reread(value):
    """Return a message as a program reads it."""
    return typestore().deserialize_cdr(encoded(value), value.__msgtype__)


def test_every_topic_of_a_result_has_a_message_of_its_type():
    result, last = known_result(1), known_result(0)
    found = {topic.name: topic.message_of(result, last) for topic in topics(min_score=0.0)}
    missing = {name for name, value in found.items() if value is None}
    assert missing == {"/camera/detections/rm", "/maps/rm/compressed"}
    for topic in topics(min_score=0.0):
        if topic.name not in missing:
            assert reread(found[topic.name]).__msgtype__ == topic.kind
            assert definition_of(topic.kind)


def test_the_document_lists_all_topics():
    document = (Path(__file__).parents[3] / "docs" / "own_data" / "live.md").read_text()
    rows = [line.split("|")[1:3] for line in document.splitlines() if line.startswith("| `/")]
    names = [name.strip("` ") for row in rows for name in row[0].split(",")]
    assert sorted(names) == sorted(topic.name for topic in topics(min_score=0.0))
    kinds = {kind.strip("` ").rpartition("/")[2] for row in rows for kind in row[1].split(",")}
    assert kinds == {topic.kind.rpartition("/")[2] for topic in topics(min_score=0.0)}


def test_each_further_camera_has_topics_of_its_own():
    result = known_result(0)
    image = np.full((32, 64, 3), 128, np.uint8)
    side = replace(CALIBRATION, cam_SE3_velo=se3.from_euler(0, 0, 0, np.array([0.0, 0, 0.5])))
    further = (CameraImage("/left/image", side, image), CameraImage("rear", CALIBRATION))
    views = replace(
        result,
        frame=replace(result.frame, further_cameras=further),
        further_detections=(result.modality_detections, {}),
    )
    names = ["/left/image", "rear"]
    of = {topic.name: topic.message_of for topic in topics(min_score=0.0, cameras=names)}
    own = {topic.name for topic in topics(min_score=0.0)}
    parts = {name.removeprefix("/camera/") for name in own if name.startswith("/camera/")}
    left, rear = ({f"/cameras/{name}/{part}" for part in parts} for name in ("left_image", "rear"))
    assert set(of) == own | left | rear
    jpeg = reread(of["/cameras/left_image/image/compressed"](views, None))
    assert cv2.imdecode(jpeg.data, cv2.IMREAD_COLOR).shape == image.shape
    assert jpeg.header.frame_id == "cameras/left_image"
    assert len(of["/cameras/left_image/detections/rgb"](views, None).points) == 1
    assert of["/cameras/rear/image/compressed"](views, None) is None
    tree = of["/tf"](views, None).transforms
    assert [one.child_frame_id for one in tree] == [
        "lidar",
        "camera",
        "cameras/left_image",
        "cameras/rear",
    ]


def test_faint_detections_and_vehicles_are_left_out():
    of = {topic.name: topic.message_of for topic in topics(min_score=0.8)}
    result = known_result(0)
    assert len(of["/camera/detections/fused"](result, None).points) == 1
    assert of["/camera/detections/rgb"](result, None).points == []
    assert [one.id for one in of["/vehicles"](result, None).detections] == ["4"]


def test_without_a_camera_there_are_points_and_tracks():
    result = known_result(0, has_camera=False)
    names = {
        topic.name for topic in topics(min_score=0.0) if topic.message_of(result, None) is not None
    }
    tracks = {"/tracks", "/tracks/scene", "/tracks/markers"}
    assert names == {"/tf", "/ego/odometry", "/lidar/points", "/diagnostics"} | tracks


def test_points_keep_order_state_and_vehicle():
    cloud = reread(point_cloud(known_result(0)))
    kinds = {2: "u1", 5: "<i4", 7: "<f4"}
    dtype = np.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [kinds[field.datatype] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )
    rows = cloud.data.view(dtype)
    assert (cloud.width, cloud.height, cloud.row_step) == (3, 1, 3 * cloud.point_step)
    xyzi = np.column_stack([rows[name] for name in ("x", "y", "z", "intensity")])
    assert (xyzi == POINTS_VELO).all()
    assert rows["class"].tolist() == [1, 2, 3]
    assert rows["id"].tolist() == [4, -1, 4]


def test_times_are_exact_to_the_resolution_of_the_stamp():
    stamp = geometry.time(STAMP_S)
    assert (stamp.sec, stamp.nanosec) == (1_700_000_000, 500_000_000)
    assert geometry.stamp_ns(-0.1) == 0


def test_the_camera_has_a_projection_without_a_fourth_column():
    info = reread(images.camera_info(STAMP_S, CALIBRATION, (64, 32)))
    camera_SE3_velo = motion.camera_SE3_velo(CALIBRATION)
    point = np.array([10.0, 1.0, -0.5, 1.0])
    expected = CALIBRATION.image_P_velo @ point
    found = info.p.reshape(3, 4) @ camera_SE3_velo @ point
    assert found == pytest.approx(expected, abs=1e-9)
    assert (info.width, info.height) == (64, 32)


def test_the_camera_is_placed_on_the_vehicle():
    result = known_result(0)
    result = replace(
        result, frame=replace(result.frame, image=IMAGE[:32, :64], calibration=CALIBRATION)
    )
    pose, camera = reread(motion.transforms(result)).transforms
    assert (pose.header.frame_id, pose.child_frame_id) == ("world", "lidar")
    assert (camera.header.frame_id, camera.child_frame_id) == ("lidar", "camera")
    rotation = camera.transform.rotation
    # KITTI's camera looks along the LiDAR's x: half a turn about (1, -1, 1), by 120 degrees.
    assert np.abs([rotation.x, rotation.y, rotation.z, rotation.w]) == pytest.approx([0.5] * 4)
    origin = camera.transform.translation
    assert (origin.x, origin.y, origin.z) == pytest.approx((0.27, 0.06, -0.08))


def test_odometry_has_pose_and_velocity():
    first = reread(motion.odometry(known_result(0), None))
    assert first.twist.twist.linear.x == 0
    later = known_result(1)
    # A metre along the world's y in a tenth of a second.
    pose = se3.from_rotation_translation(np.eye(3), np.array([0, 1.0, 0])) @ later.world_SE3_velo
    moving = reread(motion.odometry(replace(later, world_SE3_velo=pose), known_result(0)))
    position = moving.pose.pose.position
    assert (position.x, position.y, position.z) == pytest.approx((100, 51, 3))
    linear = moving.twist.twist.linear
    assert (linear.x, linear.y, linear.z) == pytest.approx((10, 0, 0), abs=1e-4)
    heading = moving.pose.pose.orientation
    assert (heading.z, heading.w) == pytest.approx((np.sqrt(0.5), np.sqrt(0.5)))


def test_values_of_the_tracks():
    van, walker = reread(objects.detection_array(STAMP_S, objects.Object.of(TRACKS))).detections
    assert (van.id, walker.id) == ("4", "9")
    assert (van.results[0].hypothesis.class_id, walker.results[0].hypothesis.class_id) == (
        "Van",
        "object",
    )
    assert van.results[0].hypothesis.score == 0.8125
    center = van.bbox.center.position
    assert (center.x, center.y, center.z) == pytest.approx((10.0, 2.0, -1.7 + 0.75))
    assert van.results[0].pose.covariance[[0, 1, 6, 7]].tolist() == [0.04, 0, 0, 0.01]
    assert walker.results[0].pose.covariance.tolist() == [0.0] * 36


def test_a_vehicle_without_a_box_is_in_the_image_alone():
    tracks = VEHICLES.as_tracks(np.arange(2))
    assert len(objects.detection_array(STAMP_S, objects.Object.of(tracks)).detections) == 1
    boxes = reread(images.annotations(STAMP_S, VEHICLES.fused.detections))
    assert [text.text for text in boxes.texts] == ["Car 0.88", "Van 0.03"]
    outline = [(point.x, point.y) for point in boxes.points[0].points]
    assert outline == [(500, 150), (620.25, 150), (620.25, 240), (500, 240)]


def test_foxglove_draws_box_label_and_velocity():
    update = reread(objects.scene(STAMP_S, objects.Object.of(TRACKS)))
    assert [one.type for one in update.deletions] == [1]
    van, walker = update.entities
    assert (van.id, walker.id, van.frame_id) == ("4", "9", "lidar")
    assert van.texts[0].text == "Van 4 5.0 m/s"
    values = {pair.key: pair.value for pair in van.metadata}
    assert values["velocity_x_m_s"] == "3.0000"
    assert (values["is_observed"], values["score"]) == ("true", "0.8125")
    assert van.arrows[0].shaft_length == 5.0
    for entity, box in zip((van, walker), corners(TRACKS.boxes), strict=True):
        (cube,) = entity.cubes
        yaw_rad = 2 * np.arctan2(cube.pose.orientation.z, cube.pose.orientation.w)
        front_left_m = [cube.size.x / 2, cube.size.y / 2]
        turn = np.array([[np.cos(yaw_rad), -np.sin(yaw_rad)], [np.sin(yaw_rad), np.cos(yaw_rad)]])
        found = turn @ front_left_m + [cube.pose.position.x, cube.pose.position.y]
        assert found == pytest.approx(box[0, :2])


def test_rviz_draws_box_label_and_velocity():
    clear, *rows = reread(objects.markers(STAMP_S, objects.Object.of(TRACKS))).markers
    assert clear.action == 3
    assert [row.ns for row in rows] == 2 * ["boxes", "labels", "velocities"]
    start, tip = rows[2].points
    assert (tip.x - start.x, tip.y - start.y) == pytest.approx((3, 4))
    assert len({(row.ns, row.id) for row in rows}) == len(rows)


def test_images_are_jpeg():
    image = reread(images.compressed_image(STAMP_S, known_result(0).frame.image))
    pixels = cv2.imdecode(image.data, cv2.IMREAD_COLOR)
    assert pixels.shape == IMAGE.shape
    assert pixels[16, 10] == pytest.approx([0, 0, 255], abs=4)  # red; OpenCV: blue, green, red
    grey = reread(images.compressed_image(STAMP_S, np.full((8, 8), 128, np.uint8)))
    assert cv2.imdecode(grey.data, cv2.IMREAD_UNCHANGED).shape == (8, 8)


def test_stage_times_and_what_was_left_out():
    result = known_result(0)
    status, *sensors = reread(diagnostics(result)).status
    assert [(one.name, one.level, one.message) for one in sensors] == [
        (f"trifuse: {part}", 0, "OK") for part in ("lidar", "camera", "ins", "calibration")
    ]
    assert status.message == "left out: DepthCN"
    status = reread(diagnostics(replace(result, skipped=()))).status[0]
    values = {pair.key: pair.value for pair in status.values}
    assert (values["ground [ms]"], values["fusion [ms]"]) == ("5.00", "2.00")
    assert status.message == "all stages ran"


def test_without_rosbags_the_line_that_installs_it(monkeypatch):
    typestore.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "rosbags.typesys", None)
    with pytest.raises(MissingDependencyError, match=r"rosbags.*pip install.*\[live\]"):
        typestore()
    monkeypatch.undo()
    typestore.cache_clear()
