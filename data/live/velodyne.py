"""Data packets of Velodyne's LiDARs, as the makers' manuals describe them.

A packet has 1206 bytes: twelve blocks of 100, the time in microseconds since the full hour, the return mode, and the
number of the model. A block has a flag, the azimuth in hundredths of a degree, and 32 returns of three bytes: range
in units of 2 or 4 mm, and intensity. The azimuth grows clockwise from straight ahead. A VLS-128 fires its beams in four
blocks, each with a flag of its own; the others in one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from perception.errors import ScanError
from perception.sensor import HDL_32E, SENSORS, VLP_16, LidarModel
from perception.sensor.models import VLP_32C_BY_LASER_DEG, VLS_128_BY_LASER_DEG
from perception.types import Float32, Float64

PACKET_BYTES = 1206
_BLOCKS, _RETURNS = 12, 32
_BLOCK = np.dtype(
    [
        ("flag", "<u2"),
        ("azimuth_cdeg", "<u2"),
        ("returns", [("range", "<u2"), ("intensity", "u1")], _RETURNS),
    ]
)
_PACKET = np.dtype(
    [("blocks", _BLOCK, _BLOCKS), ("time_us", "<u4"), ("mode", "u1"), ("model", "u1")]
)
_FLAGS = (0xEEFF, 0xDDFF, 0xCCFF, 0xBBFF)  # of the blocks of one cycle; bytes FF EE and so on
_DUAL_RETURN = 0x39
_HOUR_S = 3600.0


@dataclass(frozen=True)
class PacketModel:
    """How a LiDAR fills the G blocks of a cycle, in which each of its beams fires once or twice.

    Attributes:
        sensor: LiDAR model.
        elevations_rad: (G, 32) elevation of the beam of each return.
        azimuths_rad: (G, 32) azimuth of the same, clockwise from that of the block.
        offsets_m: (G, 32) height of each beam's origin above the sensor's.
        times_s: (G, 32) time of each return since the first one of its cycle.
        cycle_s: Time between two cycles.
        range_unit_m: Unit of the ranges.
    """

    sensor: LidarModel
    elevations_rad: Float64
    azimuths_rad: Float64
    offsets_m: Float64
    times_s: Float64
    cycle_s: float
    range_unit_m: float


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
    firing_s, firings_s = np.linspace(0, 15 * 2.304e-6, 16), 55.296e-6
    return PacketModel(
        VLP_16,
        np.radians(np.tile(beams_deg, 2))[None],
        np.zeros((1, 32)),
        np.tile(offsets_m, 2)[None],
        np.concatenate([firing_s, firing_s + firings_s])[None],
        cycle_s=2 * firings_s,
        range_unit_m=0.002,
    )


def _hdl_32e() -> PacketModel:
    """Return the model of the HDL-32E: a block holds one firing of all beams, every other one of the upper half."""
    lower_deg = np.linspace(-30.67, -10.67, 16)
    beams_deg = np.column_stack([lower_deg, lower_deg + 64 / 3]).ravel()
    return PacketModel(
        HDL_32E,
        np.radians(beams_deg)[None],
        np.zeros((1, 32)),
        np.zeros((1, 32)),
        np.linspace(0, 31 * 1.152e-6, 32)[None],
        cycle_s=46.08e-6,
        range_unit_m=0.002,
    )


# By laser ID, as the elevations.
_VLP_32C_AZIMUTHS_DEG = (
    1.4, -4.2, 1.4, -1.4, 1.4, -1.4, 4.2, -1.4, 1.4, -4.2, 1.4, -1.4, 4.2, -1.4, 4.2, -1.4,
    1.4, -4.2, 1.4, -4.2, 4.2, -1.4, 1.4, -1.4, 1.4, -1.4, 1.4, -4.2, 4.2, -1.4, 1.4, -1.4,
)  # fmt: skip


def _vlp_32c() -> PacketModel:
    """Return the model of the VLP-32C: two beams fire at a time.

    The azimuths are added to the block's: so they lie in the sweeps of the two VLP-32C of a log of Argoverse 2, to 0.05
    degrees.
    """
    return PacketModel(
        SENSORS["VLP-32C"],
        np.radians(VLP_32C_BY_LASER_DEG)[None],
        np.radians(_VLP_32C_AZIMUTHS_DEG)[None],
        np.zeros((1, 32)),
        np.repeat(2.304e-6 * np.arange(16), 2)[None],
        cycle_s=55.296e-6,
        range_unit_m=0.004,
    )


# Of eight beams that fire together; by laser ID they repeat.
_VLS_128_AZIMUTHS_DEG = (6.354, 4.548, 2.732, 0.911, -0.911, -2.732, -4.548, -6.354)


def _vls_128() -> PacketModel:
    """Return the model of the VLS-128: eight beams fire at a time, and a pause is as long as a firing.

    One pause is after the eighth firing.
    """
    firings = np.arange(16)
    times_s = np.repeat(2.665e-6 * (firings + firings // 8), 8)
    return PacketModel(
        SENSORS["VLS-128"],
        np.radians(VLS_128_BY_LASER_DEG).reshape(4, 32),
        np.radians(np.tile(_VLS_128_AZIMUTHS_DEG, 16)).reshape(4, 32),
        np.zeros((4, 32)),
        times_s.reshape(4, 32),
        cycle_s=53.3e-6,
        range_unit_m=0.004,
    )


# By the number in the packet; the Puck LITE has that of the VLP-16.
MODELS: Mapping[int, PacketModel] = {
    0x21: _hdl_32e(), 0x22: _vlp_16(), 0x28: _vlp_32c(), 0xA1: _vls_128(),
}  # fmt: skip


def model_of(packet: bytes, source: str) -> PacketModel:
    """Return the model of the LiDAR that sent a packet.

    Raises:
        ScanError: It is no data packet of Velodyne's, or of a model that is not known.
    """
    expected = "data packets of a VLP-16, Puck LITE, VLP-32C, HDL-32E or VLS-128, 1206 bytes each"
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
    # P packets of C cycles of G blocks; what is left of a packet of two returns is empty.
    group = len(model.elevations_rad)
    count = blocks.shape[1] // group
    blocks = blocks[:, : count * group].reshape(len(rows), count, group)
    since_hour_s = 1e-6 * rows["time_us"]
    since_hour_s[since_hour_s < since_hour_s[0] - _HOUR_S / 2] += _HOUR_S
    cycles_s = since_hour_s[:, None] + np.arange(count) * model.cycle_s
    times_s = cycles_s[..., None, None] + model.times_s
    azimuths_rad = _azimuths(blocks["azimuth_cdeg"][..., 0].ravel(), model).reshape(times_s.shape)
    ranges_m = model.range_unit_m * blocks["returns"]["range"]
    across_m = ranges_m * np.cos(model.elevations_rad)
    is_valid = (ranges_m > 0) & (blocks["flag"] == _FLAGS[:group])[..., None]
    columns = (
        across_m * np.cos(azimuths_rad),
        -across_m * np.sin(azimuths_rad),
        ranges_m * np.sin(model.elevations_rad) + model.offsets_m,
        blocks["returns"]["intensity"] / 255,
    )
    points = np.stack([column[is_valid] for column in columns], axis=-1, dtype=np.float32)
    return PacketPoints(points, times_s[is_valid])


def _azimuths(cycles_cdeg: np.ndarray, model: PacketModel) -> Float64:
    """Return (C, G, 32) the azimuth of each return: the LiDAR turns on between the returns of a cycle."""
    starts_rad = np.unwrap(np.radians(cycles_cdeg / 100))
    # Where packets are lost, the turn since the cycle before is not that of one cycle; the median is.
    turn_rad = float(np.median(np.diff(starts_rad))) if len(starts_rad) > 1 else 0.0
    turned_rad = turn_rad * model.times_s / model.cycle_s
    return np.asarray(starts_rad[:, None, None] + turned_rad + model.azimuths_rad)
