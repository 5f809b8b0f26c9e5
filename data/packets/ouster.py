"""Packets of Ouster's LiDARs, decoded by ouster-sdk with the metadata of the sensor."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from data.clouds.cloud import Cloud
from data.packets.sweeps import PacketSweep
from perception.errors import CalibrationError, ScanError, optional_package
from perception.sensor import SENSORS, LidarModel

_MARK = b"beam_altitude_angles"  # in the metadata of every sensor, and in no other file
_MAX_METADATA_BYTES = 1 << 22
_FAMILY = re.compile(r"OS-?([0-2])")
# Firmware before has 16 bits of reflectance in the lower half of this word, of which ouster-sdk takes 8 for its own.
_CALIBRATED, _LOW_WORD = (2, 1), 0xFFFF
_REFLECTIVITY = "REFLECTIVITY"
_MIN_ELEVATION_STEP_RAD = 1e-6


@dataclass(frozen=True)
class OusterDecoder:
    """Decoder of the packets of one LiDAR.

    Attributes:
        metadata: File of the metadata.
        notes: Sentences on what was assumed.
    """

    metadata: Path
    notes: tuple[str, ...] = ()
    clock_s: float = 0.0

    @property
    def packet_bytes(self) -> int:
        """Size of a packet."""
        return int(_opened(self.metadata).format.lidar_packet_size)

    @property
    def sensor(self) -> LidarModel:
        """LiDAR model, with the beams that the metadata states."""
        return _opened(self.metadata).sensor

    def other_sensor(self, packet: bytes) -> str | None:
        """Return in a few words which other sensor sent a packet; None where the metadata is of this one."""
        opened, data = _opened(self.metadata), np.frombuffer(packet, np.uint8)
        serial, own = int(opened.format.prod_sn(data)), int(opened.info.sn or 0)
        return f"packets of serial number {serial}" if serial and own and serial != own else None

    @property
    def full_scale(self) -> float:
        """Intensity that stands for a reflectance of 1: of calibrated firmware 8 bits, before 16."""
        return 255.0 if _opened(self.metadata).reflectance == _REFLECTIVITY else float(_LOW_WORD)

    def is_data(self, packet: bytes) -> bool:
        """Return whether a packet has the size of this sensor's."""
        return len(packet) == self.packet_bytes

    def packet_time_s(self, packet: bytes) -> float:
        """Return the time of the first column of a packet."""
        from ouster.sdk.core import ColHeader

        data = np.frombuffer(packet, np.uint8)
        form = _opened(self.metadata).format
        return float(form.packet_header(ColHeader.TIMESTAMP, data)[0]) * 1e-9

    def begins_turn(self, packet: bytes, before: bytes) -> bool:
        """Return whether two packets are of different frames."""
        form = _opened(self.metadata).format
        numbers = {form.frame_id(np.frombuffer(one, np.uint8)) for one in (packet, before)}
        return len(numbers) > 1

    def sweeps(self, packets: Iterable[bytes]) -> list[PacketSweep]:
        """Find the packets of each frame; those of two frames may come in turn where one ends."""
        from ouster.sdk.core import ColHeader

        opened, size = _opened(self.metadata), self.packet_bytes
        frames: list[tuple[int, list[int], list[float]]] = []
        for index, packet in enumerate(packets):
            if len(packet) != size:
                continue
            data = np.frombuffer(packet, np.uint8)
            number = opened.format.frame_id(data)
            times_ns = opened.format.packet_header(ColHeader.TIMESTAMP, data)
            known = next((one for one in frames[-2:] if one[0] == number), None)
            if known is None:
                known = (number, [], [])
                frames.append(known)
            known[1].append(index)
            known[2].extend((float(times_ns[0]) * 1e-9, float(times_ns[-1]) * 1e-9))
        return [
            PacketSweep(
                np.array(indices),
                (min(times_s) + max(times_s)) / 2,
                0 < place < len(frames) - 1 or len(indices) >= opened.packets,
            )
            for place, (_, indices, times_s) in enumerate(frames)
        ]

    def decode(self, packets: Sequence[bytes]) -> Cloud:
        """Return the returns of packets of one frame, of two of one beam the first; times by the sensor's clock."""
        from ouster.sdk.core import ColHeader

        opened = _opened(self.metadata)
        shape = opened.info.h, opened.info.w
        ranges, reflectance = np.zeros(shape, np.uint32), np.zeros(shape, np.uint32)
        times_ns = np.zeros(shape[1], np.uint64)
        for packet in packets:
            data = np.frombuffer(packet, np.uint8)
            columns, status, stamps_ns = (
                opened.format.packet_header(part, data)
                for part in (ColHeader.MEASUREMENT_ID, ColHeader.STATUS, ColHeader.TIMESTAMP)
            )
            is_valid = status & 1 == 1
            columns = columns[is_valid]
            if (columns >= shape[1]).any():
                raise ScanError(
                    self.metadata,
                    expected=f"metadata of the sensor of the packets, with more than {columns.max()} columns a turn",
                    found=str(shape[1]),
                )
            times_ns[columns] = stamps_ns[is_valid]
            ranges[:, columns] = opened.format.packet_field("RANGE", data)[:, is_valid]
            values = opened.format.packet_field(opened.reflectance, data)[:, is_valid]
            reflectance[:, columns] = values
        ring, column = np.nonzero(ranges)
        return Cloud(
            opened.points_of(ranges)[ring, column].astype(np.float32),
            (reflectance[ring, column] & _LOW_WORD).astype(np.float32),
            ring,
            times_ns[column].astype(np.float64) * 1e-9,
        )


