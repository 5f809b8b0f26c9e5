"""Tracking of one object from its initial box on, by LiDAR and camera or by one of them."""
