"""Recorded packets of LiDARs: captures of Wireshark, tcpdump and the makers' viewers as sweeps."""
