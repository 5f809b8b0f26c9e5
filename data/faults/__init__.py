"""Faults of sensors in the middle of a drive: one function a fault, with a size, applied to frames by a seed."""
