"""Dense depth and reflectance maps in the camera image, from one LiDAR scan (thesis 6.1, 6.2.2, B)."""
