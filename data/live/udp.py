"""A LiDAR on the network as a source: its packets are gathered to one scan a turn."""

import logging
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from data.clouds.cloud import Cloud
from data.live.source import LiveSource
from data.packets.velodyne import VelodyneDecoder, first_azimuth_rad, is_data_packet
from perception.errors import PerceptionError, ScanError, UsageError
from perception.sensor import LidarModel, load_sensor
from perception.types import Frame

log = logging.getLogger(__name__)

_BUFFER_BYTES = 1 << 22  # of the socket: a second of packets, while a scan is decoded
_WAIT_S = 0.2  # between two looks at whether the source is closed
_HOUR_S = 3600.0
_MAX_STEP_S = 60.0  # between two scans; a longer one means that the sensor's clock was set
_MAX_TURN_S = 0.5  # the slowest turn is 0.2 s
_MAX_PACKETS = 2000  # of one turn: a LiDAR that stands still must not fill the memory


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
    """Time by the sensor's clock, which starts again every hour, as time of this computer."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._last_s = 0.0
        self._time_s: float | None = None

    def time_s(self, since_hour_s: float) -> float:
        """Return the time of the next scan; a period after the last one where the clock was set."""
        if self._time_s is None:
            self._time_s = time.time()
        else:
            step_s = (since_hour_s - self._last_s) % _HOUR_S
            self._time_s += step_s if 0 < step_s < _MAX_STEP_S else self._period_s
        self._last_s = since_hour_s
        return self._time_s


class UdpLidar(LiveSource):
    """Scans of a Velodyne LiDAR, one a turn; a turn begins behind the vehicle."""

    def __init__(self, address: UdpAddress, sensor: LidarModel | None = None) -> None:
        """Open the port and wait for the first packet, which tells the model.

        Args:
            address: Address at which packets arrive.
            sensor: LiDAR model, such as one of another height; else the one that the packets name.

        Raises:
            UsageError: The port cannot be opened.
            ScanError: No packet comes, or one of a LiDAR that is not known.
        """
        self._is_closed = False
        self._socket = _open(address)
        self.port: int = self._socket.getsockname()[1]
        name = f"UDP port {self.port}"
        self._decoder = self._first_decoder(name, address.timeout_s)
        super().__init__(name, sensor or self._decoder.sensor, is_sequence=True)

    def laps(self) -> Iterator[Iterator[Frame]]:
        """Yield the frames until the source is closed."""
        self._drop_old_packets()
        yield self._frames()

    def close(self) -> None:
        """Close the port."""
        self._is_closed = True

    def _first_decoder(self, name: str, timeout_s: float) -> VelodyneDecoder:
        self._socket.settimeout(timeout_s)
        try:
            packet = self._socket.recv(1 << 16)
            decoder = VelodyneDecoder.of(packet, name, extra="live")
        except TimeoutError as error:
            self._socket.close()
            raise ScanError(
                name,
                expected="packets of a LiDAR",
                found=f"none in {timeout_s:g} s",
                advice="set this computer's address and the port of --udp-port in the LiDAR",
            ) from error
        except PerceptionError:
            self._socket.close()
            raise
        self._socket.settimeout(_WAIT_S)
        for note in decoder.notes:
            log.warning(note)
        return decoder

    def _frames(self) -> Iterator[Frame]:
        clock, index = _SensorClock(1 / self.sensor.rate_hz), 0
        for packets in self._turns():
            try:
                frame = self._frame(index, self._decoder.decode(packets), clock)
            except PerceptionError as error:
                log.warning("skipped a turn: %s", error)
                continue
            index += 1
            yield frame

    def _frame(self, index: int, returns: Cloud, clock: _SensorClock) -> Frame:
        since_hour_s = returns.times_s
        if since_hour_s is None or returns.intensity is None or len(returns) == 0:
            raise ScanError(self.name, expected="at least one return", found="an empty scan")
        if since_hour_s[-1] - since_hour_s[0] > _MAX_TURN_S:
            raise ScanError(
                self.name,
                expected=f"the packets of one turn within {_MAX_TURN_S:g} s",
                found=f"{since_hour_s[-1] - since_hour_s[0]:.1f} s, as others were lost",
            )
        # The stamp is the moment at which the LiDAR looks ahead, as KITTI's.
        middle_s = float(since_hour_s[0] + since_hour_s[-1]) / 2
        return Frame(
            index,
            clock.time_s(middle_s % _HOUR_S),
            np.column_stack([returns.xyz, np.clip(returns.intensity / np.float32(255), 0, 1)]),
            source=f"{self.name}, turn {index}",
            point_times_s=(since_hour_s - middle_s).astype(np.float32),
        )

    def _turns(self) -> Iterator[list[bytes]]:
        """Yield the packets of each whole turn; the first one, which is not whole, is left out."""
        packets: list[bytes] = []
        is_whole, last_rad = False, 0.0
        for packet in self._packets():
            # 0 behind the vehicle, growing through a turn.
            behind_rad = (first_azimuth_rad(packet) + np.pi) % (2 * np.pi)
            if behind_rad < last_rad - np.pi:
                if is_whole:
                    yield packets
                packets, is_whole = [], True
            elif len(packets) >= _MAX_PACKETS:
                packets, is_whole = [], False
            last_rad = behind_rad
            packets.append(packet)

    def _packets(self) -> Iterator[bytes]:
        with self._socket:
            while not self._is_closed:
                try:
                    packet = self._socket.recv(1 << 16)
                except TimeoutError:
                    continue
                if is_data_packet(packet):
                    yield packet

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
        sensor: Name or file of the LiDAR model; else the one that the packets name.

    Raises:
        UsageError: The port cannot be opened, or there is no such model.
        ScanError: No packet comes, or one of a LiDAR that is not known.
    """
    model = load_sensor(sensor) if sensor else None
    log.info("waiting for packets at UDP port %d", port)
    return UdpLidar(UdpAddress(port), model)


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
