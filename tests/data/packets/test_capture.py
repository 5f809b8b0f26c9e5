"""Captures of every form, with the same datagrams."""

import struct

import numpy as np
import pytest

from data.packets.capture import read_capture
from data.packets.datagrams import file_bytes
from perception.errors import DriveError
from tests.packet_writer import LINKS, pcap, pcapng, tcp, udp

RANDOM = np.random.default_rng(0)
PAYLOADS = [RANDOM.bytes(length) for length in (1206, 8448, 512)]


def only(capture):
    """Return the datagrams of the only sender, as bytes, and their times."""
    (datagrams,) = capture.senders.values()
    data = file_bytes(capture.path)
    return [datagrams.read(index, data) for index in range(len(datagrams))], datagrams.times_ns


@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("write", [pcap, pcapng])
def test_datagrams_of_every_link_and_format(tmp_path, link, write):
    packets = [one for payload in PAYLOADS for one in udp(payload)]
    capture = read_capture(write(packets, tmp_path / "a.pcap", link=link))
    found, times_ns = only(capture)
    assert found == PAYLOADS
    assert np.diff(times_ns).tolist() == [1_327_000] * 2
    assert times_ns[0] == 1_700_000_000 * 10**9
    assert not capture.is_cut
    assert [str(one) for one in capture.senders] == ["192.168.1.201:2368"]


def test_numbers_of_the_other_byte_order(tmp_path):
    capture = read_capture(pcap(udp(PAYLOADS[0]), tmp_path / "a.pcap", order=">"))
    assert only(capture)[0] == PAYLOADS[:1]


@pytest.mark.parametrize("order", [1, -1])
def test_fragments_are_joined_in_any_order(tmp_path, order):
    packets = [one for payload in PAYLOADS for one in udp(payload, mtu=1500)[::order]]
    assert len(packets) == 1 + 6 + 1
    assert only(read_capture(pcap(packets, tmp_path / "a.pcap")))[0] == PAYLOADS


def test_fragments_of_ip_version_6(tmp_path):
    data = struct.pack(">4H", 2368, 2368, 8 + len(PAYLOADS[1]), 0) + PAYLOADS[1]
    addresses = bytes(15) + b"\x01" + bytes(15) + b"\x02"
    packets = []
    for start in range(0, len(data), 1448):
        part = data[start : start + 1448]
        where = start | (start + 1448 < len(data))
        fragment = struct.pack(">BBHI", 17, 0, where, 7)
        head = struct.pack(">IHBB", 6 << 28, len(fragment) + len(part), 44, 64)
        packets.append(head + addresses + fragment + part)
    capture = read_capture(pcap(packets, tmp_path / "a.pcap", link="raw IP"))
    assert only(capture)[0] == PAYLOADS[1:2]
    assert str(next(iter(capture.senders))) == "[::1]:2368"


def test_a_datagram_of_which_a_fragment_is_lost_is_left_out(tmp_path):
    packets = [*udp(PAYLOADS[1], mtu=1500)[:-1], *udp(PAYLOADS[1], mtu=1500)]
    assert only(read_capture(pcap(packets, tmp_path / "a.pcap")))[0] == [PAYLOADS[1]]


def test_senders_are_separated(tmp_path):
    packets = [
        *udp(b"a" * 20), *udp(b"b" * 20, source="192.168.1.202"), *udp(b"c" * 20, port=8308), tcp(), tcp(),
    ]  # fmt: skip
    capture = read_capture(pcap(packets, tmp_path / "a.pcap"))
    names = [str(one) for one in capture.senders]
    assert names == ["192.168.1.201:2368", "192.168.1.202:2368", "192.168.1.201:8308"]
    assert capture.others == {"packets of TCP": 2}
    first = next(iter(capture.senders))
    assert [first.is_named(name) for name in ("192.168.1.201", "2368", "192.168.1.201:2368", "8308")] == [True, True, True, False]  # fmt: skip


@pytest.mark.parametrize("write", [pcap, pcapng])
@pytest.mark.parametrize("missing", [1, 600, 1240])
def test_what_is_whole_before_the_end_is_kept(tmp_path, write, missing):
    path = write([one for _ in range(3) for one in udp(PAYLOADS[0])], tmp_path / "a.pcap")
    path.write_bytes(path.read_bytes()[:-missing])
    capture = read_capture(path)
    assert capture.is_cut == (write is pcap or missing > 4)
    assert only(capture)[0] == PAYLOADS[:1] * (2 if capture.is_cut else 3)


def test_packets_that_were_cut_when_recorded_are_counted(tmp_path):
    packets = [udp(PAYLOADS[0])[0][:96], *udp(PAYLOADS[0])]
    capture = read_capture(pcap(packets, tmp_path / "a.pcap"))
    assert capture.others == {"packets that were cut when they were recorded": 1}
    assert only(capture)[0] == PAYLOADS[:1]


@pytest.mark.parametrize(
    ("content", "found"), [(b"", "an empty file"), (b"GIF89a", "a file that begins with 47 49 46 38")]
)  # fmt: skip
def test_other_files_are_refused(tmp_path, content, found):
    path = tmp_path / "a.pcap"
    path.write_bytes(content)
    with pytest.raises(DriveError, match=f"a.pcap: expected a capture as pcap or pcapng, found {found}"):  # fmt: skip
        read_capture(path)


def test_a_capture_may_end_within_the_options_of_an_interface(tmp_path):
    path = pcapng(udp(PAYLOADS[0]), tmp_path / "a.pcap")
    data = path.read_bytes()
    resolution = data.index(struct.pack("<HHB", 9, 1, 9))
    for end in range(resolution, resolution + 5):
        path.write_bytes(data[:end])
        capture = read_capture(path)
        assert capture.is_cut
        assert not capture.senders
