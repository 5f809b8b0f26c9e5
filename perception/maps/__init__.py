"""Dense maps as the camera sees them: depth and reflectance from one LiDAR scan (thesis 6.1, 6.2.2, B)."""
