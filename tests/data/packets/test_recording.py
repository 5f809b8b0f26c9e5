"""Recordings of packets as drives: those of a Velodyne made by hand, and those of real Ousters."""

import pickle
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from data.inspection import inspect_drive
from data.layouts import OpenConfig
from data.open_drive import open_drive, sequences_in
from data.packets.recording import open_recording
from perception.cli.main import main
from perception.errors import PerceptionError
from tests.packet_writer import PACKET_US, PAIRS, STILL, packet, pcap, pcapng, tcp, turns, udp

OS_0, OS_2 = "OS-0-128-U1_v2.3.0_1024x10", "OS-2-32-U0_v2.0.0_1024x10"


def sent(payloads, **options):
    return [one for payload in payloads for one in udp(payload, **options)]


def recorded(path: Path, payloads, *, write=pcap, **options) -> Path:
    """Write the packets of a VLP-16 as they came."""
    period = {"period_us": PACKET_US} if write is pcap else {"period_ns": round(1000 * PACKET_US)}
    return write(sent(payloads, **options), path, **period)


# --- Velodyne -------------------------------------------------------------------------------------


@pytest.mark.parametrize("write", [pcap, pcapng])
def test_turns_are_frames(tmp_path, write):
    path = recorded(tmp_path / "room.pcap", turns(3.6), write=write)
    assert sequences_in(path) == [None]
    drive = open_drive(path)
    assert (drive.name, drive.sensor.name, drive.sensor.beams) == ("room", "VLP-16", 16)
    assert drive.sensor.rate_hz == pytest.approx(1e6 / (75 * PACKET_US), abs=0.01)
    assert drive.frame_names == ("000000", "000001", "000002")
    assert drive.frame_files(0) == ()
    for index, frame in enumerate(drive):
        assert len(frame.points_velo) == 75 * 12 * 32
        assert np.linalg.norm(frame.points_velo[:, :3], axis=1) == pytest.approx(10, abs=0.03)
        assert frame.points_velo[:, 3] == pytest.approx(0.2)
        assert frame.stamp_s == pytest.approx(index * 75 * PACKET_US * 1e-6, abs=1e-4)
        assert np.abs(frame.point_times_s).max() == pytest.approx(0.05, abs=0.001)
        azimuth_rad = np.arctan2(frame.points_velo[:, 1], frame.points_velo[:, 0])
        assert np.abs(azimuth_rad[np.abs(frame.point_times_s) < 1e-3]).max() < np.radians(6)
    # The first turn of the capture is ahead, at 37.4 packets; its clock is that of the recording.
    recording = open_recording(path)
    middle_s = (37 + 37) * PACKET_US * 1e-6
    assert recording.stamps_ns[0] * 1e-9 - 1_700_000_000 == pytest.approx(middle_s, abs=0.002)
    assert recording.notes == (
        f"{path}: 2 of 5 sweeps are left out, as they are not whole",
    )  # fmt: skip
    assert "room: 3 frames, 0.2 s, VLP-16 (16 beams, 10.05 Hz) with 28,800" in inspect_drive(drive).text()  # fmt: skip


def test_a_part_of_a_drive_keeps_its_sweeps(tmp_path):
    drive = open_drive(recorded(tmp_path / "room.pcap", turns(3.6)))
    part = drive.select([2])
    assert (part[0].name, part[0].stamp_s) == ("000002", drive[2].stamp_s)
    assert (part[0].points_velo == drive[2].points_velo).all()
    elsewhere = pickle.loads(pickle.dumps(part))
    assert (elsewhere[0].points_velo == drive[2].points_velo).all()


def test_the_sensors_hour_ends_and_its_clock_is_set(tmp_path):
    wrapped = turns(4, start_us=3_600_000_000 - 200_000)
    stamps = open_recording(recorded(tmp_path / "a.pcap", wrapped)).stamps_ns
    assert np.diff(stamps) * 1e-9 == pytest.approx(75 * PACKET_US * 1e-6, abs=1e-4)
    jumped = [*turns(1.6), *turns(4, start_us=900_000_000)[120:]]
    stamps = open_recording(recorded(tmp_path / "b.pcap", jumped)).stamps_ns
    assert np.diff(stamps) * 1e-9 == pytest.approx(75 * PACKET_US * 1e-6, abs=0.02)


