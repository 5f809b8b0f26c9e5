"""A LiDAR on the network as a source: its packets are gathered to one scan a turn."""

import logging
import socket
import time
from bisect import insort
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from data.clouds.cloud import Cloud
from data.live.source import LiveSource
from data.packets.ouster import OusterDecoder, is_metadata
from data.packets.recording import is_beams_file
from data.packets.sweeps import PacketDecoder
from data.packets.velodyne import VelodyneDecoder
from perception.errors import PerceptionError, ScanError, UsageError
from perception.sensor import LidarModel, load_sensor
from perception.types import Frame, HealthLevel

log = logging.getLogger(__name__)

_BUFFER_BYTES = 1 << 22  # of the socket: a second of packets, while a scan is decoded
_WAIT_S = 0.1  # between two looks at whether the source is closed
_SILENT_S, _SILENT_STEP_S = 0.3, 0.4  # until it is reported, and between two reports
_TURNS = 10  # that tell the number of packets in one
_SPARE_PACKETS = 2  # in which turns differ
_SILENT, _LOST, _ODD, _SKIPPED = "silent", "packets lost", "packets left out", "turn left out"
_MAX_STEP_S = 60.0  # between two scans; a longer one means that the sensor's clock was set
_MAX_TURN_S = 0.5  # the slowest turn is 0.2 s
_MAX_PACKETS = 4000  # of one turn: a LiDAR that stands still must not fill the memory
_MAX_LATE = 8  # packets that may overtake another one on the network


@dataclass(frozen=True)
class UdpAddress:
    """Address at which packets arrive.

    Attributes:
        port: Port; 0 for any that is free.
        host: Address of the network interface; all of them where it is 0.0.0.0.
        timeout_s: Longest wait for the first packet.
    """

    port: int = 2368
    host: str = "0.0.0.0"
    timeout_s: float = 10.0


class _SensorClock:
    """Time by the sensor's clock, which may start again after some time, as time of this computer."""

    def __init__(self, period_s: float, turnover_s: float) -> None:
        self._period_s, self._turnover_s = period_s, turnover_s
        self._last_s = 0.0
        self._time_s: float | None = None

    def time_s(self, own_s: float) -> float:
        """Return the time of the next scan; a period after the last one where the clock was set."""
        if self._time_s is None:
            self._time_s = time.time()
        else:
            step_s = _step_s(self._last_s, own_s, self._turnover_s)
            self._time_s += step_s if 0 < step_s < _MAX_STEP_S else self._period_s
        self._last_s = own_s
        return self._time_s


def _step_s(before_s: float, now_s: float, turnover_s: float) -> float:
    """Return the time between two times of a clock, the shorter way where it starts again."""
    step_s = now_s - before_s
    return (step_s + turnover_s / 2) % turnover_s - turnover_s / 2 if turnover_s else step_s


