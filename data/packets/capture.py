"""Read a capture: pcap or pcapng, over Ethernet, Linux cooked, raw IP or loopback.

The readers of the decoders tell neither senders nor fragments apart, and give no place to read a sweep from again.
"""

from collections.abc import Iterator
from pathlib import Path
from struct import error as TooShort  # noqa: N812 - an exception
from struct import unpack_from

from data.packets.datagrams import Capture, Data, Fragments, Sender, file_bytes
from perception.errors import DriveError

_Packet = tuple[int, int, int, int]  # time in ns, link type, start and end in the file
# By the first bytes of a pcap: byte order, and unit of the fractions of a second in ns.
_PCAP = {
    b"\xd4\xc3\xb2\xa1": ("<", 1000), b"\xa1\xb2\xc3\xd4": (">", 1000),
    b"\x4d\x3c\xb2\xa1": ("<", 1), b"\xa1\xb2\x3c\x4d": (">", 1),
}  # fmt: skip
_MAX_TIME_NS = 2**62  # in the year 2116
_PCAPNG = b"\x0a\x0d\x0d\x0a"
_INTERFACE_BLOCK, _PACKET_BLOCK, _RESOLUTION = 1, 6, 9
# By link type (loopback, Ethernet, raw IP, Linux cooked 1 and 2): length of the header, and place of the protocol in it.
_LINKS = {
    0: (4, None), 108: (4, None), 1: (14, 12), 12: (0, None), 14: (0, None), 101: (0, None), 228: (0, None),
    229: (0, None), 113: (16, 14), 276: (20, 0),
}  # fmt: skip
_VLAN, _IP, _TCP, _UDP, _IPV6_FRAGMENT = (0x8100, 0x88A8, 0x9100), (0x0800, 0x86DD), 6, 17, 44


def read_capture(path: Path) -> Capture:
    """Find the datagrams of a capture.

    Raises:
        DriveError: The file is no capture.
    """
    data, capture, fragments = file_bytes(path), Capture(path), Fragments()
    if data[:4] not in {*_PCAP, _PCAPNG}:
        found = f"a file that begins with {data[:4].hex(' ')}" if data else "an empty file"
        raise DriveError(path, expected="a capture as pcap or pcapng", found=found)
    try:
        for packet in _pcapng(data) if data[:4] == _PCAPNG else _pcap(data):
            capture.is_cut |= packet[3] > len(data)
            reason = None if capture.is_cut else _add(capture, data, packet, fragments)
            if reason:
                capture.others[reason] += 1
    except TooShort:
        capture.is_cut = True
    return capture


def _pcap(data: Data) -> Iterator[_Packet]:
    order, fraction_ns = _PCAP[data[:4]]
    (link,), place = unpack_from(f"{order}I", data, 20), 24
    while place < len(data):
        seconds, fraction, length = unpack_from(f"{order}3I", data, place)
        place += 16 + length
        yield seconds * 10**9 + fraction * fraction_ns, link & 0xFFFF, place - length, place


def _pcapng(data: Data) -> Iterator[_Packet]:
    order, place, interfaces = "<", 0, list[tuple[int, int]]()
    while place < len(data):
        if data[place : place + 4] == _PCAPNG:
            order, interfaces = "<" if data[place + 8 : place + 9] == b"\x4d" else ">", []
        kind, length = unpack_from(f"{order}2I", data, place)
        if kind == _INTERFACE_BLOCK:
            (link,) = unpack_from(f"{order}H", data, place + 8)
            interfaces.append((link, _ticks_per_s(data, order, place + 16, place + length - 4)))
        elif kind == _PACKET_BLOCK:
            which, high, low, size = unpack_from(f"{order}4I", data, place + 8)
            link, per_s = interfaces[which] if which < len(interfaces) else (1, 10**6)
            time_ns = min((high << 32 | low) * 10**9 // per_s, _MAX_TIME_NS)
            yield time_ns, link, place + 28, place + 28 + size
        place += max(length, 12)


def _ticks_per_s(data: Data, order: str, place: int, end: int) -> int:
    """Return the resolution of an interface's times, which is one of its options."""
    while place + 4 < end:
        option, length = unpack_from(f"{order}2H", data, place)
        if option == _RESOLUTION:
            (power,) = unpack_from("B", data, place + 4)
            return int(2 ** (power & 127) if power & 128 else 10**power)
        place += 4 + (length + 3 & ~3)
    return 10**6


def _add(capture: Capture, data: Data, packet: _Packet, fragments: Fragments) -> str | None:
    """Add the datagram that a packet holds or completes; return what the packet is instead."""
    time_ns, link, start, end = packet
    ip = _ip_start(data, link, start, end)
    if ip is None or ip + 28 > end:
        return "packets without IP" if link in _LINKS else f"packets of link type {link}"
    if data[ip] >> 4 == 4:
        size, key, where, protocol = unpack_from(">2xH2sHxB", data, ip)
        sender, begin = data[ip + 12 : ip + 16], ip + 4 * (data[ip] & 15)
        last, offset, has_more = ip + (size or end - ip), 8 * (where & 0x1FFF), where & 0x2000
    else:
        size, protocol = unpack_from(">HB", data, ip + 4)
        sender, begin, last = data[ip + 8 : ip + 24], ip + 40, ip + 40 + size
        key, offset, has_more = b"", 0, 0
        if protocol == _IPV6_FRAGMENT and begin + 16 <= end:
            protocol, where, key = unpack_from(">BxH4s", data, begin)
            begin, offset, has_more = begin + 8, where & 0xFFF8, where & 1
    if protocol != _UDP:
        return "packets of TCP" if protocol == _TCP else "packets of other protocols"
    if last > end or begin + 8 * (not offset) > last:
        return "packets that were cut when they were recorded"
    pieces = [(begin, last)]
    if offset or has_more:
        pieces = fragments.join(sender + key, offset, pieces[0], is_last=not has_more)
    if pieces and pieces[0][1] - pieces[0][0] >= 8:
        ports = unpack_from(">2H", data, pieces[0][0])
        pieces[0] = (pieces[0][0] + 8, pieces[0][1])
        capture.senders[Sender(sender, *ports)].add(time_ns, pieces)
    return None


def _ip_start(data: Data, link: int, start: int, end: int) -> int | None:
    """Return where the IP header of a packet begins, behind tags of VLANs; None without one."""
    header, protocol_at = _LINKS.get(link, (end, None))
    ip = start + header
    if protocol_at is None or ip > end:
        return ip
    (kind,) = unpack_from(">H", data, start + protocol_at)
    while kind in _VLAN and ip + 4 <= end:
        (kind,), ip = unpack_from(">H", data, ip + 2), ip + 4
    return ip if kind in _IP else None
