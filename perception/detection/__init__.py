"""Vehicles in the camera's image: proposals from the scan, verified by a network (thesis chapter 6)."""
