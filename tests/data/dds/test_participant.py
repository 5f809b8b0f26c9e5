"""A participant of a domain: its settings, and what others see of it."""

import os
import socket
from pathlib import Path

import pytest

from data.dds.participant import DdsParticipant
from perception.errors import MissingDependencyError, UsageError

pytest.importorskip("cyclonedds", reason="the extra `ros` is not installed")

POINTS = "sensor_msgs/msg/PointCloud2"
# As ROS 2 publishes it from Iron on.
POINTS_HASH = "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"


def test_others_learn_the_hash_of_a_type(domain: int):
    from cyclonedds.qos import Policy

    with DdsParticipant() as participant:
        writer = participant.writer("/points", POINTS)
        (found,) = (
            one for one in participant._publications.read(9) if one.topic_name == "rt/points"
        )
        assert found.qos[Policy.Userdata].data.decode() == f"typehash={POINTS_HASH};"
        assert not writer.has_readers


def devices(domain: int) -> list[bytes]:
    """Return the network devices to which the sockets of this process in a domain are bound, by their ports."""
    found, first = {}, 7400 + 250 * domain
    for entry in Path("/proc/self/fd").iterdir():
        if entry.is_socket():
            with socket.socket(fileno=os.dup(int(entry.name))) as one:
                name = one.getsockname()
                if one.type == socket.SOCK_DGRAM and first <= name[1] < first + 250:
                    found[name] = one.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
    return [found[name].rstrip(b"\0") for name in sorted(found)]


def test_what_others_send_comes_through_the_interface_that_was_named(domain: int):
    with DdsParticipant():
        assert devices(domain) == [b"lo", b"lo"]
    with DdsParticipant("0.0.0.0"):
        assert {*devices(domain)} == {b""}


def test_a_domain_that_is_none_is_one_sentence(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "233")
    with pytest.raises(
        UsageError, match="ROS_DOMAIN_ID: expected a number from 0 to 232, found '233'"
    ):
        DdsParticipant()


def test_an_interface_that_is_none_is_one_sentence(domain: int):
    with pytest.raises(UsageError, match=r"--host 192.0.2.7: expected the address of a network"):
        DdsParticipant("192.0.2.7")


def test_without_cyclonedds_the_line_that_installs_it(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "cyclonedds.builtin", None)
    with pytest.raises(MissingDependencyError, match=r"cyclonedds.*pip install.*\[ros\]"):
        DdsParticipant()
