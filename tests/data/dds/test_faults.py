"""Faults of a robot's topics: each is said once, frames go on, and what comes late is taken up."""

import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from data.bags.bag import RawMessage
from data.dds import ros_source
from data.dds.participant import DdsParticipant
from data.dds.receiver import stamp_ns
from data.dds.ros_source import RosSource
from data.layouts import OpenConfig
from perception.errors import PoseError
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import VLP_16
from perception.types import Frame
from tests.data.dds.listening import Listener, robot
from tests.rays import unit_rays

pytest.importorskip("cyclonedds", reason="the extra `ros` is not installed")

ORIGIN_NS = 1_700_000_000_123_456_789
SIZE = (24, 32)
CAMERA, LEFT = "/camera/image_raw", "/left/image_raw/compressed"
LIDAR, ODOMETRY = "/velodyne_points", "/odometry"


def images(seed: int, count: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (count, *SIZE, 3), np.uint8)


def write_small_robot(path: Path, frames: int, **parts: Any) -> Path:
    """Write a drive straight ahead over flat ground."""
    x, y = np.meshgrid(np.linspace(-20, 20, 40), np.linspace(-10, 10, 30))
    ground = np.stack([x, y, np.full(x.shape, -1.73), np.full(x.shape, 0.3)], -1).reshape(-1, 4)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, 0, 3] = np.arange(frames)
    left = images(1, frames)
    pngs = [cv2.imencode(".png", one[:, :, ::-1])[1].ravel() for one in left]
    np.savez(
        path,
        follows=True,
        images=images(0, frames),
        camera_matrix=np.array([[20.0, 0, 16], [0, 20, 12], [0, 0, 1]]),
        tf_names=["base_footprint base_link", "base_link velodyne", "velodyne camera", "velodyne left"],
        tf_poses=[[0, 0, 0, 0, 0, 0, 1], [0.8, 0, 1.73, 0, 0, 0, 1], *[[0.2, y_m, 0, -0.5, 0.5, -0.5, 0.5] for y_m in (0, 0.5)]],
        **{"poses": poses, "stamps_ns": ORIGIN_NS + 100_000_000 * np.arange(frames), **parts},
        **{f"points_{one}": ground for one in range(frames) if f"points_{one}" not in parts},
        **({f"left_{one}": png for one, png in enumerate(pngs)} if "left" in parts else {}),
    )  # fmt: skip
    return path


class Drive:
    """A source, and the robot that it receives frames of."""

    def __init__(self, source: RosSource, listener: Listener) -> None:
        self.source, self._listener = source, listener
        self.laps = source.laps()
        self._frames = next(self.laps)
        self.restarts = 0

    def send(self) -> None:
        self._listener.order()

    def next(self) -> Frame:
        """Return the next frame of this lap, or of the next one."""
        frame = next(self._frames, None)
        if frame is None:
            self.restarts += 1
            self._frames = next(self.laps)
            frame = next(self._frames)
        return frame

    @property
    def faults(self) -> list[tuple[str, str]]:
        """Topics and faults that are reported now."""
        own = "other clock"  # of the scans, whose stamps are years old
        found = [(one.part, one.fault) for one in self.source.health.health.findings]
        return sorted(one for one in found if one != (LIDAR, own))


# On a busy machine messages come late, and in any order: what is tested waits for them.
TIMES_S = {"_MAX_FIRST_S": 1.5, "_CHECK_S": 0.0, "_MAX_WAIT_S": 10.0, "_SILENT_S": 60.0}


def topics_at_first(path: Path) -> set[str]:
    """Return the topics on which a robot sends before it is told to drive."""
    with np.load(path) as parts:
        topics = {"tf": "/tf_static", "infos": "/camera/camera_info", "poses": ODOMETRY}
        late = {topic for name, topic in topics.items() if f"{name}_from" in parts}
        left = {LEFT, "/left/camera_info"} if "left_0" in parts else set()
        return {LIDAR, CAMERA, *topics.values(), *left} - late


