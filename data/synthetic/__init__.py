"""A parametric street, the sensors that see it, and the layouts it is written in."""
