"""Vehicles in the camera's image, by networks, and on the road, by the scan (thesis chapter 6)."""
