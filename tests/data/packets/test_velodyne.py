"""Packets as the manuals describe them, decoded to what they were made of."""

import numpy as np
import pytest

from data.packets.velodyne import VelodyneDecoder, _scan_decoder, first_azimuth_rad
from perception.errors import ScanError
from perception.sensor import HDL_32E, HDL_64E, SENSORS
from perception.sensor import VLP_16 as VLP_16_MODEL
from perception.sensor.models import VLP_32C_BY_LASER_DEG, VLS_128_BY_LASER_DEG
from tests.packet_writer import (
    ALIKE,
    BANKS,
    PAIRS,
    STILL,
    VLP_16,
    VLP_32C,
    VLS_128,
    packet,
)  # fmt: skip
from tests.packet_writer import (
    HDL_32E as HDL,
)

VLP_16_DEG = np.column_stack([np.arange(-15.0, 0, 2), np.arange(1.0, 16, 2)]).ravel()
HDL_32E_DEG = np.column_stack([np.linspace(-30.67, -10.67, 16), np.linspace(-9.33, 10.67, 16)]).ravel()  # fmt: skip
VLP_32C_AZIMUTHS_DEG = (
    1.4, -4.2, 1.4, -1.4, 1.4, -1.4, 4.2, -1.4, 1.4, -4.2, 1.4, -1.4, 4.2, -1.4, 4.2, -1.4,
    1.4, -4.2, 1.4, -4.2, 4.2, -1.4, 1.4, -1.4, 1.4, -1.4, 1.4, -4.2, 4.2, -1.4, 1.4, -1.4,
)  # fmt: skip
VLS_128_AZIMUTHS_DEG = (6.354, 4.548, 2.732, 0.911, -0.911, -2.732, -4.548, -6.354)
_ORIGIN_M = 0.03  # the lenses are so far from the middle of the head at most
HDL_64E_MODE = 0x48  # where the others have the return mode: a letter of the status


def decoder_of(data: bytes) -> VelodyneDecoder:
    return VelodyneDecoder.of(data, "port 2368")


def decode(packets, decoder=None):
    return (decoder or decoder_of(packets[0])).decode(packets)


