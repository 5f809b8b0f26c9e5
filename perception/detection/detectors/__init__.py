"""Detectors of the three views of a road: the picture, the network, the objects that it sees (6.2.2, 6.2.3)."""
