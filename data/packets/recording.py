"""A recording of packets as sweeps: of several LiDARs in it, one is used, and the others are said."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from data.clouds.cloud import Cloud
from data.folder.discovery import RECORDING_SUFFIXES
from data.kitti.sensor_files import FrameFiles
from data.packets.capture import read_capture
from data.packets.datagrams import Capture, Datagrams, Sender, file_bytes
from data.packets.ouster import OusterDecoder, is_metadata
from data.packets.sweeps import PacketDecoder, PacketSweep
from data.packets.velodyne import PACKET_BYTES, VelodyneDecoder, is_data_packet
from perception.errors import CalibrationError, DriveError, UsageError
from perception.sensor import LidarModel
from perception.types import Int

_CALIBRATION = b"vert_correction"  # in the calibration of every Velodyne
_MIN_LIDAR_BYTES = 1000  # of a packet with returns
_MAX_CLOCK_ERROR_S = (
    1.0  # between the sensor's clock and that of the recording, from one sweep to the next
)
_MAX_NAMED = 4
_ADVICE = (
    "save what http://SENSOR/api/v1/sensor/metadata answers as {0}, or name the file with --sensor"
)


@dataclass(frozen=True, eq=False)
class Recording:
    """Sweeps of one LiDAR of a capture.

    Attributes:
        path: Capture.
        sender: Where the packets come from.
        datagrams: Packets of the sender.
        decoder: Decoder of them.
        beams_file: Metadata of an Ouster, or calibration of an HDL-64E, or None without one.
        sweeps: Sweeps in order.
        notes: Sentences on what is not used, or was assumed.
    """

    path: Path
    sender: Sender
    datagrams: Datagrams
    decoder: PacketDecoder
    beams_file: Path | None
    sweeps: tuple[PacketSweep, ...]
    notes: tuple[str, ...]

    @cached_property
    def stamps_ns(self) -> Int:
        """(F,) times of the middles of the sweeps: the recording's clock for the first, the sensor's from there."""
        times_ns = np.array(self.datagrams.times_ns, np.int64)
        own_s = np.array([one.middle_s for one in self.sweeps])
        recorded_s = np.array(
            [
                float(times_ns[one.packets[[0, -1]]].mean() - times_ns[0]) / 1e9
                for one in self.sweeps
            ]
        )
        steps_s, recorded_steps_s = np.diff(own_s), np.diff(recorded_s)
        if self.decoder.clock_s:
            half_s = self.decoder.clock_s / 2
            steps_s = (steps_s + half_s) % self.decoder.clock_s - half_s
        is_set = np.abs(steps_s - recorded_steps_s) > _MAX_CLOCK_ERROR_S
        steps_s = np.where(is_set | (steps_s <= 0), np.maximum(recorded_steps_s, 1e-3), steps_s)
        since_s = np.concatenate([recorded_s[:1], recorded_s[:1] + np.cumsum(steps_s)])
        return np.asarray(times_ns[0] + np.round(since_s * 1e9).astype(np.int64), np.int64)

    @cached_property
    def sensor(self) -> LidarModel:
        """LiDAR model, at the rate of the sweeps."""
        model = self.decoder.sensor
        if len(self.sweeps) < 2:
            return model
        rate_hz = round(1e9 / float(np.median(np.diff(self.stamps_ns))), 2)
        # A head that turns twice as fast fires half as often in a turn, if the model's step is not that of its metadata.
        step = 1.0 if isinstance(self.decoder, OusterDecoder) else rate_hz / model.rate_hz
        return replace(model, rate_hz=rate_hz, azimuth_step_rad=model.azimuth_step_rad * step)

    @property
    def files(self) -> FrameFiles:
        """Names of the sweeps, as if each were a file."""
        return FrameFiles(
            self.path, tuple(self.path / f"{number:06d}" for number in range(len(self.sweeps)))
        )

    def cloud(self, index: int) -> Cloud:
        """Return the returns of one sweep, with times from its middle on.

        Raises:
            ScanError: Its packets cannot be decoded.
        """
        return _read_once(self, index)


@lru_cache(maxsize=2)
def _read_once(recording: Recording, index: int) -> Cloud:
    """Read a sweep; its points and their times are asked for one after the other."""
    sweep, data = recording.sweeps[index], file_bytes(recording.path)
    packets = [recording.datagrams.read(number, data) for number in sweep.packets.tolist()]
    cloud = recording.decoder.decode(packets)
    return replace(cloud, times_s=np.asarray(cloud.times_s) - sweep.middle_s)


def is_recording(path: Path) -> bool:
    """Return whether a file is a capture, by its name."""
    return path.suffix.lower() in RECORDING_SUFFIXES and path.is_file()


def is_beams_file(path: Path) -> bool:
    """Return whether a file is the metadata of an Ouster, or the calibration of an HDL-64E."""
    return is_metadata(path) or (path.is_file() and _CALIBRATION in path.read_bytes())


def open_recording(path: Path, lidar: str | None = None, beams: Path | None = None) -> Recording:
    """Open a recording.

    Args:
        path: Capture.
        lidar: Address, port, or both of the LiDAR; else the one with most packets.
        beams: Metadata of an Ouster, or calibration of an HDL-64E; else the .json file beside the capture.

    Raises:
        DriveError: There are no packets of a LiDAR that is known.
        CalibrationError: The metadata is damaged, or of another sensor.
        UsageError: There is no LiDAR of this address.
        MissingDependencyError: The decoder is not installed.
    """
    capture = read_capture(path)
    large = _large_senders(capture)
    named = [one for one in large if lidar is None or one.is_named(lidar)]
    if not named and lidar is not None:
        raise UsageError(
            f"--lidar {lidar}",
            expected=f"one of {', '.join(map(str, large)) or 'the senders in the recording'}",
            found=f"no packets of it in {path}",
        )
    sender, decoder = _first_lidar(capture, named, beams)
    datagrams = capture.senders[sender]
    data = file_bytes(path)
    found = decoder.sweeps(datagrams.read(index, data) for index in range(len(datagrams)))
    whole = [one for one in found if one.is_whole]
    notes = [*_notes(capture, sender, large, found, whole), *decoder.notes]
    beams = decoder.metadata if isinstance(decoder, OusterDecoder) else beams
    return Recording(path, sender, datagrams, decoder, beams, tuple(whole or found), tuple(notes))


def _large_senders(capture: Capture) -> list[Sender]:
    """Return the senders of packets as large as those with returns, that with the most packets first."""
    senders = [
        sender
        for sender, datagrams in capture.senders.items()
        if max(datagrams.lengths) >= _MIN_LIDAR_BYTES
    ]
    return sorted(senders, key=lambda one: -len(capture.senders[one]))


def _first_lidar(
    capture: Capture, senders: Sequence[Sender], beams: Path | None
) -> tuple[Sender, PacketDecoder]:
    """Return the first sender that is a LiDAR, and the decoder of its packets."""
    path, data = capture.path, file_bytes(capture.path)
    files = _metadata_files(path, beams)
    misfits: list[CalibrationError] = []
    for sender in senders:
        datagrams = capture.senders[sender]
        usual = datagrams.lengths.most_common(1)[0][0]
        packet = next(
            one
            for one in (datagrams.read(index, data) for index in range(len(datagrams)))
            if len(one) == usual
        )
        source = f"{path}, {sender}"
        if usual == PACKET_BYTES and is_data_packet(packet):
            return sender, VelodyneDecoder.of(packet, source, beams)
        fitting = []
        for file in files:
            decoder = OusterDecoder(file)
            misfit = _misfit(decoder, packet, datagrams)
            if misfit is None:
                fitting.append(decoder)
            else:
                advice = f"name the metadata of {sender} with --sensor"
                expected = f"the metadata of the sensor that sent {source}"
                misfits.append(
                    CalibrationError(file, expected=expected, found=misfit, advice=advice)
                )
        fitting = [f for f in fitting if f.metadata.stem.startswith(path.stem)] or fitting
        if len(fitting) > 1:
            raise DriveError(
                path,
                expected="one .json file beside it that fits its packets",
                found=", ".join(one.metadata.name for one in fitting),
                advice="name one with --sensor",
            )
        if fitting:
            return sender, fitting[0]
    if misfits and (beams is not None or misfits[0].where == str(path.with_suffix(".json"))):
        raise misfits[0]
    raise _no_lidar(capture, senders, misfits)


def _misfit(decoder: OusterDecoder, packet: bytes, datagrams: Datagrams) -> str | None:
    """Return in a few words why metadata is not that of some packets; None where it is."""
    if decoder.packet_bytes not in datagrams.lengths:
        model = decoder.sensor.name
        return f"that of packets of {decoder.packet_bytes} bytes ({model}), where these have {len(packet)}"
    return decoder.other_sensor(packet) if len(packet) == decoder.packet_bytes else None


def _metadata_files(path: Path, stated: Path | None) -> list[Path]:
    """Return the metadata that is stated, that of the name of the capture, or all that lies beside it."""
    if stated is not None:
        return [stated] if is_metadata(stated) else []
    own = path.with_suffix(".json")
    if own.is_file():
        if not is_metadata(own):
            raise CalibrationError(
                own,
                expected="the metadata of an Ouster, as the recording has its name",
                found="another file",
                advice=_ADVICE.format(own.name),
            )
        return [own]
    return [one for one in sorted(path.parent.glob("*.json")) if is_metadata(one)]


def _no_lidar(
    capture: Capture, senders: Sequence[Sender], misfits: Sequence[CalibrationError]
) -> DriveError:
    """Return the error of a capture of which no packets can be decoded, with what there is in it."""
    found = [
        f"{len(capture.senders[one])} packets of {max(capture.senders[one].lengths)} bytes from {one}"
        for one in senders[:_MAX_NAMED]
    ]
    if found:
        others = [f"{one.where} is {one.found}" for one in misfits[:_MAX_NAMED]]
        metadata = f"no metadata that fits: {', '.join(others)}" if others else "no metadata"
        return DriveError(
            capture.path,
            expected="packets of a Velodyne, or of an Ouster with its metadata beside them",
            found=f"{', '.join(found)}, and {metadata}",
            advice=_ADVICE.format(capture.path.with_suffix(".json").name),
        )
    count = sum(map(len, capture.senders.values()))
    found = [f"{count} small UDP packets"] if count else []
    found += [f"{number} {what}" for what, number in capture.others.most_common(_MAX_NAMED)]
    return DriveError(
        capture.path,
        expected="UDP packets of a Velodyne or Ouster LiDAR",
        found=", ".join(found) or "no packets",
        advice="record the network interface of the LiDAR, with whole packets",
    )


def _notes(
    capture: Capture,
    sender: Sender,
    senders: Sequence[Sender],
    found: Sequence[PacketSweep],
    whole: Sequence[PacketSweep],
) -> Iterator[str]:
    """Yield sentences on what is not used."""
    path, others = capture.path, [one for one in senders if one != sender]
    if others:
        counts = ", ".join(f"{one} ({len(capture.senders[one])} packets)" for one in others)
        used = f"{sender} ({len(capture.senders[sender])} packets)"
        yield f"{path}: {used} is used, and not {counts}; choose with --lidar"
    if capture.is_cut:
        yield f"{path}: the file ends within a packet; the whole sweeps before it are used"
    if found and not whole:
        yield f"{path}: no sweep is whole; {len(found)} parts of sweeps are used"
    elif len(whole) < len(found):
        count = len(found) - len(whole)
        yield f"{path}: {count} of {len(found)} sweeps are left out, as they are not whole"