def test_a_file_that_is_cut_off_keeps_its_whole_sweeps(tmp_path):
    path = recorded(tmp_path / "a.pcap", turns(3.6))
    path.write_bytes(path.read_bytes()[: -75 * 1264 - 100])
    recording = open_recording(path)
    assert len(recording.sweeps) == 2
    assert recording.notes[0] == f"{path}: the file ends within a packet; the whole sweeps before it are used"  # fmt: skip


def test_a_capture_of_less_than_a_turn_is_used_as_it_is(tmp_path):
    recording = open_recording(recorded(tmp_path / "a.pcap", turns(0.3)))
    assert len(recording.cloud(0)) == 22 * 12 * 32
    assert recording.notes == (f"{recording.path}: no sweep is whole; 1 parts of sweeps are used",)


def test_the_lidar_of_more_packets_is_read(tmp_path):
    near, far = turns(3.0), turns(2.0, range_m=30.0)
    packets = [*sent(near), *sent(far, source="192.168.1.202"), *sent([bytes(512)] * 9, port=8308)]
    path = pcap(packets, tmp_path / "a.pcap", period_us=PACKET_US)
    recording = open_recording(path)
    assert recording.notes[0] == (
        f"{path}: 192.168.1.201:2368 (225 packets) is used, and not 192.168.1.202:2368 (150 packets); choose with --lidar"
    )
    assert np.linalg.norm(recording.cloud(0).xyz, axis=1).mean() == pytest.approx(10, abs=0.01)
    drive = open_drive(path, config=OpenConfig(lidar="192.168.1.202"))
    assert np.linalg.norm(drive[0].points_velo[:, :3], axis=1).mean() == pytest.approx(30, abs=0.01)
    with pytest.raises(PerceptionError, match=r"--lidar 7: expected one of 192.168.1.201:2368, 192.168.1.202:2368"):  # fmt: skip
        open_recording(path, "7")


def test_adopt_describes_a_recording(tmp_path, capsys):
    path = recorded(tmp_path / "a.pcap", turns(3.6))
    assert main(["adopt", str(path), "--height", "2.1", "--axes", "forward,left,up"]) == 0
    assert "3 sweeps" in capsys.readouterr().out
    text = (tmp_path / "drive.yaml").read_text()
    assert "scans: a.pcap" in text
    assert "address: 192.168.1.201:2368" in text
    for place in (tmp_path, path):
        drive = open_drive(place)
        assert (drive.sensor.name, drive.sensor.height_m, len(drive)) == ("VLP-16", 2.1, 3)


