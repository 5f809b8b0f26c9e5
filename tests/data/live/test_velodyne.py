"""Packets as the manuals describe them, made by hand."""

import struct

import numpy as np
import pytest

from data.live.velodyne import MODELS, decode, first_azimuth_rad, model_of
from perception.errors import ScanError
from perception.sensor import HDL_32E, VLP_16

VLP, HDL, VLP_32C, VLS = 0x22, 0x21, 0x28, 0xA1


ALIKE = (0xEEFF,) * 12
BANKS = (0xEEFF, 0xDDFF, 0xCCFF, 0xBBFF) * 3


def packet(
    azimuths_deg, ranges_m, *, model=VLP, mode=0x37, time_us=0, intensity=51, flags=ALIKE
) -> bytes:
    """Return a packet: twelve azimuths, and (12, 32) ranges."""
    ranges = np.broadcast_to(ranges_m, (12, 32))
    unit_m = MODELS[model].range_unit_m if model in MODELS else 0.002
    data = b""
    for flag, azimuth, row in zip(flags, azimuths_deg, ranges, strict=True):
        data += struct.pack("<HH", flag, round(azimuth % 360 * 100))
        data += b"".join(struct.pack("<HB", round(one / unit_m), intensity) for one in row)
    return data + struct.pack("<IBB", time_us, mode, model)


STILL = [0.0] * 12  # a LiDAR that does not turn


def test_models_are_those_of_the_presets():
    assert MODELS[VLP].sensor is VLP_16
    beams_rad = np.sort(MODELS[VLP].elevations_rad[0, :16])[::-1]
    assert beams_rad == pytest.approx(VLP_16.elevations_rad)
    beams_rad = np.sort(MODELS[HDL].elevations_rad[0])[::-1]
    assert beams_rad == pytest.approx(HDL_32E.elevations_rad, abs=np.radians(0.01))
    for number in (VLP_32C, VLS):
        model = MODELS[number]
        beams_rad = np.sort(model.elevations_rad.ravel())[::-1]
        assert beams_rad == pytest.approx(model.sensor.elevations_rad)


def test_straight_ahead_is_x_and_clockwise_is_to_the_right():
    model = MODELS[HDL]
    ahead = decode([packet(STILL, 10.0, model=HDL)], model).points_velo
    assert ahead.shape == (12 * 32, 4)
    assert ahead[:32, 0] == pytest.approx(10 * np.cos(model.elevations_rad[0]), rel=1e-6)
    assert ahead[:32, 1] == pytest.approx(0, abs=1e-6)
    assert ahead[:32, 2] == pytest.approx(10 * np.sin(model.elevations_rad[0]), rel=1e-5)
    assert ahead[:, 3] == pytest.approx(0.2)
    right = decode([packet([90.0] * 12, 10.0, model=HDL)], model).points_velo
    assert right[:32, 1] == pytest.approx(-10 * np.cos(model.elevations_rad[0]), rel=1e-6)


def test_beams_of_a_vlp_16_leave_at_their_heights():
    points = decode([packet(STILL, 20.0)], MODELS[VLP]).points_velo
    # Beam 0 is the lowest, -15 degrees, 11.2 mm above the origin; beam 1 is at +1 degree.
    assert points[0, 2] == pytest.approx(20 * np.sin(np.radians(-15)) + 0.0112, abs=1e-5)
    assert points[1, 2] == pytest.approx(20 * np.sin(np.radians(1)) - 0.0007, abs=1e-5)
    assert (points[:16] == points[16:32]).all()  # the second firing of a block


def test_the_lidar_turns_on_between_the_firings_of_a_block():
    step_deg = 0.4
    points = decode([packet(step_deg * np.arange(12), 10.0)], MODELS[VLP]).points_velo
    azimuth_deg = -np.degrees(np.arctan2(points[:, 1], points[:, 0])).reshape(12, 32)
    assert azimuth_deg[:, 0] == pytest.approx(step_deg * np.arange(12), abs=1e-4)
    assert azimuth_deg[:, 16] == pytest.approx(step_deg * (np.arange(12) + 0.5), abs=1e-4)


def test_azimuths_pass_through_zero():
    points = decode([packet(359.0 + 0.4 * np.arange(12), 10.0)], MODELS[VLP]).points_velo
    azimuth_deg = np.degrees(np.arctan2(-points[:, 1], points[:, 0]))
    assert azimuth_deg.min() == pytest.approx(-1.0, abs=1e-3)
    assert azimuth_deg.max() < 4


def test_times_of_the_returns():
    times_s = decode([packet(STILL, 10.0, time_us=1_000_000)], MODELS[VLP]).times_s.reshape(12, 32)
    assert times_s[0, 0] == 1.0
    assert times_s[0, 16] - 1 == pytest.approx(55.296e-6, abs=1e-9)
    assert times_s[1, 0] - 1 == pytest.approx(110.592e-6, abs=1e-9)