class PatientSource(RosSource):
    """Waits until some topics have messages."""

    def __init__(self, topics: set[str], *args: Any) -> None:
        self._topics = topics
        super().__init__(*args)

    def _await_scans(self) -> None:
        super()._await_scans()
        end_s, receiver = time.monotonic() + 30, self._receiver
        while not self._topics <= {name for name, rows in receiver.messages().items() if rows}:
            assert time.monotonic() < end_s, receiver.messages().keys()
            for topic in self._participant.publications():
                receiver.add(topic)
            time.sleep(0.02)


@contextmanager
def driving(
    domain: int, path: Path, monkeypatch, *, is_silent: bool = False, **config: Any
) -> Iterator[Drive]:
    """Open the topics of a robot, which then stops until it is told to send frames."""
    for name, value in TIMES_S.items():
        monkeypatch.setattr(ros_source, name, value)
    if is_silent:
        monkeypatch.setattr(ros_source, "_SILENT_S", 0.3)
    topics = topics_at_first(path)
    reading = OpenConfig(sensor="HDL-64E", reflectance_scale=1.0, **config)
    with robot(domain, {}, path) as listener, DdsParticipant() as participant:
        source = PatientSource(topics, participant, reading)
        listener.order()
        last_ns, end_s = int(listener.wait_for("stopped")[0]), time.monotonic() + 2
        while stamp_ns(source._receiver.newest(LIDAR)) < last_ns and time.monotonic() < end_s:
            time.sleep(0.01)
        drive = Drive(source, listener)
        listener.order()
        end = threading.Timer(60, source.close)
        end.start()
        try:
            yield drive
        finally:
            end.cancel()
            source.close()


def reason(drive: Drive, topic: str, fault: str) -> str:
    return next(
        one.reason
        for one in drive.source.health.health.findings
        if (one.part, one.fault) == (topic, fault)
    )


def test_two_cameras_one_of_them_compressed(domain: int, tmp_path: Path, monkeypatch):
    path = write_small_robot(tmp_path / "robot.npz", 2, left=True)
    names = f"{CAMERA},{LEFT.strip('/')}"
    with driving(domain, path, monkeypatch, camera=names) as drive:
        for index in range(2):
            frame = drive.next()
            assert np.array_equal(frame.image, images(0, 2)[index])
            (left,) = frame.further_cameras
            assert (frame.camera, left.name) == (CAMERA, LEFT.strip("/"))
            assert np.array_equal(left.image, images(1, 2)[index])
            offset = left.calibration.cam_SE3_velo - frame.calibration.cam_SE3_velo
            assert offset[:3, 3] == pytest.approx([0.5, 0, 0])
            drive.send()
        assert drive.faults == []
        assert drive.source.health.parts == (LIDAR, ODOMETRY, CAMERA, LEFT)


def test_what_comes_late_is_taken_up(domain: int, tmp_path: Path, monkeypatch):
    path = write_small_robot(tmp_path / "robot.npz", 90, tf_from=1, infos_from=2, poses_from=4)
    with driving(domain, path, monkeypatch) as drive:
        first = frame = drive.next()
        assert (first.image, first.calibration, first.world_SE3_velo) == (None, None, None)
        assert drive.source.frames.base == "velodyne"
        assert drive.faults == [(CAMERA, "images not used")]
        assert "expected a topic camera_info beside it" in reason(drive, CAMERA, "images not used")
        while frame.image is None or frame.world_SE3_velo is None:
            time.sleep(0.05)  # as topics are found in their time
            drive.send()
            frame = drive.next()
        index = frame.index
        assert np.array_equal(frame.image, images(0, 90)[index])
        # The LiDAR is 0.8 m ahead of the frame whose poses are stated.
        assert frame.world_SE3_velo[:3, 3] == pytest.approx([index + 0.8, 0, 1.73])
        assert drive.faults == []
        # Poses that come change the world, so that all before is forgotten; a camera does not.
        assert drive.restarts == 1
        assert (drive.source.frames.base, drive.source.frames.world) == ("base_footprint", "odom")


def test_poses_are_those_of_the_topic_that_is_named(domain: int, tmp_path: Path, monkeypatch):
    path = write_small_robot(tmp_path / "robot.npz", 2)
    with driving(domain, path, monkeypatch, odometry="filtered/odometry") as drive:
        assert drive.next().world_SE3_velo is None
        assert ODOMETRY not in drive.source.health.parts


