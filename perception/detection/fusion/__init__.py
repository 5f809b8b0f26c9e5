"""Fusion of the detections in camera image, depth map and reflectance map (6.2.4)."""
