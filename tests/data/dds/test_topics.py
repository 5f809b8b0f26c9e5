"""Topics of ROS 2 without ROS: the other side is a process that knows cyclonedds and message definitions alone."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags import rosbag2

from data.bags.bag import RawMessage
from data.bags.message_times import header_stamp_ns
from data.dds import result_publisher, ros_source
from data.dds.participant import DdsParticipant
from data.dds.result_publisher import RosFrames, RosPublisher, ros_name
from data.dds.ros_source import RosSource
from data.layouts import OpenConfig
from data.live.serve import LiveCounts, serve_results
from data.messages.definitions import encoded, typestore
from data.messages.topics import topics
from data.open_drive import open_drive
from perception.geometry import se3
from perception.pipeline import Pipeline, PipelineConfig
from perception.types import Frame
from tests.data.dds.listening import Listener, robot
from tests.known_result import known_result
from tests.obstacles.test_occupancy import FlatGround
from tests.syntax_trees import ROOT

pytest.importorskip("cyclonedds", reason="the extra `ros` is not installed")

GRIDS = dict.fromkeys(
    ("/trifuse/occupancy", "/trifuse/occupancy/static"), "nav_msgs/msg/OccupancyGrid"
)
ORIGIN_NS = 1_700_000_000_123_456_789
RESULTS = {
    ros_name(one.name): one.kind for one in topics(0.0) if one.kind in result_publisher._KINDS
}


def test_each_message_arrives_as_it_left(domain: int, monkeypatch):
    sent = []
    monkeypatch.setattr(
        result_publisher, "encoded", lambda value: sent.append(encoded(value)) or sent[-1]
    )
    base_SE3_velo = se3.from_euler(0, 0, 0, np.array([1.0, 0, 1.75]))
    frames = RosFrames(
        lidar="velodyne", base="base_link", base_SE3_velo=base_SE3_velo, static={("a", "b"): np.eye(4)}
    )  # fmt: skip
    kinds = {**RESULTS, **GRIDS, "/tf_static": "tf2_msgs/msg/TFMessage"}
    with DdsParticipant() as participant, robot(domain, kinds) as listener:
        publisher = RosPublisher(participant, frames, min_score=0.0, origin_ns=ORIGIN_NS)
        listener.wait_for("/tf_static")  # which is kept for those who come later
        end_s = time.monotonic() + 20
        writers = [one for _, one in publisher._writers] + [one for one, _ in publisher._grids]
        while not all(one.has_readers for one in writers):
            assert time.monotonic() < end_s
            time.sleep(0.01)
        publisher.publish(replace(known_result(1), ground=FlatGround()))
        for name in kinds:
            listener.wait_for(name)
    received = {name: rows[0] for name, rows in listener.received.items()}
    assert received.keys() == kinds.keys()
    # What the other side has decoded and encoded again is, to rosbags' reader, the message that left.
    same = {encoded(typestore().deserialize_cdr(received[name], kinds[name])) for name in kinds}
    assert same == set(sent)
    odometry = listener.decoded("/trifuse/ego/odometry")[0]
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    stamp = odometry.header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == ORIGIN_NS + 100_000_000
    # The LiDAR is at (100, 50, 3) and heads along y; the base is 1 m behind it and 1.75 m below.
    place = odometry.pose.pose.position
    assert (place.x, place.y, place.z) == pytest.approx((100, 49, 1.25))
    boxes = listener.decoded("/trifuse/tracks")[0]
    assert [boxes.header.frame_id, *(one.header.frame_id for one in boxes.detections)] == 3 * [
        "velodyne"
    ]
    grid, still = (listener.decoded(name)[0] for name in GRIDS)
    assert (grid.header.frame_id, grid.info.width, len(grid.data)) == ("odom", 201, 201 * 201)
    assert (grid.info.origin.position.x, grid.info.origin.position.y) == pytest.approx((80, 30))
    # The van 10 m ahead, at y = 60, moves; the static point 1 m to its right is above the ground, too.
    assert [int((one.data == 100).sum()) for one in (grid, still)] == [2, 1]
    (edge,) = listener.decoded("/tf")[0].transforms
    assert (edge.header.frame_id, edge.child_frame_id) == ("odom", "base_link")


def test_messages_that_nobody_takes_are_not_made(domain: int, monkeypatch):
    with DdsParticipant() as participant:
        publisher = RosPublisher(participant, RosFrames(), min_score=0.0)
        monkeypatch.setattr(result_publisher, "encoded", lambda value: pytest.fail("made"))
        publisher.publish(known_result(1))


def test_subscribers_come_and_go(domain: int):
    kinds = {"/trifuse/lidar/points": RESULTS["/trifuse/lidar/points"], **GRIDS}
    result = replace(known_result(1), ground=FlatGround())
    with DdsParticipant() as participant:
        publisher, stamp_s = RosPublisher(participant, RosFrames(), min_score=0.0), 0.0
        for _ in range(3):
            with robot(domain, kinds) as listener:  # which is killed at the end
                end_s = time.monotonic() + 20
                while not all(listener.received[name] for name in kinds):
                    assert time.monotonic() < end_s
                    start_s = time.process_time()
                    stamp_s += 0.25
                    publisher.publish(replace(result, frame=replace(result.frame, stamp_s=stamp_s)))
                    assert time.process_time() - start_s < 0.2
                    time.sleep(0.05)
        assert publisher.dropped == 0


def write_robot(street: Path, path: Path, **parts: Any) -> Path:
    """Write the drive for the robot: thinned scans, images of a quarter of the size, poses about z alone."""
    drive = open_drive(street)
    frames = [drive[index] for index in range(len(drive))]
    poses = [
        se3.from_euler(0, 0, float(np.arctan2(*one.world_SE3_velo[1::-1, 0])), one.world_SE3_velo[:3, 3])
        for one in frames
    ]  # fmt: skip
    scale = np.diag([0.25, 0.25, 1.0])
    np.savez(
        path,
        stamps_ns=[ORIGIN_NS + round(1e9 * one.stamp_s) for one in frames],
        poses=poses,
        images=[one.image[2::4, 2::4] for one in frames],
        camera_matrix=scale @ drive.calibration.image_P_cam[:, :3],
        tf_names=["base_footprint base_link", "base_link velodyne", "velodyne camera"],
        tf_poses=[
            [0, 0, 0, 0, 0, 0, 1],
            [0.8, 0, 1.73, 0, 0, 0, 1],
            [0.27, 0, -0.08, -0.5, 0.5, -0.5, 0.5],
        ],
        **parts,
        **{f"points_{index}": one.points_velo[::3] for index, one in enumerate(frames)},
    )
    return path


SENSORS = {
    "/velodyne_points": "sensor_msgs/msg/PointCloud2",
    "/odometry": "nav_msgs/msg/Odometry",
    "/camera/image_raw": "sensor_msgs/msg/Image",
    "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    "/tf_static": "tf2_msgs/msg/TFMessage",
}
CONFIG = OpenConfig(sensor="HDL-64E", reflectance_scale=1.0)


class EnoughError(Exception):
    pass


class Results:
    """Keeps results; ends the source after some."""

    def __init__(self, count: int) -> None:
        self.rows, self._count = [], count

    def publish(self, result) -> None:
        self.rows.append(result)
        if len(self.rows) == self._count:
            raise EnoughError


def laps(source: RosSource, listener: Listener) -> Iterator[Iterator[Frame]]:
    """Let the robot drive when its scans are awaited."""

    def frames() -> Iterator[Frame]:
        source._last = source._receiver.newest("/velodyne_points")
        listener.order()
        yield from source._frames(0)

    yield frames()


def test_a_bag_of_the_topics_gives_the_same_results(
    domain: int, street: Path, tmp_path: Path, monkeypatch
):
    path = write_robot(street, tmp_path / "robot.npz", pauses_s=[0, 0, 1.5, 0])
    monkeypatch.setattr(ros_source, "_MAX_WAIT_S", 10.0)
    kept = Results(4)
    with (
        robot(domain, SENSORS) as recorder,
        robot(domain, {"/trifuse/ego/odometry": RESULTS["/trifuse/ego/odometry"],
                       "/diagnostics": RESULTS["/diagnostics"]}, path) as listener,
        DdsParticipant() as participant,
    ):  # fmt: skip
        source = RosSource(participant, CONFIG)
        listener.order()
        listener.wait_for("stopped")
        publisher = RosPublisher(
            participant,
            source.frames,
            min_score=0.0,
            origin_ns=source.origin_ns,
            health=source.health,
        )
        source.on_silence = publisher.publish_health
        monkeypatch.setattr(source, "laps", lambda: laps(source, listener))
        with (
            Pipeline(source.sensor, PipelineConfig.for_motion()) as pipeline,
            pytest.raises(EnoughError),
        ):
            serve_results(source, pipeline, [publisher, kept], LiveCounts())
        listener.wait_for_end()
        recorder.wait_for("/velodyne_points", 5)
    bag = tmp_path / "bag"
    write_recorded(recorder.received, bag)
    recorded = open_drive(bag, config=CONFIG)
    assert len(recorded) == len(kept.rows) == 4
    with Pipeline(recorded.sensor, PipelineConfig.for_motion()) as pipeline:
        for live, frame in zip(kept.rows, recorded, strict=True):
            result = pipeline.step(frame)
            assert np.array_equal(frame.points_velo, live.frame.points_velo)
            assert np.array_equal(frame.image, live.frame.image)
            assert live.frame.world_SE3_velo is not None
            assert frame.world_SE3_velo == pytest.approx(live.frame.world_SE3_velo, abs=1e-12)
            assert result.world_SE3_velo == pytest.approx(live.world_SE3_velo, abs=1e-9)
            assert np.array_equal(result.obstacles.point_states, live.obstacles.point_states)
            assert np.array_equal(result.tracks.ids, live.tracks.ids)
    assert source.frames.base == "base_footprint"
    assert source.frames.world == "odom"
    messages = [status.message for one in listener.decoded("/diagnostics") for status in one.status]
    assert any("ERROR silent: nothing for " in one for one in messages)


def test_the_command_goes_on_at_faults_and_ends_at_sigterm(
    domain: int, street: Path, tmp_path: Path
):
    rows = [88, 44, 88, 88]  # of the second image there are half of the rows
    path = write_robot(street, tmp_path / "robot.npz", image_rows=rows)
    words = [
        "serve",
        "--ros",
        "--port",
        "0",
        "--sensor",
        "HDL-64E",
        "--pipeline.detection.modalities",
        "",
    ]
    kinds = {"/trifuse/ego/odometry": RESULTS["/trifuse/ego/odometry"]}
    with (
        robot(domain, kinds, path) as listener,
        subprocess.Popen([sys.executable, "-m", "perception", *words], cwd=ROOT,
                         stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as command,
    ):  # fmt: skip
        assert "connect a viewer" in command.stdout.readline()
        listener.order()
        listener.wait_for("stopped")
        listener.order()
        listener.wait_for_end()
        before_s, others_s = cpu_s(command.pid), ended_children_s()
        command.send_signal(signal.SIGTERM)
        printed = command.communicate(timeout=60)[1]
        ended_s = ended_children_s() - others_s - before_s
    assert command.returncode == 130
    assert "frames published: " in printed
    assert "image left out: " in printed
    stamps = [one.header.stamp for one in listener.decoded("/trifuse/ego/odometry")]
    found = [one.sec * 10**9 + one.nanosec for one in stamps]
    assert found[-4:] == np.load(path)["stamps_ns"].tolist()
    assert ended_s < 1


def cpu_s(pid: int) -> float:
    user, system = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def ended_children_s() -> float:
    return sum(os.times()[2:4])


def write_recorded(received: dict[str, list[bytes]], folder: Path) -> None:
    """Write what a recorder has received, from the first frame on."""
    plugin = rosbag2.StoragePlugin.MCAP
    with rosbag2.Writer(folder, version=9, storage_plugin=plugin) as writer:
        for topic, rows in received.items():
            connection = writer.add_connection(topic, SENSORS[topic], typestore=typestore())
            for data in rows:
                stamp_ns = header_stamp_ns(RawMessage(topic, 0, data), is_ros1=False)
                if topic == "/tf_static" or stamp_ns >= ORIGIN_NS:
                    writer.write(connection, max(stamp_ns, ORIGIN_NS), data)
