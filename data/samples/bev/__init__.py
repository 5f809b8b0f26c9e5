"""Labelled scans as maps from above."""