@pytest.mark.parametrize(
    ("model", "flags", "sensor", "beams_deg", "times_us", "cycle_us"),
    [
        (VLP_16, (0xEEFF,) * 12, VLP_16_MODEL, (np.tile(VLP_16_DEG, 2), np.zeros(32)),
         np.concatenate([2.304 * np.arange(16), 55.296 + 2.304 * np.arange(16)]), 110.592),
        (HDL, (0xEEFF,) * 12, HDL_32E, (HDL_32E_DEG, np.zeros(32)), 1.152 * np.arange(32), 46.08),
        (VLP_32C, (0xEEFF,) * 12, SENSORS["VLP-32C"], (VLP_32C_BY_LASER_DEG, VLP_32C_AZIMUTHS_DEG),
         np.repeat(2.304 * np.arange(16), 2), 55.296),
        (VLS_128, BANKS, SENSORS["VLS-128"], (VLS_128_BY_LASER_DEG, np.tile(VLS_128_AZIMUTHS_DEG, 16)),
         np.repeat(2.665 * (np.arange(16) + 2 * (np.arange(16) // 8)), 8), 53.3),
    ],
    ids=["VLP-16", "HDL-32E", "VLP-32C", "VLS-128"],
)  # fmt: skip
def test_points_times_and_rings_are_those_of_the_packets(
    model, flags, sensor, beams_deg, times_us, cycle_us
):
    elevations_deg, azimuths_deg = beams_deg
    beams = len(elevations_deg)
    cycles = 12 * 32 // beams
    step_deg = 0.2
    ranges_m = np.random.default_rng(0).uniform(5, 60, (4, 12, 32)).round(2)
    starts_deg = 30 + step_deg * np.repeat(np.arange(4 * cycles), 12 // cycles).reshape(4, 12)
    packets = [
        packet(starts_deg[one], ranges_m[one], model=model, flags=flags, intensity=77,
               time_us=round(5e6 + one * cycles * cycle_us))
        for one in range(4)
    ]  # fmt: skip
    decoder = decoder_of(packets[0])
    cloud = decode(packets, decoder)
    turned_deg = step_deg * np.asarray(times_us) / cycle_us
    azimuth_rad = np.radians(30 + step_deg * np.arange(4 * cycles)[:, None] + turned_deg + azimuths_deg)  # fmt: skip
    elevation_rad = np.broadcast_to(np.radians(elevations_deg), azimuth_rad.shape)
    r = ranges_m.reshape(azimuth_rad.shape)
    expected = np.stack(
        [r * np.cos(elevation_rad) * np.cos(azimuth_rad), -r * np.cos(elevation_rad) * np.sin(azimuth_rad),
         r * np.sin(elevation_rad)], axis=-1,
    ).reshape(-1, 3)  # fmt: skip
    assert decoder.sensor is sensor
    # Azimuths are hundredths of a degree, and the unit of time of a packet is one microsecond.
    assert cloud.xyz[:, :2] == pytest.approx(expected[:, :2], abs=0.015 + _ORIGIN_M / 2)
    assert cloud.xyz[:, 2] == pytest.approx(expected[:, 2], abs=_ORIGIN_M)
    starts_s = 5 + 1e-6 * cycle_us * np.arange(4 * cycles)[:, None]
    times_s = (starts_s + 1e-6 * np.asarray(times_us)).ravel()
    # That of a packet of a VLS-128 is 8.7 us before its first firing.
    assert cloud.times_s == pytest.approx(times_s - (7e-6 if model == VLS_128 else 0), abs=2.5e-6)
    by_elevation = np.argsort(np.argsort(elevations_deg[: sensor.beams], kind="stable"))
    rings = np.tile(by_elevation, len(cloud) // sensor.beams)
    assert (cloud.ring == rings).all()
    assert (cloud.intensity == 77).all()


def test_an_hdl_64e_is_known_by_its_blocks_and_read_with_the_usual_beams():
    data = packet(STILL, 20.0, flags=PAIRS, mode=HDL_64E_MODE, model=0x31)
    decoder = decoder_of(data)
    assert (decoder.sensor.name, decoder.sensor.beams) == (HDL_64E.name, 64)
    assert "usual ones, up to 2 degrees off" in decoder.notes[0]
    cloud = decode([data], decoder)
    assert sorted({*cloud.ring.tolist()}) == list(range(64))
    ranges_m = np.linalg.norm(cloud.xyz, axis=1)
    assert ranges_m == pytest.approx(20 + 1.2, abs=0.5)  # each beam adds about a metre
    elevations_rad = np.arctan2(cloud.xyz[:, 2], np.hypot(*cloud.xyz[:, :2].T))
    order = [elevations_rad[cloud.ring == ring].mean() for ring in range(64)]
    assert order == pytest.approx(decoder.sensor.elevations_rad[::-1], abs=np.radians(0.7))
    # A block is half a firing, and a firing takes 57.6 us.
    assert np.ptp(cloud.times_s) == pytest.approx(169.4e-6, abs=2e-6)


@pytest.mark.parametrize(
    ("model", "flags", "modes"),
    [
        (VLP_16, ALIKE, (0x37, 0x38, 0x39)),
        (HDL, ALIKE, (0x37, 0x38, 0x39)),
        (VLP_32C, ALIKE, (0x37, 0x38, 0x39)),
        (VLS_128, BANKS, (0x37, 0x38, 0x39)),
        (0x31, PAIRS, (HDL_64E_MODE,)),
    ],
    ids=["VLP-16", "HDL-32E", "VLP-32C", "VLS-128", "HDL-64E"],
)
def test_points_do_not_depend_on_the_packets_before(model, flags, modes):
    generator = np.random.default_rng(0)
    sweeps = []
    for number, step_deg in enumerate([0.2, 0.4, -0.2, 0.0, 1.0, 0.1]):
        azimuths_deg = generator.uniform(0, 360) + step_deg * np.arange(12 * (number + 1))
        kept = {"model": model, "flags": flags, "mode": modes[number % len(modes)]}
        sweeps.append(
            [packet(one, generator.uniform(5, 60, (12, 32)), time_us=1300 * index, **kept)
             for index, one in enumerate(azimuths_deg.reshape(-1, 12))]
        )  # fmt: skip
    decoder = decoder_of(sweeps[0][0])
    alone = []
    for packets in sweeps:
        _scan_decoder.cache_clear()
        alone.append(decode(packets, decoder))
    for number in (3, 0, 5, 4, 2, 1, 3):
        cloud = decode(sweeps[number], decoder)
        np.testing.assert_array_equal(cloud.xyz, alone[number].xyz)
        np.testing.assert_array_equal(cloud.times_s, alone[number].times_s)
        np.testing.assert_array_equal(cloud.ring, alone[number].ring)


def test_straight_ahead_is_x_and_clockwise_is_to_the_right():
    ahead = decode([packet(STILL, 10.0, model=HDL)]).xyz
    assert ahead.shape == (12 * 32, 3)
    assert ahead[:32, 0] == pytest.approx(10 * np.cos(np.radians(HDL_32E_DEG)), rel=1e-4)
    assert ahead[:32, 1] == pytest.approx(0, abs=1e-6)
    right = decode([packet([90.0] * 12, 10.0, model=HDL)]).xyz
    assert right[:32, 1] == pytest.approx(-10 * np.cos(np.radians(HDL_32E_DEG)), rel=1e-4)


def test_azimuths_pass_through_zero():
    points = decode([packet(359.0 + 0.4 * np.arange(12), 10.0)]).xyz
    azimuth_deg = np.degrees(np.arctan2(-points[:, 1], points[:, 0]))
    assert azimuth_deg.min() == pytest.approx(-1.0, abs=1e-2)
    assert azimuth_deg.max() < 4


def test_an_hour_ends_within_a_scan():
    packets = [packet(STILL, 10.0, time_us=one) for one in (3_599_999_000, 500)]
    times_s = decode(packets).times_s
    assert times_s[12 * 32] - times_s[0] == pytest.approx(0.0015, abs=1e-6)
    assert times_s[-1] == pytest.approx(0.0018, abs=1e-5)


@pytest.mark.parametrize(
    ("model", "flags", "points"),
    [(VLP_16, (0xEEFF,) * 12, 6 * 32), (VLS_128, (*np.repeat(BANKS[:4], 2).tolist(), 0, 0, 0, 0), 128)],
)  # fmt: skip
def test_of_two_returns_one_is_taken(model, flags, points):
    # The blocks of both returns follow each other; what is left of a packet is empty.
    ranges_m = np.tile([[20.0], [10.0]], (6, 32))
    cloud = decode([packet([90.0] * 12, ranges_m, model=model, mode=0x39, flags=flags)])
    assert len(cloud) == points
    assert np.linalg.norm(cloud.xyz, axis=1) == pytest.approx(20, abs=_ORIGIN_M)


def test_returns_alike_are_taken_once():
    cloud = decode([packet([90.0] * 12, 20.0, mode=0x39)])
    assert len(cloud) == 6 * 32


def test_beams_without_a_return_are_left_out():
    ranges_m = np.full((12, 32), 10.0)
    ranges_m[0, 5:] = 0
    assert len(decode([packet(STILL, ranges_m)])) == 5 + 11 * 32


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
        decoder_of(data)
