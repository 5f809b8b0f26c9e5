"""An MCAP file, read by two other programs."""

import errno
import io
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from data.exports.mcap_writer import McapWriter
from data.messages.definitions import typestore
from data.results.objects import FrameTracks
from perception.errors import MissingDependencyError, WriteError
from tests.known_result import known_result

FRAMES = 3


@pytest.fixture
def path(tmp_path: Path) -> Path:
    writer = McapWriter(tmp_path / "out" / "results.mcap", min_score=0.0)
    for index in range(FRAMES):
        writer.add(known_result(index), None)
    writer.close(is_complete=True)
    return tmp_path / "out" / "results.mcap"


def test_values_are_those_of_tracks_jsonl(path):
    with AnyReader([path], default_typestore=typestore()) as reader:
        connections = [one for one in reader.connections if one.topic == "/tracks"]
        rows = [
            (stamp_ns, reader.deserialize(data, connection.msgtype))
            for connection, stamp_ns, data in reader.messages(connections)
        ]
    assert len(rows) == FRAMES
    for index, (stamp_ns, found) in enumerate(rows):
        line = FrameTracks.of(known_result(index))
        assert stamp_ns * 1e-9 == pytest.approx(line.stamp_s, abs=1e-6)
        for one, expected in zip(found.detections, line.tracks, strict=True):
            assert (int(one.id), one.results[0].hypothesis.class_id) == (
                expected.id,
                expected.type or "object",
            )
            center, size = one.bbox.center.position, one.bbox.size
            bottom_m = [center.x, center.y, center.z - size.z / 2]
            assert bottom_m == pytest.approx(expected.velo.position_m, abs=1e-4)
            assert [size.x, size.y, size.z] == pytest.approx(expected.size_m)
            turn = one.bbox.center.orientation
            yaw_rad = 2 * np.arctan2(turn.z, turn.w)
            assert yaw_rad == pytest.approx(expected.velo.yaw_rad, abs=1e-6)


def test_the_reader_of_the_format_finds_times_that_rise_and_schemas(path):
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        stamps_ns = [message.log_time for _, _, message in reader.iter_messages()]
    schemas = {schema.name: schema for schema in summary.schemas.values()}
    assert {"sensor_msgs/msg/PointCloud2", "foxglove_msgs/msg/SceneUpdate"} <= schemas.keys()
    assert {schema.encoding for schema in schemas.values()} == {"ros2msg"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    assert stamps_ns == sorted(stamps_ns)
    counts = {
        summary.channels[number].topic: count
        for number, count in summary.statistics.channel_message_counts.items()
    }
    assert set(counts.values()) == {FRAMES}
    assert {"/tf", "/ego/odometry", "/lidar/points", "/camera/image/compressed"} <= counts.keys()


def test_schemas_of_the_file_alone_decode_its_messages(path):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    with path.open("rb") as file:
        messages = {channel.topic: (schema, message) for schema, channel, message in
                    make_reader(file).iter_messages()}  # fmt: skip
    for schema, message in messages.values():
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(schema.data.decode(), schema.name))
        assert store.deserialize_cdr(message.data, schema.name).__msgtype__ == schema.name


def test_the_file_takes_its_place_when_it_is_closed(tmp_path):
    writer = McapWriter(tmp_path / "a.mcap", min_score=0.0)
    writer.add(known_result(0), None)
    assert not (tmp_path / "a.mcap").exists()
    writer.close(is_complete=True)
    assert [one.name for one in tmp_path.iterdir()] == ["a.mcap"]


def test_messages_are_dated_by_the_clock_of_the_recording(tmp_path):
    origin_ns = 1_317_042_272_335_337_762
    writer = McapWriter(tmp_path / "a.mcap", min_score=0.0, origin_ns=origin_ns)
    writer.add(known_result(1), None)
    writer.close(is_complete=True)
    with (tmp_path / "a.mcap").open("rb") as file:
        stamps_ns = {message.log_time for _, _, message in make_reader(file).iter_messages()}
    (stamp_ns,) = stamps_ns
    assert abs(stamp_ns - origin_ns - 100_000_000) < 1000  # float64 seconds hold 0.2 us


class FullDisk(io.BytesIO):
    def write(self, data):
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_is_one_sentence_and_leaves_no_file(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(Path, "open", lambda self, mode: FullDisk())
    writer = McapWriter(tmp_path / "a.mcap", min_score=0.0)
    with pytest.raises(WriteError, match=r"a\.mcap.*No space left"):
        for index in range(100):
            writer.add(known_result(index), None)
        writer.close(is_complete=True)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr().err == ""


def test_a_place_that_cannot_be_written_to(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match=r"a\.mcap"):
        McapWriter(tmp_path / "file" / "a.mcap", min_score=0.0)


def test_without_the_sdk_the_line_that_installs_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(MissingDependencyError, match=r"foxglove-sdk.*pip install.*\[live\]"):
        McapWriter(tmp_path / "a.mcap", min_score=0.0)
