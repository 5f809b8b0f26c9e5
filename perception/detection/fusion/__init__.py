"""Detections of the camera's image, the depth map and the reflectance map become one (6.2.4)."""
