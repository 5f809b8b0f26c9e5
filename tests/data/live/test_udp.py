"""A LiDAR on the loopback interface."""

import socket
import struct
import threading
import time

import numpy as np
import pytest

from data.live.udp import UdpAddress, UdpLidar
from perception.errors import ScanError, UsageError
from perception.sensor import VLP_16
from tests.packet_writer import PACKET_US, turns

ANY = UdpAddress(port=0, host="127.0.0.1", timeout_s=5.0)


def send(port: int, packets: list[bytes]) -> threading.Thread:
    """Send packets from a thread, slowly enough for the socket's buffer."""

    def run() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for number, one in enumerate(packets):
                sender.sendto(one, ("127.0.0.1", port))
                if number % 50 == 49:
                    time.sleep(0.01)

    thread = threading.Thread(target=run)
    thread.start()
    return thread


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def lidar_that_receives(packets: list[bytes], **options):
    """Return a LiDAR, its frames, and the thread that sends."""
    port, opened = free_port(), []
    # The first packet is repeated until the port is open.
    stop = threading.Event()

    def knock() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            while not stop.wait(0.02):
                sender.sendto(packets[0], ("127.0.0.1", port))

    knocking = threading.Thread(target=knock)
    knocking.start()
    try:
        opened.append(UdpLidar(UdpAddress(port, "127.0.0.1", 5.0), **options))
    finally:
        stop.set()
        knocking.join()
    (lidar,) = opened
    frames = next(lidar.laps())
    return lidar, frames, send(port, packets[1:])


def test_a_turn_is_a_frame_that_begins_behind_the_vehicle():
    lidar, frames, sending = lidar_that_receives(turns(3.0))
    assert (lidar.sensor, lidar.is_sequence) == (VLP_16, True)
    first, second = next(frames), next(frames)
    sending.join()
    lidar.close()
    assert list(frames) == []
    for frame in (first, second):
        assert len(frame.points_velo) == 75 * 12 * 32
        assert np.linalg.norm(frame.points_velo[:, :3], axis=1) == pytest.approx(10, abs=0.02)
        azimuth = np.arctan2(frame.points_velo[:, 1], frame.points_velo[:, 0])
        middle = azimuth[len(azimuth) // 2]
        assert abs(middle) < np.radians(5)  # ahead
        assert np.ptp(frame.point_times_s) == pytest.approx(75 * PACKET_US * 1e-6, rel=0.01)
    assert second.stamp_s - first.stamp_s == pytest.approx(75 * PACKET_US * 1e-6, abs=1e-5)
    assert abs(first.stamp_s - time.time()) < 60
    assert (first.index, second.index) == (0, 1)


def test_other_packets_on_the_port_are_left_out():
    packets = turns(3.0)
    mixed = [packets[0], *(one for pair in zip(packets, [b"x" * 512] * len(packets), strict=True)
                           for one in pair)]  # fmt: skip
    lidar, frames, sending = lidar_that_receives(mixed)
    assert len(next(frames).points_velo) == 75 * 12 * 32
    sending.join()
    lidar.close()


def test_a_turn_with_a_gap_is_left_out(caplog):
    packets = turns(4.0)
    # Half a minute is lost in the second whole turn.
    late = [one[:1200] + struct.pack("<I", 30_000_000 + struct.unpack_from("<I", one, 1200)[0])
            + one[1204:] for one in packets]  # fmt: skip
    lidar, frames, sending = lidar_that_receives([*packets[:150], *late[150:]])
    first, second = next(frames), next(frames)
    sending.join()
    lidar.close()
    assert second.stamp_s - first.stamp_s > 30
    assert "within 0.5 s, found 30.1 s, as others were lost" in caplog.text


def test_another_sensor_may_be_named():
    from dataclasses import replace

    roof = replace(VLP_16, height_m=2.1)
    lidar, _, sending = lidar_that_receives(turns(0.1), sensor=roof)
    sending.join()
    assert lidar.sensor.height_m == 2.1
    lidar.close()


def test_no_packet_is_one_sentence():
    with pytest.raises(ScanError, match=r"packets of a LiDAR, found none in 0.1 s; set this"):
        UdpLidar(UdpAddress(0, "127.0.0.1", 0.1))


def test_packets_of_another_make_are_one_sentence():
    with pytest.raises(ScanError, match="another packet of 100 bytes"):
        lidar_that_receives([b"x" * 100])


def test_a_port_in_use_is_one_sentence():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        with pytest.raises(UsageError, match=f"UDP port {port} of 127.0.0.1: .*--udp-port"):
            UdpLidar(UdpAddress(port, "127.0.0.1"))
    with pytest.raises(UsageError, match="UDP port 99999"):
        UdpLidar(UdpAddress(99999))
