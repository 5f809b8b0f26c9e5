"""Detected vehicles as objects on the road: their points, places and boxes, and who they are over time."""