def test_images_that_change_their_size(domain: int, tmp_path: Path, monkeypatch):
    path = write_small_robot(tmp_path / "robot.npz", 3, image_rows=[24, 12, 24])
    with driving(domain, path, monkeypatch) as drive:
        assert drive.next().image is not None
        drive.send()
        assert drive.next().image is None
        assert drive.faults == [(CAMERA, "image left out")]
        drive.send()
        assert np.array_equal(drive.next().image, images(0, 3)[2])
        assert drive.faults == []


def test_stamps_that_jump_back_and_ahead(domain: int, tmp_path: Path, monkeypatch):
    jumps_ns = [0, -5_000_000_000, -5_000_000_000, 9_000_000_000, 9_000_000_000]
    path = write_small_robot(tmp_path / "robot.npz", 5, offsets_ns=jumps_ns)
    with driving(domain, path, monkeypatch) as drive:
        start_s = 0.0
        for index, jump_ns in enumerate(jumps_ns):
            frame = drive.next()
            start_s = start_s or frame.stamp_s
            assert frame.stamp_s - start_s == pytest.approx(0.1 * index + jump_ns / 1e9, abs=1e-6)
            # What is of the same time is joined, whatever the clock showed before.
            assert np.array_equal(frame.image, images(0, 5)[index])
            assert frame.world_SE3_velo is not None
            if jump_ns:
                topics = (CAMERA, ODOMETRY, LIDAR)
                assert drive.faults == sorted((one, "stamps jumped") for one in topics)
                # Some time has passed on the way.
                step_s = float(reason(drive, LIDAR, "stamps jumped").split()[1])
                assert step_s == pytest.approx(-5 if jump_ns < 0 else 14, abs=1)
            drive.send()


def test_stamps_that_jump_while_a_frame_is_made(domain: int, tmp_path: Path, monkeypatch):
    path = write_small_robot(tmp_path / "robot.npz", 1)
    with driving(domain, path, monkeypatch) as drive:
        receiver = drive.source._receiver
        older: list[RawMessage] = []

        def receive_older(scan: RawMessage) -> None:
            if not older:
                sec, *rest = struct.unpack_from("<iI", scan.data, 4)
                data = scan.data[:4] + struct.pack("<iI", sec - 100, *rest) + scan.data[12:]
                older.append(RawMessage(LIDAR, time.time_ns(), data))
                with receiver.changed:
                    receiver._keep(older[0])

        monkeypatch.setattr(drive.source, "_await_others", receive_older)
        assert drive.next().stamp_s == pytest.approx((stamp_ns(older[0]) - drive.source.origin_ns) / 1e9)  # fmt: skip
        assert drive.source.dropped == 1
        assert (LIDAR, "stamps jumped") in drive.faults


def test_a_clock_that_is_off(domain: int, tmp_path: Path, monkeypatch):
    path = write_small_robot(tmp_path / "robot.npz", 2, camera_offset_ns=4_200_000_000)
    # Each frame waits that long for an image of its time, which never comes.
    monkeypatch.setitem(TIMES_S, "_MAX_WAIT_S", 3.0)
    with driving(domain, path, monkeypatch) as drive:
        for index in range(2):
            assert np.array_equal(drive.next().image, images(0, 2)[index])
            assert drive.faults == [(CAMERA, "other clock")]
            assert reason(drive, CAMERA, "other clock") == "stamps are +4.2 s from the clock of the scans"  # fmt: skip
            drive.send()


