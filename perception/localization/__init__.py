"""Poses of the LiDAR: registration of scans, alignment, and the check of the mounting."""