@dataclass(frozen=True)
class _Opened:
    """What metadata says of a sensor.

    Attributes:
        info: Metadata as ouster-sdk has it.
        format: Format of its packets.
        points_of: Function from a range image to points.
        sensor: LiDAR model.
        packets: Number of packets of a whole frame.
        reflectance: Field of the packets that holds it.
    """

    info: Any
    format: Any
    points_of: Any
    sensor: LidarModel
    packets: int
    reflectance: str


def is_metadata(path: Path) -> bool:
    """Return whether a file is the metadata of an Ouster, by a word in it."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return _MARK in file.read(_MAX_METADATA_BYTES)


def _opened(path: Path) -> _Opened:
    return _opened_once(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=8)
def _opened_once(path: Path, _: int) -> _Opened:
    """Read metadata.

    Raises:
        CalibrationError: It is damaged.
        MissingDependencyError: ouster-sdk is not installed.
    """
    with optional_package("ouster-sdk", needed_for=str(path), extra="packets"):
        from ouster.sdk.core import PacketFormat, SensorInfo, XYZLut
    try:
        info = SensorInfo(path.read_text())
        sensor = _sensor(info)
        packets = int(info.format.lidar_packets_per_frame())
        version = info.get_version()
        is_calibrated = (version.major, version.minor) >= _CALIBRATED or version.major == 0
        reflectance = _REFLECTIVITY if is_calibrated else "RAW32_WORD2"
        return _Opened(info, PacketFormat(info), XYZLut(info), sensor, packets, reflectance)
    except Exception as error:  # the parser's are not told
        found = " ".join(str(error).split())[:200]
        raise CalibrationError(path, expected="the metadata of an Ouster", found=found) from error


def _sensor(info: Any) -> LidarModel:  # noqa: ANN401 - a class of ouster-sdk
    family = _FAMILY.match(info.prod_line)
    known = SENSORS.get(f"OS{family.group(1)}-128" if family else "", SENSORS["OS1-128"])
    elevations_rad = np.sort(np.radians(np.array(info.beam_altitude_angles, np.float64)))[::-1]
    # Two beams of one elevation are a whisker apart, as a model has them in order.
    for beam in range(1, len(elevations_rad)):
        elevations_rad[beam] = min(
            elevations_rad[beam], elevations_rad[beam - 1] - _MIN_ELEVATION_STEP_RAD
        )
    return replace(
        known,
        name=info.prod_line,
        elevations_rad=elevations_rad,
        azimuth_step_rad=2 * np.pi / info.w,
        rate_hz=float(info.format.fps or known.rate_hz),
    )
