"""Packets of LiDARs and captures of them, made by hand as the manuals and the formats describe them."""

import struct
from pathlib import Path

import numpy as np

VLP_16, HDL_32E, VLP_32C, VLS_128 = 0x22, 0x21, 0x28, 0xA1
_UNITS_M = {VLP_32C: 0.004, VLS_128: 0.004}
ALIKE = (0xEEFF,) * 12
PAIRS = (0xEEFF, 0xDDFF) * 6
BANKS = (0xEEFF, 0xDDFF, 0xCCFF, 0xBBFF) * 3
STILL = [0.0] * 12  # a LiDAR that does not turn


def packet(
    azimuths_deg, ranges_m, *, model=VLP_16, mode=0x37, time_us=0, intensity=51, flags=ALIKE
) -> bytes:
    """Return a data packet of a Velodyne: twelve azimuths, and (12, 32) ranges."""
    blocks = np.zeros(12, [("flag", "<u2"), ("azimuth", "<u2"), ("returns", [("range", "<u2"), ("intensity", "u1")], 32)])  # fmt: skip
    blocks["flag"] = flags
    blocks["azimuth"] = np.round(np.mod(azimuths_deg, 360) * 100)
    blocks["returns"]["range"] = np.round(np.asarray(ranges_m) / _UNITS_M.get(model, 0.002))
    blocks["returns"]["intensity"] = intensity
    return blocks.tobytes() + struct.pack("<IBB", time_us, mode, model)


def turns(
    count: float, step_deg: float = 0.4, range_m: float = 10.0, start_us: int = 0
) -> list[bytes]:
    """Return the packets of turns of a VLP-16 that begin ahead, ten a second, in a round room."""
    packets = round(count * 360 / (12 * step_deg))
    return [
        packet(step_deg * (12 * one + np.arange(12)), range_m, time_us=round(start_us + one * PACKET_US) % 3_600_000_000)
        for one in range(packets)
    ]  # fmt: skip


PACKET_US = 12 * 110.592  # of a VLP-16


def udp(payload: bytes, *, source="192.168.1.201", port=2368, source_port=2368, mtu=65535) -> list[bytes]:  # fmt: skip
    """Return the IP packets of a datagram: one, or fragments where it is larger than the MTU."""
    data = struct.pack(">4H", source_port, port, 8 + len(payload), 0) + payload
    size = (mtu - 20) // 8 * 8
    address = bytes(map(int, source.split(".")))
    udp.number = (getattr(udp, "number", 0) + 1) % 65536
    packets = []
    for start in range(0, len(data), size):
        part = data[start : start + size]
        where = start // 8 | (0x2000 if start + size < len(data) else 0)
        header = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(part), udp.number, where, 64, 17, 0)
        packets.append(header + address + b"\xff\xff\xff\xff" + part)
    return packets


def tcp() -> bytes:
    """Return an IP packet of TCP."""
    return struct.pack(">BBHHHBBH", 0x45, 0, 60, 1, 0, 64, 6, 0) + bytes(48)


LINKS = {
    "ethernet": (1, bytes(12) + b"\x08\x00"),
    "vlan": (1, bytes(12) + b"\x81\x00\x00\x05\x08\x00"),
    "two tags": (1, bytes(12) + b"\x88\xa8\x00\x05\x81\x00\x00\x06\x08\x00"),
    "linux cooked": (113, bytes(14) + b"\x08\x00"),
    "linux cooked 2": (276, b"\x08\x00" + bytes(18)),
    "raw IP": (101, b""),
    "loopback": (0, b"\x02\x00\x00\x00"),
}


def pcap(packets, path: Path, *, link="ethernet", period_us=1327, order="<", start_s=1_700_000_000) -> Path:  # fmt: skip
    """Write IP packets as a pcap; return its path."""
    kind, header = LINKS[link]
    parts = [struct.pack(f"{order}IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, kind)]
    for number, ip in enumerate(packets):
        seconds, us = divmod(round(number * period_us), 1_000_000)
        length = len(header) + len(ip)
        parts += [struct.pack(f"{order}4I", start_s + seconds, us, length, length), header, ip]
    path.write_bytes(b"".join(parts))
    return path


def pcapng(packets, path: Path, *, link="ethernet", period_ns=1_327_000, start_s=1_700_000_000) -> Path:  # fmt: skip
    """Write IP packets as a pcapng of two interfaces with times in ns, of which the second has them."""
    kind, header = LINKS[link]
    resolution = struct.pack("<HHBxxxHH", 9, 1, 9, 0, 0)

    def block(number: int, body: bytes) -> bytes:
        body += bytes(-len(body) % 4)
        return struct.pack("<II", number, 12 + len(body)) + body + struct.pack("<I", 12 + len(body))

    parts = [block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))]
    parts += [block(1, struct.pack("<HHI", 147, 0, 0)), block(1, struct.pack("<HHI", kind, 0, 0) + resolution)]  # fmt: skip
    for number, ip in enumerate(packets):
        time_ns = start_s * 10**9 + number * period_ns
        data = header + ip
        words = struct.pack("<5I", 1, time_ns >> 32, time_ns & 0xFFFFFFFF, len(data), len(data))
        parts.append(block(6, words + data))
    path.write_bytes(b"".join(parts))
    return path