def test_a_driver_that_starts_again_less_reliable(domain: int, tmp_path: Path, monkeypatch):
    path = write_small_robot(tmp_path / "robot.npz", 30, best_effort_from=2)
    with driving(domain, path, monkeypatch, is_silent=True) as drive:
        first = drive.next()
        drive.send()
        drive.next()
        # Its first scan nobody receives; it is silent, and looked for, until the next one comes.
        looked_for: list[str] = []

        def send_again() -> None:
            looked_for.append(LIDAR)
            if len(looked_for) % 5 == 0:
                drive.send()

        drive.source.on_silence = send_again
        drive.send()
        frames = (drive.next().stamp_s - first.stamp_s) / 0.1
        assert frames == pytest.approx(3 + len(looked_for) // 5 - 1, abs=1e-5)
        assert drive.restarts == 0


def test_an_error_of_the_pipeline_is_said_and_frames_go_on(
    domain: int, tmp_path: Path, monkeypatch
):
    path = write_small_robot(tmp_path / "robot.npz", 2)
    with driving(domain, path, monkeypatch) as drive:
        drive.next()
        assert drive.source.recovers_from(PoseError("frame", expected="poses", found="a jump"))
        assert drive.faults == [(LIDAR, "started again")]
        drive.laps, before = drive.source.laps(), drive.restarts
        drive._frames = next(drive.laps)
        drive.send()
        assert drive.next().index == 1
        assert drive.restarts == before


def street_scan(time_s: float, noise: np.random.Generator) -> np.ndarray:
    """Return the scan of a VLP-16 between walls and posts, where a car passes on the left at 8 m/s."""
    elevation = np.radians(np.arange(-15, 16, 2.0))
    rays = unit_rays(np.radians(np.arange(0, 360, 0.4)), elevation)
    ranges_m = np.where(rays[:, 2] < -0.01, 1.73 / np.maximum(-rays[:, 2], 1e-3), 60.0)
    ranges_m = np.minimum(ranges_m, 12 / np.maximum(np.abs(rays[:, 1]), 1e-3))
    boxes = [(x, y, 0.3, 0.3) for x in range(-30, 31, 6) for y in (-8, 8)]
    for x, y, half_x, half_y in [*boxes, (-2 + 8 * time_s, 4, 2.2, 0.9)]:
        with np.errstate(divide="ignore", invalid="ignore"):
            sides = [
                np.array(one) / rays[:, :2]
                for one in ((x - half_x, y - half_y), (x + half_x, y + half_y))
            ]
        near_m, far_m = np.minimum(*sides).max(axis=1), np.maximum(*sides).min(axis=1)
        is_hit = (near_m > 0) & (near_m < far_m) & (near_m * rays[:, 2] < -0.1)
        ranges_m[is_hit] = np.minimum(ranges_m[is_hit], near_m[is_hit])
    is_return = ranges_m < 40
    points = rays * (ranges_m + noise.normal(0, 0.01, len(rays)))[:, None]
    return np.column_stack([points, np.full(len(points), 0.3)])[is_return]


def test_a_lidar_that_was_silent_goes_on_with_the_same_ids(
    domain: int, tmp_path: Path, monkeypatch
):
    noise = np.random.default_rng(0)
    times_s = np.append(0.1 * np.arange(7), 1.3 + 0.1 * np.arange(3))
    scans = {f"points_{index}": street_scan(one, noise) for index, one in enumerate(times_s)}
    stamps_ns = ORIGIN_NS + np.round(1e9 * times_s).astype(np.int64)
    still = {"poses": np.tile(np.eye(4), (len(times_s), 1, 1)), "stamps_ns": stamps_ns}
    path = write_small_robot(tmp_path / "robot.npz", len(times_s), **still, **scans)
    ids, told = [], []
    with (
        driving(domain, path, monkeypatch, is_silent=True) as drive,
        Pipeline(replace(VLP_16, height_m=1.73), PipelineConfig.for_motion()) as pipeline,
    ):

        def go_on() -> None:
            told.append(drive.faults)
            if len(told) == 1 and len(ids) == 7:
                drive.send()

        drive.source.on_silence = go_on
        for index in range(len(times_s)):
            ids.append(
                pipeline.step(replace(drive.next(), image=None, calibration=None)).tracks.ids
            )
            if index == 6:
                told.clear()
            else:
                drive.send()
        assert (LIDAR, "silent") in told[0]
        assert (LIDAR, "silent") not in drive.faults
    assert [one.tolist() for one in ids[-4:]] == [ids[6].tolist()] * 4
    assert len(ids[6]) == 1
