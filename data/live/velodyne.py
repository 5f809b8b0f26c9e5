"""Data packets of Velodyne's LiDARs, as the makers' manuals describe them.

A packet has 1206 bytes: twelve blocks of 100, the time in microseconds since the full hour, the return mode, and the
number of the model. A block has a flag, the azimuth in hundredths of a degree, and 32 returns of three bytes: range
in units of 2 mm, and intensity. The azimuth grows clockwise from straight ahead.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from perception.errors import ScanError
from perception.sensor import HDL_32E, VLP_16, LidarModel
from perception.types import Float32, Float64

PACKET_BYTES = 1206
_BLOCKS, _RETURNS = 12, 32
_BLOCK = np.dtype(
    [
        ("flag", "<u2"),
        ("azimuth_cdeg", "<u2"),
        ("returns", [("range_2mm", "<u2"), ("intensity", "u1")], _RETURNS),
    ]
)
_PACKET = np.dtype(
    [("blocks", _BLOCK, _BLOCKS), ("time_us", "<u4"), ("mode", "u1"), ("model", "u1")]
)
_FLAG = 0xEEFF  # bytes FF EE
_DUAL_RETURN = 0x39
_RANGE_UNIT_M = 0.002
_HOUR_S = 3600.0


@dataclass(frozen=True)
class PacketModel:
    """How a LiDAR fills its blocks.

    Attributes:
        sensor: LiDAR model.
        elevations_rad: (32,) elevation of the beam of each return.
        offsets_m: (32,) height of each beam's origin above the sensor's.
        times_s: (32,) time of each return since the first one of its block.
        block_s: Time between two blocks.
    """

    sensor: LidarModel
    elevations_rad: Float64
    offsets_m: Float64
    times_s: Float64
    block_s: float


@dataclass(frozen=True)
class PacketPoints:
    """N returns of some packets.

    Attributes:
        points_velo: (N, 4) x, y, z in metres and reflectance 0..1.
        times_s: (N,) time since the last full hour before the first packet, by the sensor's clock.
    """

    points_velo: Float32
    times_s: Float64


def _vlp_16() -> PacketModel:
    """Return the model of the VLP-16: a block holds two firings of 16 beams, 55.296 us apart."""
    beams_deg = np.column_stack([np.arange(-15.0, 0, 2), np.arange(1.0, 16, 2)]).ravel()
    offsets_mm = [11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1]
    offsets_m = 1e-3 * np.array([*offsets_mm, *(-one for one in reversed(offsets_mm))])
    firing_s, cycle_s = np.linspace(0, 15 * 2.304e-6, 16), 55.296e-6
    return PacketModel(
        VLP_16,
        np.radians(np.tile(beams_deg, 2)),
        np.tile(offsets_m, 2),
        np.concatenate([firing_s, firing_s + cycle_s]),
        2 * cycle_s,
    )


def _hdl_32e() -> PacketModel:
    """Return the model of the HDL-32E: a block holds one firing of all beams, every other one of the upper half."""
    lower_deg = np.linspace(-30.67, -10.67, 16)
    beams_deg = np.column_stack([lower_deg, lower_deg + 64 / 3]).ravel()
    times_s = np.linspace(0, 31 * 1.152e-6, 32)
    return PacketModel(HDL_32E, np.radians(beams_deg), np.zeros(32), times_s, block_s=46.08e-6)


# By the number in the packet; the Puck LITE has that of the VLP-16.
MODELS: Mapping[int, PacketModel] = {0x21: _hdl_32e(), 0x22: _vlp_16()}


def model_of(packet: bytes, source: str) -> PacketModel:
    """Return the model of the LiDAR that sent a packet.

    Raises:
        ScanError: It is no data packet of Velodyne's, or of a model that is not known.
    """
    expected = "data packets of a VLP-16, Puck LITE or HDL-32E, 1206 bytes each"
    advice = "packets of other makes and models are read from recordings, such as a ROS bag"
    if not is_data_packet(packet):
        found = f"another packet of {len(packet)} bytes"
        raise ScanError(source, expected=expected, found=found, advice=advice)
    if packet[-1] not in MODELS:
        found = f"packets of model 0x{packet[-1]:02x}"
        raise ScanError(source, expected=expected, found=found, advice=advice)
    return MODELS[packet[-1]]


def is_data_packet(packet: bytes) -> bool:
    """Return whether a packet has the size and the flag of Velodyne's data packets."""
    return len(packet) == PACKET_BYTES and packet[:2] == b"\xff\xee"


def first_azimuth_rad(packet: bytes) -> float:
    """Return the azimuth of a packet's first block, clockwise from straight ahead, 0 to 2 pi."""
    return float(np.radians(int.from_bytes(packet[2:4], "little") / 100) % (2 * np.pi))


def decode(packets: Sequence[bytes], model: PacketModel) -> PacketPoints:
    """Return the returns of packets that follow each other; of two returns of one beam the first in the packet.

    Args:
        packets: Data packets of one LiDAR.
        model: Its model.
    """
    rows = np.frombuffer(b"".join(packets), _PACKET)
    is_dual = rows["mode"][0] == _DUAL_RETURN
    blocks = rows["blocks"][:, :: 2 if is_dual else 1]
    count = blocks.shape[1]
    blocks_s = np.arange(count) * model.block_s
    since_hour_s = 1e-6 * rows["time_us"]
    since_hour_s[since_hour_s < since_hour_s[0] - _HOUR_S / 2] += _HOUR_S
    times_s = since_hour_s[:, None, None] + blocks_s[:, None] + model.times_s
    azimuths_rad = _azimuths(blocks["azimuth_cdeg"].ravel(), model).reshape(times_s.shape)
    ranges_m = _RANGE_UNIT_M * blocks["returns"]["range_2mm"]
    across_m = ranges_m * np.cos(model.elevations_rad)
    is_valid = (ranges_m > 0) & (blocks["flag"] == _FLAG)[..., None]
    columns = (
        across_m * np.cos(azimuths_rad),
        -across_m * np.sin(azimuths_rad),
        ranges_m * np.sin(model.elevations_rad) + model.offsets_m,
        blocks["returns"]["intensity"] / 255,
    )
    points = np.stack([column[is_valid] for column in columns], axis=-1, dtype=np.float32)
    return PacketPoints(points, times_s[is_valid])


def _azimuths(blocks_cdeg: np.ndarray, model: PacketModel) -> Float64:
    """Return (B, 32) the azimuth of each return: the LiDAR turns on between the returns of a block."""
    starts_rad = np.unwrap(np.radians(blocks_cdeg / 100))
    # Where packets are lost, the turn since the block before is not that of one block; the median is.
    turn_rad = float(np.median(np.diff(starts_rad))) if len(starts_rad) > 1 else 0.0
    return np.asarray(starts_rad[:, None] + turn_rad * model.times_s / model.block_s)
