"""Detector of the bird's-eye view."""
