"""Tracking of detected vehicles over time."""
