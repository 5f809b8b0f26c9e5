"""Rigid transforms, the camera, boxes, grids and registration."""
