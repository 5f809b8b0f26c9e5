"""`trifuse serve`, with a viewer on the loopback interface."""

import socket
import threading
from functools import partial
from pathlib import Path

import pytest

from data.live import serve as live
from data.live import udp
from data.live.udp import UdpAddress
from perception.cli.main import main
from tests.data.live.viewer import Viewer


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def watch(port: int, seen: dict) -> None:
    """Connect as soon as the server is there, and keep the first points."""
    for _ in range(600):
        try:
            with Viewer(f"ws://127.0.0.1:{port}", "/lidar/points") as viewer:
                seen["points"] = viewer.receive(60)
                return
        except ConnectionRefusedError:
            threading.Event().wait(0.1)


def test_a_drive_is_shown_and_ctrl_c_ends_it(street: Path, monkeypatch, capsys):
    port, seen, publish = free_port(), {}, live.ResultServer.publish
    viewer = threading.Thread(target=watch, args=(port, seen))

    def publish_until_seen(server, result):
        publish(server, result)
        if "points" in seen:
            raise KeyboardInterrupt

    monkeypatch.setattr(live.ResultServer, "publish", publish_until_seen)
    viewer.start()
    words = ["serve", str(street), "--port", str(port), "--loop"]
    code = main([*words, "--pipeline.detection.modalities", ""])
    viewer.join()
    printed = capsys.readouterr()
    assert code == 130
    topic, _, cloud = seen["points"]
    assert topic == "/lidar/points"
    assert cloud.width > 10_000
    assert f"connect a viewer of Foxglove's protocol to ws://127.0.0.1:{port}" in printed.out
    assert "frames published: " in printed.err


def test_a_drive_ends_by_itself(street: Path, capsys):
    words = ["serve", str(street), "--port", "0", "--rate", "2"]
    assert main([*words, "--pipeline.detection.modalities", ""]) == 0
    assert "frames published: " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([], "expected a drive, or --source udp, found neither"),
        (["DRIVE", "--source", "udp"], "expected a drive, or --source udp, found both"),
        (["DRIVE", "--rate", "0"], "--rate: expected a number above 0, found 0"),
        (["DRIVE", "--port", "70000"], "port 70000 of 127.0.0.1: expected a port that is free"),
    ],
)
def test_what_cannot_work_is_one_sentence(words, sentence, street: Path, capsys):
    words = [str(street) if word == "DRIVE" else word for word in words]
    assert main(["serve", *words]) == 2
    assert sentence in capsys.readouterr().err


def test_a_lidar_that_does_not_send(monkeypatch, capsys):
    monkeypatch.setattr(udp, "UdpAddress", partial(UdpAddress, host="127.0.0.1", timeout_s=0.1))
    assert main(["serve", "--source", "udp", "--udp-port", str(free_port())]) == 2
    assert "expected packets of a LiDAR, found none in 0.1 s" in capsys.readouterr().err
