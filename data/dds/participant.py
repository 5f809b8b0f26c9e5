"""A participant of a DDS domain that speaks as a node of ROS 2 does."""

import logging
import os
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from data.dds.message_class import kind_of, message_class, value_of
from data.messages.definitions import typestore
from perception.errors import UsageError, optional_package

if TYPE_CHECKING:
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Qos
    from cyclonedds.sub import DataReader

log = logging.getLogger(__name__)

LOOPBACK = "127.0.0.1"
_LOOPBACK_DEVICE = b"lo\0"
_ALL_INTERFACES = "0.0.0.0"
_MAX_DOMAIN = 232
_FIRST_PORT, _PORTS = 7400, 250  # of the first domain, and of each
_TOPIC_PREFIX = "rt"  # of topics of ROS 2 among those of DDS
_MANY_TOPICS = 10_000
# A scan is sent in some thousand packets, which are lost where they find no room; the kernel may grant less.
_BUFFER_BYTES = 16 << 20
# Without multicast, which the loopback interface rarely has, others are found at the ports of the first participants.
_CONFIG = """<CycloneDDS><Domain Id="any">
<General><Interfaces><NetworkInterface address="{address}"/></Interfaces>{sending}</General>
<Internal><SocketReceiveBufferSize min="default" max="{buffer}B"/></Internal>{discovery}
</Domain></CycloneDDS>"""
# The loopback interface takes packets of 64 kB: a third of the CPU of those of 1.3 kB, by a scan of 3 MB.
_SENDING = """<AllowMulticast>false</AllowMulticast><MaxMessageSize>65500B</MaxMessageSize>
<FragmentSize>16000B</FragmentSize>"""
_PEERS = """<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
<Peers><Peer address="localhost"/></Peers></Discovery>"""

# As ROS 2 names its profiles; `latched` keeps the last message for those who come later.
QosProfile = Literal["sensor_data", "default", "latched"]


@dataclass(frozen=True)
class Publication:
    """A topic that another participant publishes.

    Attributes:
        name: Name in ROS 2, such as /velodyne_points.
        kind: Full name of its type, such as sensor_msgs/msg/PointCloud2.
        is_reliable: Whether all who publish it send lost messages again.
    """

    name: str
    kind: str
    is_reliable: bool


