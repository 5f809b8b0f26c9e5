"""Metrics of boxes detected in images, by KITTI's 2D protocol: arrays in, named results out."""
