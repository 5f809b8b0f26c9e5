"""Packets of Velodyne's LiDARs, decoded by velodyne-decoder.

A data packet has 1206 bytes: twelve blocks of 100, the time in microseconds since the full hour, the return mode, and the
number of the model. A block begins with a flag and the azimuth in hundredths of a degree, which grows clockwise from
straight ahead. An HDL-64E has no number of its model, but blocks of two flags in turn.
"""

import atexit
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from struct import unpack_from
from threading import get_ident
from types import ModuleType
from typing import Any

import numpy as np

from data.clouds.cloud import Cloud
from data.packets.sweeps import PacketSweep
from perception.errors import ScanError, optional_package
from perception.sensor import HDL_32E, HDL_64E, SENSORS, VLP_16, LidarModel
from perception.types import Float64

PACKET_BYTES = 1206
_UPPER, _LOWER = b"\xff\xee", b"\xff\xdd"  # flags of a block
_MODEL_HDL_64E, _CALIBRATION_HDL_64E = "HDL64E_S3", "HDL-64E_S3-VeloView.yml"
_MODELS: Mapping[str, LidarModel] = {
    "VLP16": VLP_16, "PuckHiRes": replace(VLP_16, name="Puck Hi-Res"), "HDL32E": HDL_32E,
    "VLP32A": replace(SENSORS["VLP-32C"], name="VLP-32A"), "VLP32B": replace(SENSORS["VLP-32C"], name="VLP-32B"),
    "VLP32C": SENSORS["VLP-32C"], "VLS128": SENSORS["VLS-128"], _MODEL_HDL_64E: HDL_64E,
}  # fmt: skip
_RANGES_M = (0.1, 300.0)
_SAME_BEAM_RAD = 5e-4
_HOUR_S = 3600.0
_MAX_STEPS = 1.5  # of a packet from the place behind the vehicle, where a turn begins


@dataclass(frozen=True)
class VelodyneDecoder:
    """Decoder of the packets of one LiDAR.

    Attributes:
        sensor: LiDAR model.
        source: What sends the packets, for error messages.
        model: Name of the model in velodyne-decoder.
        calibration: Text of the calibration of an HDL-64E, else none.
        notes: Sentences on what was assumed.
        clock_s: Time after which the clock begins again, an hour.
        full_scale: Intensity that stands for a reflectance of 1.
    """

    sensor: LidarModel
    source: str
    model: str
    calibration: str = ""
    notes: tuple[str, ...] = ()
    clock_s: float = _HOUR_S
    full_scale: float = 255.0

    @classmethod
    def of(
        cls,
        packet: bytes,
        source: str,
        calibration: Path | None = None,
        *,
        extra: str = "packets",
    ) -> "VelodyneDecoder":
        """Return the decoder of the LiDAR that sent a packet.

        Args:
            packet: A packet.
            source: What sends them, for error messages.
            calibration: File of the beams of an HDL-64E; else the usual ones.
            extra: Extra of this program that installs the decoder.

        Raises:
            ScanError: It is no data packet of Velodyne's, or of a model that is not known.
            MissingDependencyError: velodyne-decoder is not installed.
        """
        velodyne = _library(source, extra)
        if not is_data_packet(packet):
            found = f"another packet of {len(packet)} bytes"
            raise _unknown(source, found)
        if packet[100:102] == _LOWER and packet[200:202] == _UPPER:
            return cls._hdl_64e(velodyne, source, calibration)
        decoder = velodyne.ScanDecoder()
        try:
            decoder.decode(_vector(velodyne, [packet]))
            name = decoder.model_id.name
            sensor, beams = _MODELS[name], velodyne.Calibration.default_calibs[decoder.model_id]
        except (RuntimeError, KeyError) as error:
            raise _unknown(source, f"packets of model 0x{packet[-1]:02x}") from error
        elevations_rad = _elevations_rad(beams.to_string())
        if len(elevations_rad) != sensor.beams or not np.allclose(
            elevations_rad, sensor.elevations_rad, rtol=0, atol=_SAME_BEAM_RAD
        ):
            sensor = replace(sensor, elevations_rad=elevations_rad)
        return cls(sensor, source, name)

    @classmethod
    def _hdl_64e(
        cls, velodyne: ModuleType, source: str, calibration: Path | None
    ) -> "VelodyneDecoder":
        notes: tuple[str, ...] = ()
        try:
            if calibration is None:
                beams = velodyne.get_bundled_calibration(_CALIBRATION_HDL_64E)
                notes = (
                    f"{source}: the beams of this HDL-64E are taken as usual ones, up to 2 degrees off; "
                    "write its own into a file with extract-hdl64e-calibration, and name it with --sensor",
                )
            else:
                beams = velodyne.Calibration.read(str(calibration))
            text = beams.to_string()
            sensor = replace(HDL_64E, elevations_rad=_elevations_rad(text))
        except Exception as error:  # a YAML parser in C++, whose exceptions are not told
            found = " ".join(str(error).split())
            raise ScanError(
                calibration or source, expected="the calibration of an HDL-64E", found=found
            ) from error
        return cls(sensor, source, _MODEL_HDL_64E, text, notes)

    def is_data(self, packet: bytes) -> bool:
        """Return whether a packet has returns."""
        return is_data_packet(packet)

    def packet_time_s(self, packet: bytes) -> float:
        """Return the time of a packet since the hour."""
        return float(unpack_from("<I", packet, 1200)[0]) * 1e-6

    def begins_turn(self, packet: bytes, before: bytes) -> bool:
        """Return whether the place behind the vehicle lies between two packets."""
        behind_rad, last_rad = (
            (first_azimuth_rad(one) + np.pi) % (2 * np.pi) for one in (packet, before)
        )
        return behind_rad < last_rad - np.pi

    def sweeps(self, packets: Iterable[bytes]) -> list[PacketSweep]:
        """Find the turns; each begins behind the vehicle."""
        indices, azimuths_cdeg, times_us = [], [], []
        for index, packet in enumerate(packets):
            if is_data_packet(packet):
                indices.append(index)
                azimuths_cdeg.append(unpack_from("<H", packet, 2)[0])
                times_us.append(unpack_from("<I", packet, 1200)[0])
        behind_deg = np.mod(np.array(azimuths_cdeg, np.float64) / 100 + 180, 360)
        times_s = 1e-6 * np.array(times_us, np.float64)
        steps_deg = np.diff(behind_deg)
        step_deg = _MAX_STEPS * float(np.median(steps_deg % 360)) if len(steps_deg) else 0.0
        cuts = [0, *(np.flatnonzero(steps_deg < -180) + 1).tolist(), len(indices)]
        found = []
        for start, end in pairwise(cuts):
            turned_s = (times_s[end - 1] - times_s[start]) % _HOUR_S
            is_whole = (start > 0 or behind_deg[start] <= step_deg) and (
                end < len(indices) or behind_deg[end - 1] >= 360 - step_deg
            )
            middle_s = float(times_s[end - 1] - turned_s / 2)
            found.append(PacketSweep(np.array(indices[start:end]), middle_s, bool(is_whole)))
        return found

    def decode(self, packets: Sequence[bytes]) -> Cloud:
        """Return the returns of packets, of two of one beam the last; times since the hour of the last packet."""
        velodyne = _library(self.source)
        decoder = _scan_decoder(velodyne, self.model, self.calibration, get_ident())
        try:
            vector = _vector(velodyne, packets)
            # The first packet twice is of a head that stands, whatever came before; how fast it turns is known from
            # the second packet on.
            for count in (1, 2):
                decoder.decode(vector[:count])
            stamp, points = decoder.decode(vector, as_pcl_structs=True)
        except RuntimeError as error:
            found = str(error)
            raise ScanError(
                self.source, expected=f"packets of a {self.sensor.name}", found=found
            ) from error
        if decoder.return_mode == velodyne.ReturnMode.BOTH:
            points = points[points["return_type"] != velodyne.ReturnMode.STRONGEST.value]
        return Cloud(
            np.column_stack([points[name] for name in "xyz"]),
            points["intensity"].astype(np.float32),
            points["ring"].astype(np.int64),
            stamp.device + points["time"].astype(np.float64),
        )


