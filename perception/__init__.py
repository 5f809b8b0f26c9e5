"""Trifuse's runtime: geometry, obstacles, tracking and detection on numpy arrays. No torch, no files."""

__version__ = "0.1.0"
