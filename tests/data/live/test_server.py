"""The server, and a viewer on the loopback interface."""

import socket
import sys

import numpy as np
import pytest

from data.live.serve import ResultServer
from data.messages.definitions import definition_of
from data.results.objects import FrameTracks
from perception.errors import MissingDependencyError, UsageError
from tests.data.live.viewer import Viewer
from tests.known_result import known_result


def test_a_viewer_receives_what_it_subscribes_to():
    with (
        ResultServer("a drive", "127.0.0.1", 0, min_score=0.0) as server,
        Viewer(server.address, "/tracks", "/ego/odometry") as viewer,
    ):
        viewer.take_texts(0.5)
        assert viewer.server_info["name"] == "a drive"
        schemas = {one["topic"]: one for one in viewer.channels.values()}
        assert schemas["/tracks"]["encoding"] == "cdr"
        assert schemas["/tracks"]["schemaEncoding"] == "ros2msg"
        assert schemas["/tracks"]["schema"] == definition_of("vision_msgs/msg/Detection3DArray")
        server.publish(known_result(1))
        received = [viewer.receive(), viewer.receive()]
    found = {topic: (stamp_ns, value) for topic, stamp_ns, value in received}
    stamp_ns, odometry = found["/ego/odometry"]
    assert stamp_ns == 100_000_000
    assert odometry.pose.pose.position.y == 50
    line = FrameTracks.of(known_result(1))
    ids = [int(one.id) for one in found["/tracks"][1].detections]
    x_m = [one.bbox.center.position.x for one in found["/tracks"][1].detections]
    assert ids == [one.id for one in line.tracks]
    assert x_m == pytest.approx([one.velo.position_m[0] for one in line.tracks])


def test_messages_that_nobody_takes_are_not_made(monkeypatch):
    with ResultServer("a drive", "127.0.0.1", 0, min_score=0.0) as server:
        monkeypatch.setattr("data.messages.channels.encoded", lambda message: pytest.fail("made"))
        server.publish(known_result(1))


def test_a_slow_viewer_drops_frames_and_does_not_hold_up_the_others():
    frames = 400
    with (
        ResultServer("a drive", "127.0.0.1", 0, min_score=0.0) as server,
        Viewer(server.address, "/lidar/points", "/camera/image/compressed") as viewer,
    ):
        viewer.take_texts(0.5)
        big = known_result(0)
        object.__setattr__(big.frame, "image", noise())
        for index in range(frames):
            object.__setattr__(big.frame, "stamp_s", float(index))
            server.publish(big)
        stamps = []
        while not stamps or stamps[-1] < frames - 1:
            topic, stamp_ns, _ = viewer.receive()
            if topic == "/camera/image/compressed":
                stamps.append(stamp_ns / 1e9)
    assert stamps == sorted(stamps)
    assert stamps[-1] == frames - 1  # the latest arrives
    assert len(stamps) < frames / 2


def noise():
    return np.random.default_rng(0).integers(0, 255, (360, 640, 3), np.uint8)


def test_a_port_in_use_is_one_sentence():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(UsageError, match=rf"port {port} of 127.0.0.1: .*in use.*--port"):
            ResultServer("a drive", "127.0.0.1", port, min_score=0.0)
    with pytest.raises(UsageError, match="port 99999"):
        ResultServer("a drive", "127.0.0.1", 99999, min_score=0.0)


def test_without_the_sdk_the_line_that_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(MissingDependencyError, match=r"foxglove-sdk.*pip install.*\[live\]"):
        ResultServer("a drive", "127.0.0.1", 0, min_score=0.0)
