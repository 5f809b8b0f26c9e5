"""What a decoder of packets does: it finds the sweeps among the packets of a LiDAR, and the points of a sweep."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

from data.clouds.cloud import Cloud
from perception.sensor import LidarModel
from perception.types import Int


@dataclass(frozen=True)
class PacketSweep:
    """Packets of one turn.

    Attributes:
        packets: (P,) indices of its packets.
        middle_s: Time of its middle by the sensor's clock.
        is_whole: Whether its start and its end were recorded.
    """

    packets: Int
    middle_s: float
    is_whole: bool


class PacketDecoder(Protocol):
    """Decoder of the packets of one LiDAR."""

    @property
    def sensor(self) -> LidarModel:
        """LiDAR model."""

    @property
    def clock_s(self) -> float:
        """Time after which the sensor's clock begins again."""

    @property
    def notes(self) -> Sequence[str]:
        """Sentences on what was assumed."""

    @property
    def full_scale(self) -> float:
        """Intensity that stands for a reflectance of 1."""

    def is_data(self, packet: bytes) -> bool:
        """Return whether a packet has returns of this LiDAR."""

    def packet_time_s(self, packet: bytes) -> float:
        """Return the time of a packet by the sensor's clock."""

    def begins_turn(self, packet: bytes, before: bytes) -> bool:
        """Return whether a packet is of another turn than the one before it."""

    def sweeps(self, packets: Iterable[bytes]) -> list[PacketSweep]:
        """Find the sweeps among all packets of the sender."""

    def decode(self, packets: Sequence[bytes]) -> Cloud:
        """Return the returns of packets that follow each other, times by the sensor's clock.

        Raises:
            ScanError: They are no packets of this LiDAR.
        """