@lru_cache(maxsize=4)
def _scan_decoder(velodyne: ModuleType, model: str, calibration: str, thread: int) -> Any:  # noqa: ANN401 - a class of velodyne-decoder
    """Return a thread's decoder of a model: with the memory for a turn that it keeps, it takes half the time."""
    beams = velodyne.Calibration.from_string(calibration) if calibration else None
    low_m, high_m = _RANGES_M
    return velodyne.ScanDecoder(
        velodyne.Config(
            model=velodyne.Model[model], calibration=beams, min_range=low_m, max_range=high_m
        )
    )


atexit.register(_scan_decoder.cache_clear)  # objects of the library must not outlive it


def is_data_packet(packet: bytes) -> bool:
    """Return whether a packet has the size and the flag of Velodyne's data packets."""
    return len(packet) == PACKET_BYTES and packet[:2] == _UPPER


def first_azimuth_rad(packet: bytes) -> float:
    """Return the azimuth of a packet's first block, clockwise from straight ahead, 0 to 2 pi."""
    return float(np.radians(unpack_from("<H", packet, 2)[0] / 100) % (2 * np.pi))


def _elevations_rad(calibration: str) -> Float64:
    """Return the elevations of the beams of a calibration as the library writes it, the highest first."""
    beams_rad = re.findall(r"\bvert_correction: (\S+)", calibration)
    return np.sort(np.array(beams_rad, np.float64))[::-1]


def _vector(velodyne: ModuleType, packets: Sequence[bytes]) -> Any:  # noqa: ANN401 - a class of velodyne-decoder
    # A list is taken faster than bytes or a tuple; without a time of arrival, an hour would not end.
    return velodyne.PacketVector([velodyne.VelodynePacket(1.0, list(one)) for one in packets])


def _library(source: str, extra: str = "packets") -> ModuleType:
    with optional_package("velodyne-decoder", needed_for=source, extra=extra):
        import velodyne_decoder
    module: ModuleType = velodyne_decoder
    return module


def _unknown(source: str, found: str) -> ScanError:
    return ScanError(
        source,
        expected="data packets of a VLP-16, Puck, VLP-32, HDL-32E, HDL-64E or VLS-128, 1206 bytes each",
        found=found,
        advice="packets of other makes and models are read from recordings, such as a ROS bag",
    )