class UdpLidar(LiveSource):
    """Scans of a Velodyne or Ouster LiDAR, one a turn; that of a Velodyne begins behind the vehicle."""

    def __init__(
        self, address: UdpAddress, sensor: LidarModel | None = None, beams: Path | None = None
    ) -> None:
        """Open the port and wait for the first packet, which tells the model of a Velodyne.

        Args:
            address: Address at which packets arrive.
            sensor: LiDAR model, such as one of another height; else the one that the packets name.
            beams: Metadata of an Ouster, or calibration of an HDL-64E.

        Raises:
            UsageError: The port cannot be opened.
            ScanError: No packet comes, or one of a LiDAR that is not known.
            CalibrationError: The metadata is damaged.
        """
        self._beams = beams
        self._is_closed = False
        self._socket = _open(address)
        self.port: int = self._socket.getsockname()[1]
        name = f"UDP port {self.port}"
        self._decoder = self._first_decoder(name, address.timeout_s)
        model = sensor or self._decoder.sensor
        if sensor is not None and isinstance(self._decoder, OusterDecoder):
            model = replace(self._decoder.sensor, height_m=sensor.height_m)  # which knows the beams
        super().__init__(name, model, is_sequence=True)
        self.health.parts = (name,)
        self._left_out = 0  # packets that came twice or late, since the last turn
        self._counts = deque[int](maxlen=_TURNS)

    def laps(self) -> Iterator[Iterator[Frame]]:
        """Yield the frames until the source is closed."""
        self._drop_old_packets()
        yield self._frames()

    def close(self) -> None:
        """Close the port."""
        self._is_closed = True

    def _first_decoder(self, name: str, timeout_s: float) -> PacketDecoder:
        try:
            decoder = self._await_decoder(name, timeout_s)
        except PerceptionError:
            self._socket.close()
            raise
        self._socket.settimeout(_WAIT_S)
        for note in decoder.notes:
            log.warning(note)
        return decoder

    def _await_decoder(self, name: str, timeout_s: float) -> PacketDecoder:
        """Return the decoder of the first packet, or that of the metadata when its packets come."""
        beams = self._beams
        ouster = OusterDecoder(beams) if beams is not None and is_metadata(beams) else None
        end_s, found = time.monotonic() + timeout_s, "none"
        expected = "packets of a LiDAR" if ouster is None else f"packets of a {ouster.sensor.name}"
        with suppress(TimeoutError):
            while (left_s := end_s - time.monotonic()) > 0:
                self._socket.settimeout(left_s)
                packet = self._socket.recv(1 << 16)
                if ouster is None:
                    return VelodyneDecoder.of(packet, name, beams, extra="live")
                if ouster.is_data(packet) and ouster.other_sensor(packet) is None:
                    return ouster
                other = ouster.other_sensor(packet) if ouster.is_data(packet) else None
                found = other or f"packets of {len(packet)} bytes"
        raise ScanError(
            name,
            expected=expected,
            found=f"{found} in {timeout_s:g} s",
            advice="set this computer's address and the port of --udp-port in the LiDAR",
        )

    def _frames(self) -> Iterator[Frame]:
        clock, index = _SensorClock(1 / self.sensor.rate_hz, self._decoder.clock_s), 0
        for packets in self._turns():
            try:
                frame = self._frame(index, self._decoder.decode(packets), clock)
            except PerceptionError as error:
                self.health.report(self.name, _SKIPPED, str(error))
                continue
            self.health.clear([self.name], _SKIPPED)
            index += 1
            yield frame

    def _frame(self, index: int, returns: Cloud, clock: _SensorClock) -> Frame:
        times_s = returns.times_s
        if times_s is None or returns.intensity is None or len(returns) == 0:
            raise ScanError(self.name, expected="at least one return", found="an empty scan")
        first_s, last_s = float(times_s.min()), float(times_s.max())
        if last_s - first_s > _MAX_TURN_S:
            raise ScanError(
                self.name,
                expected=f"the packets of one turn within {_MAX_TURN_S:g} s",
                found=f"{last_s - first_s:.1f} s, as others were lost",
            )
        # The stamp is the moment at which the LiDAR looks ahead, as KITTI's.
        middle_s = (first_s + last_s) / 2
        reflectance = np.clip(returns.intensity / np.float32(self._decoder.full_scale), 0, 1)
        return Frame(
            index,
            clock.time_s(middle_s),
            np.column_stack([returns.xyz, reflectance]),
            source=f"{self.name}, turn {index}",
            point_times_s=(times_s - middle_s).astype(np.float32),
        )

    def _turns(self) -> Iterator[list[bytes]]:
        """Yield the packets of each whole turn; the first one, which is not whole, is left out."""
        packets: list[bytes] = []
        is_whole = False
        for packet in self._in_order():
            if packets and self._decoder.begins_turn(packet, packets[-1]):
                if is_whole:
                    self._check(len(packets))
                    yield packets
                packets, is_whole = [], True
            elif len(packets) >= _MAX_PACKETS:
                packets, is_whole = [], False
            packets.append(packet)

    def _in_order(self) -> Iterator[bytes]:
        """Yield the packets by their times: one that was overtaken in its place, one that came twice once."""
        decoder, waiting = self._decoder, list[tuple[float, bytes]]()
        last_s = -np.inf
        for packet in self._packets():
            time_s = decoder.packet_time_s(packet)
            if waiting:
                # By the clock of the packets that wait, which may just have started again, or been set.
                step_s = _step_s(waiting[-1][0], time_s, decoder.clock_s)
                time_s = waiting[-1][0] + step_s
                if abs(step_s) > _MAX_TURN_S:
                    yield from (one for _, one in waiting)
                    waiting.clear()
                    time_s, last_s = decoder.packet_time_s(packet), -np.inf
            if time_s < last_s or (time_s, packet) in waiting:
                self._left_out += 1
                continue
            insort(waiting, (time_s, packet))
            if len(waiting) > _MAX_LATE:
                last_s, oldest = waiting.pop(0)
                yield oldest

    def _check(self, count: int) -> None:
        """Report what became of the packets of a turn."""
        self._counts.append(count)
        lost, late = max(self._counts) - count, self._left_out
        self._left_out = 0
        found = {
            _LOST: f"{lost} of a turn" if lost > _SPARE_PACKETS else "",
            _ODD: f"{late} of a turn came twice, or too late" if late else "",
            _SILENT: "",
        }
        for fault, reason in found.items():
            if reason:
                self.health.report(self.name, fault, reason)
            else:
                self.health.clear([self.name], fault)

    def _packets(self) -> Iterator[bytes]:
        last_s = told_s = time.monotonic()
        with self._socket:
            while not self._is_closed:
                packet = b""
                with suppress(TimeoutError):
                    packet = self._socket.recv(1 << 16)
                now_s = time.monotonic()
                if packet and self._decoder.is_data(packet):
                    last_s = now_s
                    yield packet
                elif now_s - last_s >= _SILENT_S and now_s - told_s >= _SILENT_STEP_S:
                    told_s, reason = now_s, f"nothing for {now_s - last_s:.1f} s"
                    self.health.report(self.name, _SILENT, reason, HealthLevel.ERROR)
                    self.on_silence()

    def _drop_old_packets(self) -> None:
        """Drop what came while the pipeline was made."""
        self._socket.setblocking(False)
        with suppress(BlockingIOError):
            while not self._is_closed:
                self._socket.recv(1 << 16)
        self._socket.settimeout(_WAIT_S)


def open_udp(port: int, sensor: str | None = None) -> UdpLidar:
    """Open a port, and wait for the first packet.

    Args:
        port: Port.
        sensor: Name or file of the LiDAR model; metadata of an Ouster, or calibration of an HDL-64E; or both with a
            comma. Else the model that the packets name.

    Raises:
        UsageError: The port cannot be opened, or there is no such model.
        ScanError: No packet comes, or one of a LiDAR that is not known.
        CalibrationError: The metadata is damaged.
    """
    names = [one.strip() for one in (sensor or "").split(",") if one.strip()]
    beams = next((Path(one) for one in names if is_beams_file(Path(one))), None)
    model = next((load_sensor(one) for one in names if Path(one) != beams), None)
    log.info("waiting for packets at UDP port %d", port)
    return UdpLidar(UdpAddress(port), model, beams)


def _open(address: UdpAddress) -> socket.socket:
    port = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        port.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        port.bind((address.host, address.port))
    except (OSError, OverflowError) as error:
        port.close()
        raise UsageError(
            f"UDP port {address.port} of {address.host}",
            expected="a port that is free",
            found=getattr(error, "strerror", None) or str(error),
            advice="choose another one with --udp-port",
        ) from error
    return port
