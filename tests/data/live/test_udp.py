"""A LiDAR on the loopback interface."""

import socket
import struct
import threading
import time

import numpy as np
import pytest

from data.live import udp
from data.live.udp import UdpAddress, UdpLidar
from data.packets.ouster import OusterDecoder
from data.packets.velodyne import VelodyneDecoder
from perception.errors import ScanError, UsageError
from perception.sensor import VLP_16
from perception.types import HealthLevel
from tests.data.packets.test_recording import OS_0, OS_2, ouster_frames
from tests.packet_writer import ALIKE, BANKS, PACKET_US, PAIRS, packet, turns

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


def lidar_that_receives(packets: list[bytes], timeout_s: float = 5.0, **options):
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
        opened.append(UdpLidar(UdpAddress(port, "127.0.0.1", timeout_s), **options))
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


def turns_of(model, flags, cycles, mode=0x37) -> list[bytes]:
    """Return the packets of three and a half turns of any Velodyne, from behind on, in a room of noise."""
    generator, step_deg = np.random.default_rng(0), 2.0
    count = round(3.5 * 360 / (cycles * step_deg))
    return [
        packet(180 + step_deg * (cycles * one + np.repeat(np.arange(cycles), 12 // cycles)),
               generator.uniform(5, 60, (12, 32)), model=model, flags=flags, mode=mode, time_us=1300 * one)
        for one in range(count)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("model", "flags", "cycles", "mode", "name"),
    [(0x21, ALIKE, 12, 0x37, "HDL-32E"), (0x24, ALIKE, 12, 0x37, "Puck Hi-Res"),
     (0x28, ALIKE, 12, 0x37, "VLP-32C"), (0xA1, BANKS, 3, 0x37, "VLS-128"), (0x31, PAIRS, 6, 0x48, "HDL-64E")],
)  # fmt: skip
def test_every_velodyne_is_received(model, flags, cycles, mode, name):
    packets = turns_of(model, flags, cycles, mode)
    lidar, frames, sending = lidar_that_receives(packets)
    frame = next(frames)
    sending.join()
    lidar.close()
    assert lidar.sensor.name == name
    half = round(360 / (cycles * 2.0))
    expected = VelodyneDecoder.of(packets[0], "port").decode(packets[half : 2 * half])
    assert np.array_equal(frame.points_velo[:, :3], expected.xyz)


def corrupted(packets: list[bytes], lost: tuple[int, ...] = ()) -> list[bytes]:
    """Return packets of which many come twice, some are overtaken by others, and some are lost."""
    generator = np.random.default_rng(1)
    kept = [one for index, one in enumerate(packets) if index not in lost]
    places = np.arange(len(kept)) + generator.uniform(0, 4, len(kept))
    late = [kept[one] for one in np.argsort(places)]
    return [one for index, each in enumerate(late) for one in [each] * (1 + (index % 3 == 0))]


def test_packets_that_are_doubled_late_and_lost():
    packets = turns(3.3)
    lidar, frames, sending = lidar_that_receives([packets[0], *corrupted(packets)])
    found = [next(frames) for _ in range(2)]
    sending.join()
    lidar.close()
    calm, calm_frames, sending = lidar_that_receives(packets)
    for frame in found:
        expected = next(calm_frames)
        assert np.array_equal(frame.points_velo, expected.points_velo)
        assert np.array_equal(frame.point_times_s, expected.point_times_s)
    sending.join()
    calm.close()
    lost = tuple(range(60, 70))  # of the first whole turn, which is from packet 38 to 112
    lidar, frames, sending = lidar_that_receives([packets[0], *corrupted(packets, lost)])
    first, second = next(frames), next(frames)
    sending.join()
    lidar.close()
    assert len(first.points_velo) == 65 * 12 * 32
    assert len(second.points_velo) == 75 * 12 * 32


def test_what_is_wrong_with_packets_is_said_until_it_is_over():
    packets = turns(6.3)
    doubled, lost = range(40, 50), range(200, 210)  # whole turns begin at packets 38, 113, 188, ...
    sent = [one for index, one in enumerate(packets) if index not in lost for _ in range(1 + (index in doubled))]  # fmt: skip
    lidar, frames, sending = lidar_that_receives(sent)
    faults, told = [], []
    lidar.on_silence = lambda: told.append(lidar.health.health) or lidar.close()
    for _ in frames:
        faults.append([(one.fault, one.reason) for one in lidar.health.health.findings])
    sending.join()
    assert faults == [
        [("packets left out", "10 of a turn came twice, or too late")],
        [],
        [("packets lost", "10 of a turn")],
        [],
        [],
    ]
    (silence,) = told[0].findings
    assert (silence.level, silence.fault) == (HealthLevel.ERROR, "silent")
    assert lidar.health.parts == (lidar.name,)


def test_an_hour_that_ends_within_a_turn():
    packets = turns(3.3, start_us=3_600_000_000 - 150_000)
    lidar, frames, sending = lidar_that_receives([packets[0], *corrupted(packets)])
    found = [next(frames) for _ in range(2)]
    sending.join()
    lidar.close()
    assert [len(one.points_velo) for one in found] == [75 * 12 * 32] * 2
    assert found[1].stamp_s - found[0].stamp_s == pytest.approx(75 * PACKET_US * 1e-6, abs=1e-4)


@pytest.mark.parametrize("name", [OS_0, OS_2])
def test_ousters_are_received_with_their_metadata(ousters, name):
    path = ousters / f"{name}.pcap"
    frames_sent = ouster_frames(path, 4)
    packets = [frames_sent[0][-1], *corrupted([one for frame in frames_sent for one in frame])]
    metadata = path.with_suffix(".json")
    lidar, frames, sending = lidar_that_receives(packets, beams=metadata)
    found = [next(frames) for _ in range(2)]
    sending.join()
    lidar.close()
    expected = OusterDecoder(metadata).decode(frames_sent[1])
    assert lidar.sensor.beams == OusterDecoder(metadata).sensor.beams
    for frame in found:
        assert np.array_equal(frame.points_velo[:, :3], expected.xyz)
        assert 0.1 < frame.points_velo[:, 3].max() <= 1
    assert found[1].stamp_s - found[0].stamp_s == pytest.approx(0.1, abs=1e-3)


def test_other_packets_than_those_of_the_metadata_are_one_sentence(ousters):
    with pytest.raises(ScanError, match=r"packets of a OS-0-128, found packets of 1206 bytes in"):
        lidar_that_receives(turns(0.1), beams=ousters / f"{OS_0}.json", timeout_s=0.5)


def test_metadata_and_height_are_named_together(ousters, monkeypatch):
    roof = ousters / "roof.yaml"
    roof.write_text("model: OS0-128\nheight_m: 0.4\n")
    made = []
    monkeypatch.setattr(udp, "UdpLidar", lambda *args: made.append(args))
    metadata = ousters / f"{OS_0}.json"
    udp.open_udp(7502, f"{metadata},{roof}")
    ((address, model, beams),) = made
    assert (address.port, model.height_m, beams) == (7502, 0.4, metadata)
