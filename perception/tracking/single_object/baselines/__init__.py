"""Trackers of one object that the thesis compares with (7.1.3)."""
