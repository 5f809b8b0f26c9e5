"""From scans and poses to ground, static and moving obstacles (thesis 5.1)."""
