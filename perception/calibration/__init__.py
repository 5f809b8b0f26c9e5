"""Calibration of LiDAR and camera: how well the edges of scans lie on those of images, and the calibration where they lie best."""
