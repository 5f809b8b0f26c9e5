"""KITTI-360 as it is downloaded."""
