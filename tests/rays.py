"""Directions of the beams of a turning LiDAR."""

import numpy as np


def unit_rays(azimuths_rad: np.ndarray, elevations_rad: np.ndarray) -> np.ndarray:
    """Return (N, 3) unit vectors: those of all azimuths at the first elevation, then at the next."""
    azimuth, elevation = np.meshgrid(azimuths_rad, elevations_rad)
    x, y = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth)
    return np.stack([x, y, np.sin(elevation)], axis=-1).reshape(-1, 3)