def test_beams_of_a_vlp_32c_leave_to_both_sides():
    points = decode([packet(STILL, 10.0, model=VLP_32C)], MODELS[VLP_32C])
    azimuth_deg = -np.degrees(np.arctan2(*points.points_velo[:, 1::-1].T)).reshape(12, 32)
    # Lasers 0, 1 and 3: -25, -1 and -15.639 degrees high.
    assert azimuth_deg[0, [0, 1, 3]] == pytest.approx([1.4, -4.2, -1.4], abs=1e-3)
    heights_m = points.points_velo[[0, 1, 3], 2]
    assert heights_m == pytest.approx(10 * np.sin(np.radians([-25, -1, -15.639])), rel=1e-5)
    assert np.linalg.norm(points.points_velo[:, :3], axis=1) == pytest.approx(10, abs=1e-3)
    assert points.times_s[[1, 2, 32]] == pytest.approx([0, 2.304e-6, 55.296e-6], abs=1e-12)


def test_four_blocks_of_a_vls_128_are_one_firing():
    step_deg = 0.2
    azimuths_deg = step_deg * np.repeat(np.arange(3), 4)
    model = MODELS[VLS]
    found = decode([packet(azimuths_deg, 10.0, model=VLS, flags=BANKS)], model)
    x, y, z = found.points_velo[:, :3].T
    azimuth_deg = -np.degrees(np.arctan2(y, x)).reshape(3, 128)
    # Laser 36 is the lowest, -25 degrees: the fifth firing, and the fifth of those that fire together.
    assert z[36] == pytest.approx(10 * np.sin(np.radians(-25)), rel=1e-5)
    turned_deg = step_deg * 4 * 2.665 / 53.3
    assert azimuth_deg[:, 36] == pytest.approx(
        step_deg * np.arange(3) - 0.911 + turned_deg, abs=1e-3
    )
    # Sixteen firings, a pause after the eighth.
    times_us = 1e6 * found.times_s.reshape(3, 128)
    assert times_us[0, [0, 7, 8, 63, 64]] == pytest.approx([0, 0, 2.665, 18.655, 23.985])
    assert times_us[:, 0] == pytest.approx([0, 53.3, 106.6])


def test_of_two_returns_of_a_vls_128_one_is_taken():
    # The blocks of both returns follow each other; four blocks of the packet are empty.
    flags = (*np.repeat(BANKS[:4], 2).tolist(), 0, 0, 0, 0)
    ranges_m = np.tile([[20.0], [10.0]], (6, 32))
    data = packet([90.0] * 12, ranges_m, model=VLS, mode=0x39, flags=flags)
    points = decode([data], MODELS[VLS]).points_velo
    assert len(points) == 128
    assert np.linalg.norm(points[:, :3], axis=1) == pytest.approx(20, abs=0.02)


def test_an_hour_ends_within_a_scan():
    packets = [packet(STILL, 10.0, time_us=one) for one in (3_599_999_000, 500)]
    times_s = decode(packets, MODELS[VLP]).times_s
    assert times_s[12 * 32] - times_s[0] == pytest.approx(0.0015, abs=1e-6)


def test_of_two_returns_one_is_taken():
    azimuths_deg = np.repeat(0.4 * np.arange(6), 2)
    ranges_m = np.tile([[20.0], [10.0]], (6, 32))
    points = decode([packet(azimuths_deg, ranges_m, mode=0x39)], MODELS[VLP]).points_velo
    assert len(points) == 6 * 32
    assert np.linalg.norm(points[:, :3], axis=1) == pytest.approx(20, abs=0.02)


def test_beams_without_a_return_and_damaged_blocks_are_left_out():
    ranges_m = np.full((12, 32), 10.0)
    ranges_m[0, 5:] = 0
    data = bytearray(packet(STILL, ranges_m))
    data[100:102] = b"\x00\x00"  # the flag of the second block
    assert len(decode([bytes(data)], MODELS[VLP]).points_velo) == 5 + 10 * 32


def test_first_azimuth():
    assert first_azimuth_rad(packet([90.0] * 12, 1.0)) == pytest.approx(np.pi / 2)


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"x" * 8448, "another packet of 8448 bytes"),
        (b"\x00" * 1206, "another packet of 1206 bytes"),
        (packet(STILL, 1.0, model=0x31), "packets of model 0x31"),
    ],
)
def test_other_packets_are_refused(data, found):
    with pytest.raises(ScanError, match=f"VLS-128, 1206 bytes each, found {found}"):
        model_of(data, "UDP port 2368")
