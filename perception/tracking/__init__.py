"""Tracking of objects over time: moving objects, detected vehicles, and one object."""