class DdsParticipant:
    """Readers, writers and the topics of others in one domain; a context manager, which leaves the domain."""

    def __init__(self, host: str = LOOPBACK) -> None:
        """Join the domain of `ROS_DOMAIN_ID`, 0 by default.

        Args:
            host: Address of the network interface; 0.0.0.0 for the one that DDS chooses. What CYCLONEDDS_URI states
                wins.

        Raises:
            MissingDependencyError: cyclonedds or rosbags is not installed.
            UsageError: There is no such domain or interface.
        """
        with optional_package("cyclonedds", needed_for="topics of ROS 2", extra="ros"):
            from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
            from cyclonedds.core import DDSException
            from cyclonedds.domain import Domain, DomainParticipant
        self.domain = _domain()
        try:
            config = _config(host)
            self._domain = None if config is None else Domain(self.domain, config)
            self._participant = DomainParticipant(self.domain)
        except DDSException as error:
            raise UsageError(
                f"--host {host}",
                expected="the address of a network interface of this computer",
                found=str(error.msg),
                advice=f"name one that `ip address` lists, {LOOPBACK} for this computer alone",
            ) from error
        if config is not None and host == LOOPBACK:
            _keep_to_loopback(self.domain)
        self._publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the domain."""
        del self._publications, self._participant, self._domain

    @property
    def native(self) -> Any:  # noqa: ANN401 - of cyclonedds, which need not be installed
        """Participant of the library."""
        return self._participant

    def publications(self) -> tuple[Publication, ...]:
        """Return the topics of ROS 2 that others publish now, by name."""
        # The least reliable one comes last: nobody who asks for more than that receives it.
        found = sorted(self._others(), key=lambda one: (one.name, one.kind, not one.is_reliable))
        return tuple({(one.name, one.kind): one for one in found}.values())

    def _others(self) -> Iterator[Publication]:
        from cyclonedds.qos import Policy

        own = self._participant.guid
        for one in self._publications.read(_MANY_TOPICS):
            if one.topic_name is None:
                continue  # says that a publisher has left
            prefix, _, name = one.topic_name.partition("/")
            kind = kind_of(one.type_name)
            if one.participant_key == own or prefix != _TOPIC_PREFIX or not kind:
                continue
            reliability = one.qos[Policy.Reliability]
            yield Publication(f"/{name}", kind, reliability != Policy.Reliability.BestEffort)

    def reader(self, name: str, kind: str, profile: QosProfile, depth: int) -> "DataReader[Any]":
        """Return a reader of a topic."""
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.sub import DataReader

        # What this participant publishes itself is no news.
        qos = Qos(Policy.IgnoreLocal.Participant, base=_qos(kind, profile, depth))
        return DataReader(self._participant, self._topic(name, kind), qos=qos)

    def writer(
        self, name: str, kind: str, profile: QosProfile = "default", depth: int = 1
    ) -> "TopicWriter":
        """Return a writer of a topic."""
        from cyclonedds.pub import DataWriter

        qos = _qos(kind, profile, depth)
        writer = DataWriter(self._participant, self._topic(name, kind), qos=qos)
        return TopicWriter(kind, writer)

    def _topic(self, name: str, kind: str) -> Any:  # noqa: ANN401
        from cyclonedds.topic import Topic

        return Topic(self._participant, f"{_TOPIC_PREFIX}{name}", message_class(kind))


class TopicWriter:
    """Writes messages of one topic, and waits for nobody."""

    def __init__(self, kind: str, writer: "DataWriter[Any]") -> None:
        self._kind, self._writer = kind, writer

    @property
    def has_readers(self) -> bool:
        """Whether anybody takes the next message."""
        return bool(self._writer.get_matched_subscriptions())

    def write(self, binary: bytes) -> bool:
        """Send a message in its binary form; return whether it was not dropped, as a reader is too slow."""
        from cyclonedds.core import DDSException

        try:
            self._writer.write(value_of(self._kind, binary))
        except DDSException as error:
            if error.code != DDSException.DDS_RETCODE_TIMEOUT:
                raise
            return False
        return True


def _domain() -> int:
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not text.isdecimal() or int(text) > _MAX_DOMAIN:
        raise UsageError(
            "ROS_DOMAIN_ID", expected=f"a number from 0 to {_MAX_DOMAIN}", found=f"{text!r}"
        )
    return int(text)


def _config(host: str) -> str | None:
    """Return the configuration for an interface; None where the environment or the library chooses."""
    if "CYCLONEDDS_URI" in os.environ or host == _ALL_INTERFACES:
        return None
    is_local = host == LOOPBACK
    return _CONFIG.format(
        address=host,
        buffer=_BUFFER_BYTES,
        sending=_SENDING if is_local else "",
        discovery=_PEERS if is_local else "",
    )


def _keep_to_loopback(domain: int) -> None:
    """Receive nothing from other interfaces, to whose ports the library always binds its sockets."""
    first = _FIRST_PORT + _PORTS * domain
    for entry in Path("/proc/self/fd").iterdir():
        if not entry.is_socket():
            continue
        with socket.socket(fileno=os.dup(int(entry.name))) as one:
            if one.type != socket.SOCK_DGRAM or one.family != socket.AF_INET:
                continue
            device = socket.SOL_SOCKET, socket.SO_BINDTODEVICE
            is_own = first <= one.getsockname()[1] < first + _PORTS
            if not is_own or one.getsockopt(*device, len(_LOOPBACK_DEVICE)) == _LOOPBACK_DEVICE:
                continue
            try:
                one.setsockopt(*device, _LOOPBACK_DEVICE)
            except PermissionError:
                log.warning(
                    "the ports of DDS are open on all interfaces before Linux 5.7: let a firewall close them"
                )
                return


def _qos(kind: str, profile: QosProfile, depth: int) -> "Qos":
    """Return the quality of a topic; from Iron on, ROS 2 compares the hash of its type that others state."""
    from cyclonedds.qos import Policy, Qos

    is_reliable, is_latched = profile != "sensor_data", profile == "latched"
    reliability = Policy.Reliability
    return Qos(
        reliability.Reliable(0) if is_reliable else reliability.BestEffort,
        Policy.Durability.TransientLocal if is_latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(f"typehash={typestore().hash_rihs01(kind)};".encode()),
    )