def test_an_hdl_64e_is_read_with_its_calibration(tmp_path):
    import velodyne_decoder

    own = velodyne_decoder.get_bundled_calibration("HDL-64E_S2.1-sztaki.yml")
    own.write(str(tmp_path / "own.yml"))
    blocks = [
        packet(0.17 * (6 * one + np.arange(12) // 2), 20.0, flags=PAIRS, mode=0x48, time_us=288 * one)
        for one in range(800)
    ]  # fmt: skip
    path = pcap(sent(blocks), tmp_path / "a.pcap", period_us=288)
    usual, exact = (
        open_drive(path, config=OpenConfig(sensor=sensor))
        for sensor in (None, str(tmp_path / "own.yml"))
    )
    assert (usual.sensor.name, usual.sensor.beams, len(usual)) == ("HDL-64E", 64, 1)
    assert any("usual ones" in note for note in usual.notes)
    assert not any("usual ones" in note for note in exact.notes)
    assert np.degrees(exact.sensor.elevations_rad[[0, -1]]) == pytest.approx(
        [4.97, -24.85], abs=0.01
    )
    assert not np.allclose(exact.sensor.elevations_rad, usual.sensor.elevations_rad)
    assert not np.allclose(exact[0].points_velo, usual[0].points_velo)


# --- Ouster ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "beams", "rate_hz"), [(OS_0, 128, 10), (OS_2, 32, 20)])
def test_real_ousters_are_read_as_their_library_reads_them(ousters, name, beams, rate_hz):
    from ouster.sdk.core import XYZLut
    from ouster.sdk.pcap import PcapFrameSetSource

    path = ousters / f"{name}.pcap"
    drive = open_drive(path)
    assert drive.sensor.name == name.partition("_v")[0].removesuffix("-U1")
    assert (drive.sensor.beams, drive.sensor.rate_hz, len(drive)) == (beams, rate_hz, 1)
    source = PcapFrameSetSource(str(path), meta=[str(path.with_suffix(".json"))])
    (frame,) = next(iter(source))
    ranges = frame.field("RANGE")
    expected = XYZLut(source.sensor_info[0])(ranges)[ranges > 0]
    cloud = open_recording(path).cloud(0)
    assert cloud.xyz == pytest.approx(expected, abs=1e-4)
    times_s = np.broadcast_to(frame.timestamp.astype(np.float64) * 1e-9, ranges.shape)[ranges > 0]
    assert np.diff(cloud.times_s) == pytest.approx(np.diff(times_s), abs=1e-6)
    assert cloud.times_s.min() == pytest.approx(-0.5 / rate_hz, rel=0.01)
    assert (cloud.ring == np.nonzero(ranges)[0]).all()
    if name == OS_0:
        assert (cloud.intensity == frame.field("REFLECTIVITY")[ranges > 0]).all()
    else:  # firmware 2.0 has 16 bits
        assert cloud.intensity.max() > 60_000
        assert (cloud.intensity % 256 == frame.field("REFLECTIVITY")[ranges > 0]).all()


def ouster_packets(path: Path) -> list[bytes]:
    recording = open_recording(path)
    data = path.read_bytes()
    return [recording.datagrams.read(k, data) for k in recording.sweeps[0].packets.tolist()]


def ouster_frames(path: Path, count: int) -> list[list[bytes]]:
    """Return the frame of a capture several times, each with its own number and times."""
    from ouster.sdk.core import LidarPacket, PacketFormat, SensorInfo

    form = PacketFormat(SensorInfo(path.with_suffix(".json").read_text()))
    frames = []
    for number in range(count):
        frames.append([])
        for content in ouster_packets(path):
            one = LidarPacket(form)
            one.buf[:] = np.frombuffer(content, np.uint8)
            form.set_frame_id(one, 65534 + number & 0xFFFF)
            for column in range(form.columns_per_packet):
                time_ns = int.from_bytes(content[:0], "little")
                form.set_col_timestamp(one, column, time_ns + 10**9 + number * 10**8 + 97_656 * (len(frames[-1]) * 16 + column))  # fmt: skip
            frames[-1].append(bytes(one.buf))
    return frames


def test_whole_frames_of_an_ouster_are_kept_from_fragments(ousters):
    frames = ouster_frames(ousters / f"{OS_0}.pcap", 4)
    packets = [*frames[0][20:], *frames[1], *frames[2], *frames[3][:30]]
    # Where a frame ends, packets of two frames come in turn.
    at = 44 + 64
    packets[at - 1], packets[at] = packets[at], packets[at - 1]
    options = {"source": "10.0.0.5", "port": 7502, "source_port": 40_000, "mtu": 1500}
    path = pcap(sent(packets, **options), ousters / "b.pcap", link="linux cooked", period_us=250)
    drive = open_drive(path, config=OpenConfig(sensor=str(ousters / f"{OS_0}.json")))
    assert len(drive) == 2
    assert drive.stamp_s(1) == pytest.approx(0.1, abs=1e-6)
    whole = open_drive(ousters / f"{OS_0}.pcap")
    for index in range(2):
        assert (drive[index].points_velo == whole[0].points_velo).all()
    assert any("2 of 4 sweeps are left out, as they are not whole" in note for note in drive.notes)


def test_the_only_metadata_that_fits_is_taken(ousters):
    path = (ousters / f"{OS_0}.pcap").rename(ousters / "street.pcap")
    (ousters / "notes.json").write_text("{}")
    assert open_drive(path).sensor.name == "OS-0-128"
    shutil.copyfile(ousters / f"{OS_0}.json", ousters / "copy.json")
    with pytest.raises(PerceptionError, match=r"fits its packets, found OS-0.*json, copy.json; name one with --sensor"):  # fmt: skip
        open_drive(path)


def test_a_folder_of_recordings_has_each_by_its_name(ousters):
    assert sequences_in(ousters) == [f"{OS_0}.pcap", f"{OS_2}.pcap"]
    assert open_drive(ousters, sequence=f"{OS_2}.pcap").sensor.beams == 32


# --- Bad input ------------------------------------------------------------------------------------


def sentence(path: Path, capsys, *words: str) -> str:
    """Return the sentence with which `check` refuses a recording."""
    assert main(["check", str(path), *words]) == 2
    return capsys.readouterr().err.strip().splitlines()[-1]


def test_missing_metadata_and_metadata_of_another_sensor(ousters, capsys):
    path, own = ousters / f"{OS_0}.pcap", ousters / f"{OS_0}.json"
    text, other = own.read_text(), ousters / f"{OS_2}.json"
    own.write_text(text.replace("122150000150", "122150000151"))
    assert "found packets of serial number 122150000150; name the metadata of 127.0.0.1:7502 with --sensor" in sentence(path, capsys)  # fmt: skip
    own.write_text(text[:1000])
    assert f"{own}: expected the metadata of an Ouster" in sentence(path, capsys)
    own.unlink()
    assert "that of packets of 6464 bytes (OS-2-32-U0), where these have 8448" in sentence(path, capsys)  # fmt: skip
    assert "where these have 8448" in sentence(path, capsys, "--sensor", str(other))
    other.unlink()
    assert (
        "expected packets of a Velodyne, or of an Ouster with its metadata beside them, found 64 packets of 8448 bytes "
        "from 127.0.0.1:7502, and no metadata; save what http://SENSOR/api/v1/sensor/metadata answers as "
        f"{own.name}, or name the file with --sensor"
    ) in sentence(path, capsys)


@pytest.mark.parametrize(
    ("packets", "found"),
    [
        ([], "found no packets; record the network interface of the LiDAR"),
        ([tcp()] * 3, "found 3 packets of TCP"),
        (sent([bytes(64)] * 5), "found 5 small UDP packets"),
        (sent([bytes(1400)] * 5), "found 5 packets of 1400 bytes from 192.168.1.201:2368, and no metadata"),
        (sent([packet(STILL, 10.0, model=0x31)]), "found packets of model 0x31"),
        ([sent([packet(STILL, 10.0)])[0][:96]], "found 1 packets that were cut when they were recorded"),
    ],
    ids=["none", "TCP", "small", "unknown size", "unknown model", "cut"],
)  # fmt: skip
def test_captures_without_a_lidar(tmp_path, capsys, packets, found):
    path = pcap(packets, tmp_path / "a.pcap")
    assert found in sentence(path, capsys)


@pytest.mark.parametrize(
    ("module", "package"), [("velodyne_decoder", "velodyne-decoder"), ("ouster.sdk.core", "ouster-sdk")]
)  # fmt: skip
def test_a_decoder_that_is_not_installed(tmp_path, capsys, monkeypatch, module, package):
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / "a.json").write_text('{"beam_altitude_angles": []}')
    payloads = turns(0.1) if package == "velodyne-decoder" else [bytes(8448)]
    path = recorded(tmp_path / "a.pcap", payloads)
    found = sentence(path, capsys)
    assert f"expected the Python package {package}" in found
    assert "pip install" in found
    assert "[packets]" in found


def test_an_empty_file(tmp_path, capsys):
    path = tmp_path / "a.pcap"
    path.touch()
    assert f"{path}: expected a capture as pcap or pcapng, found an empty file" in sentence(path, capsys)  # fmt: skip
